"""Throughput of batches: `python -m benchmarks.batches CHARACTERS [--files 200] [--runs NAME,…]`.

Writes frames of the characters as files, one of which is broken and one of which makes Blender's importer hang forever
(its materials are a pipe to which nobody writes), and learns a model from each: with one process, with two, with two
Dask workers, with two Dask workers of which one is killed, and with two processes that are killed and resumed. Prints a
Markdown table of seconds, seconds of processors, throughput and results; the models of all runs must have the same
bytes. Seconds of processors tell the cost of Dask on a busy machine, too: of all processes of a batch and its cluster,
without the start of the cluster. Then it measures how long another number of segments takes with a cache. Needs Linux
or macOS.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import resource
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import psutil

from benchmarks.speed import table_row

SETTINGS = ("--segments", "6", "--no-thumbnails")
TIME_LIMIT = 60
"""Time limit of a file in seconds; the file that hangs takes all of it."""
BROKEN_FILE, HANGING_FILE, PIPE = "broken.glb", "0_hangs.obj", "nobody_writes"
"""The file that hangs is the first by name, so that no run waits for it at the end."""
QUIET = {"DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED": "False", "DASK_DISTRIBUTED__ADMIN__TICK__INTERVAL": "500ms"}
"""Environment of the scheduler and of workers, as docs/batches.md has it: they then watch themselves less often."""
CACHED_FRAMES = 5
FIRST_SEGMENTS, OTHER_SEGMENTS = 8, 6
"""Number of segments of the first fit, and of the one that uses its cache."""
WRITE_FRAMES = """
import os, random, sys
import bpy
source, target, count = sys.argv[1], sys.argv[2], int(sys.argv[3])
bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
bpy.ops.import_scene.gltf(filepath=source)
turn, scene = random.Random(0), bpy.context.scene
rigs = [obj for obj in bpy.data.objects if obj.type == "ARMATURE"]
ranges = [action.frame_range for action in bpy.data.actions]
first, last = (ranges[0][0], ranges[0][1]) if ranges else (1, count)
for i in range(count):
    scene.frame_set(round(first + (last - first) * (i + 0.5) / count))
    if not ranges:
        for rig in rigs:
            for bone in rig.pose.bones:
                bone.rotation_mode = "XYZ"
                bone.rotation_euler = [turn.uniform(-0.35, 0.35) if bone.parent else 0.0 for _ in range(3)]
        bpy.context.view_layer.update()
    bpy.ops.wm.obj_export(filepath=f"{target}_{i:02d}.obj", export_materials=False)
sys.stdout.flush()
os._exit(0)
"""


def main() -> None:
    """Run all that the options ask for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("characters", type=Path, help="a folder of .glb files")
    parser.add_argument("--files", type=int, default=200, help="number of files to write")
    parser.add_argument("--output", type=Path, default=Path("demo/batches"))
    parser.add_argument("--runs", default=",".join([*RUNS, "cached"]))
    options = parser.parse_args()
    runs = options.runs.split(",")
    if unknown := set(runs) - {*RUNS, "cached"}:
        parser.error(f"--runs: there is no {', '.join(sorted(unknown))}; there are {', '.join([*RUNS, 'cached'])}")
    shutil.rmtree(options.output, ignore_errors=True)
    options.output.mkdir(parents=True)
    inputs = options.output / "in"
    write_inputs(sorted(options.characters.glob("*.glb")), inputs, options.files)
    print("| run | seconds | of processors | files a minute | times the first | done | failed | the same models |")
    print("|" + "---|" * 8)
    first = 0.0
    for name in runs:
        if name == "cached":
            cached(sorted(options.characters.glob("*.glb")), options.output)
            continue
        out = options.output / name
        begun, used = time.monotonic(), _processor_seconds()
        result = RUNS[name](inputs, out)
        start, of_processors = result.get("start", (0.0, 0.0))
        seconds, used = time.monotonic() - begun - start, _processor_seconds() - used - of_processors
        first = first or seconds
        same = sum(_same(path, options.output / runs[0] / path.name) for path in out.glob("*.json"))
        failed = "; ".join(f"{Path(path).name}: {reason[:60]}" for path, reason in result["failed"].items())
        print(
            table_row([
                result.get("name") or NAMES[name], f"{seconds:.0f}", f"{used:.0f}",
                f"{60 * options.files / seconds:.1f}", f"{first / seconds:.2f}", str(result["done"]), failed, str(same),
            ]),
            flush=True,
        )  # fmt: skip


def write_inputs(characters: list[Path], folder: Path, count: int) -> None:
    """Write frames of the characters, about as many of each, and the two files that fail."""
    folder.mkdir()
    for i, path in enumerate(characters):
        frames = len(range(i, count - 2, len(characters)))
        if frames:
            command = [sys.executable, "-c", WRITE_FRAMES, str(path), str(folder / path.stem), str(frames)]
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, timeout=600)
    (folder / BROKEN_FILE).write_bytes(characters[0].read_bytes()[:20_000])
    os.mkfifo(folder / PIPE)
    (folder / HANGING_FILE).write_text(f"mtllib {PIPE}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")


def one(inputs: Path, out: Path) -> dict[str, Any]:
    """A batch with one process."""
    return _finished(_batch(inputs, out, "--processes", "1"))


def two(inputs: Path, out: Path) -> dict[str, Any]:
    """A batch with two processes."""
    return _finished(_batch(inputs, out, "--processes", "2"))


def dask(inputs: Path, out: Path) -> dict[str, Any]:
    """A batch with two Dask workers."""
    begun = time.monotonic()
    with cluster() as (address, _):
        times = [process.cpu_times() for process in psutil.Process().children(recursive=True)]
        start = time.monotonic() - begun, sum(each.user + each.system for each in times)
        return {**_finished(_batch(inputs, out, "--scheduler", address)), "start": start}


def killed_worker(inputs: Path, out: Path) -> dict[str, Any]:
    """A batch with two Dask workers, one of which is killed when a third of the files are done."""
    with cluster() as (address, workers):
        process = _batch(inputs, out, "--scheduler", address)
        _wait_for(out, len(list(inputs.iterdir())) // 3, process)
        workers[0].kill()
        return _finished(process)


def resumed(inputs: Path, out: Path) -> dict[str, Any]:
    """A batch with two processes that is killed when half of the files are done, and then resumed."""
    process = _batch(inputs, out, "--processes", "2")
    _wait_for(out, len(list(inputs.iterdir())) // 2, process)
    process.kill()
    process.wait()
    before = _lines(out)
    result = _finished(_batch(inputs, out, "--processes", "2", "--resume"))
    result["name"] = f"killed after {before} files, resumed: {result['now']} done then"
    return result


RUNS: dict[str, Callable[[Path, Path], dict[str, Any]]] = {
    "one": one, "two": two, "dask": dask, "killed_worker": killed_worker, "resumed": resumed,
}  # fmt: skip
NAMES = {"one": "1 process", "two": "2 processes", "dask": "2 Dask workers", "killed_worker": "… one of them killed"}


def cached(characters: list[Path], output: Path) -> None:
    """Print the seconds for another number of segments, with signatures and parts of the first fit in a cache."""
    import bpy

    import wks_segment.blender
    from wks_segment.blender.cli.terminal import only_result_on_stdout
    from wks_segment.blender.scene.characters import group, mesh_objects
    from wks_segment.blender.scene.file_formats import open_files
    from wks_segment.blender.scene.poses import own_frames, read_frames
    from wks_segment.blender.workflow import pipeline
    from wks_segment.blender.workflow.describing import Run
    from wks_segment.blender.workflow.report import Report
    from wks_segment.core import DiskCache, PoseSegmentation

    wks_segment.blender.register()
    header = [f"{CACHED_FRAMES} poses", f"{FIRST_SEGMENTS} segments, s", f"{OTHER_SEGMENTS} with cache, s", "share"]
    print(f"\n{table_row(header)}\n{table_row(['---'] * 4)}")
    shares = []
    cache = DiskCache(output / "cache")
    for path in characters:
        with only_result_on_stdout():
            (objects,) = open_files([path])
            if not mesh_objects(objects):
                continue
            character = group(mesh_objects(objects), together=True)[0]
            frames = own_frames(bpy.context.scene, character, CACHED_FRAMES)
            poses = read_frames(bpy.context, character, frames)
        seconds = []
        for number in (FIRST_SEGMENTS, OTHER_SEGMENTS):
            begun = time.monotonic()
            model = PoseSegmentation(n_segments=number)
            pipeline.learn(model, poses, Run(Report([]), cache=cache))
            seconds.append(time.monotonic() - begun)
        shares.append(seconds[1] / seconds[0])
        print(table_row([path.stem, *(f"{each:.2f}" for each in seconds), f"{shares[-1]:.3f}"]), flush=True)
    print(table_row(["**mean**", "", "", f"**{sum(shares) / len(shares):.3f}**"]))
    wks_segment.blender.unregister()


def _batch(inputs: Path, out: Path, *arguments: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "wks_segment", "batch", "learn", str(inputs), "--output", str(out), "--json"]
    command += ["--time-limit", str(TIME_LIMIT), *SETTINGS, *arguments]
    return subprocess.Popen(command, text=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)


def _finished(process: subprocess.Popen[str]) -> dict[str, Any]:
    printed, _ = process.communicate()
    result: dict[str, Any] = json.loads(printed)
    return result


def _processor_seconds() -> float:
    """Seconds of processors of all processes that this one started and that have ended, with what they started."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _lines(out: Path) -> int:
    path = out / "batch.jsonl"
    return len(path.read_text(encoding="utf-8").splitlines()) if path.exists() else 0


def _wait_for(out: Path, count: int, process: subprocess.Popen[str]) -> None:
    """Wait until the log has a number of lines."""
    while _lines(out) < count and process.poll() is None:
        time.sleep(0.1)


@contextmanager
def cluster() -> Iterator[tuple[str, list[subprocess.Popen[str]]]]:
    """A scheduler on this machine and two workers, which are ended afterward; its address, and the workers."""
    processes: list[subprocess.Popen[str]] = []

    def start(*arguments: str, until: str) -> str:
        command = [sys.executable, "-m", *arguments, "--no-dashboard", "--host", "127.0.0.1"]
        process = subprocess.Popen(
            command, text=True, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, env=os.environ | QUIET
        )
        processes.append(process)
        stream: IO[str] | None = process.stderr
        assert stream is not None
        for line in stream:
            if match := re.search(until, line):
                return match[0]
        raise RuntimeError(f"{command}: ended with {process.wait()}")

    try:
        scheduler = start("distributed.cli.dask_scheduler", "--port", "0", until=r"tcp://127\.0\.0\.1:\d+")
        for _ in range(2):
            worker = ("distributed.cli.dask_worker", scheduler, "--no-nanny", "--nthreads", "1")
            start(*worker, until="Registered to")
        yield scheduler, processes[1:]
    finally:
        for process in processes:
            process.kill()
            process.communicate()


def _same(one: Path, other: Path) -> bool:
    return other.is_file() and one.read_bytes() == other.read_bytes()


if __name__ == "__main__":
    main()
    sys.stdout.flush()
    os._exit(0)  # some versions of bpy crash at a normal exit
