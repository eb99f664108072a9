"""Consistency of labels on real characters: `python -m benchmarks.characters FOLDER [--output FOLDER]`.

Runs `wks_segment demo` on each file of the folder: 5 poses are learned, 3 others are only labeled. Prints a Markdown
table and writes a contact sheet. A rigged file without an animation gets poses with randomly rotated bones.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

LEARNED, UNSEEN = 5, 3
FILES = (".glb", ".gltf", ".fbx", ".blend")
SHEET_WIDTH = 1600

ADD_RANDOM_POSES = """
import os, random, sys
import bpy
source, target, count = sys.argv[1], sys.argv[2], int(sys.argv[3])
bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
bpy.ops.import_scene.gltf(filepath=source)
rigs = [obj for obj in bpy.data.objects if obj.type == "ARMATURE"]
if rigs and not bpy.data.actions:
    turn = random.Random(0)
    for frame in range(1, count + 1):
        for rig in rigs:
            for bone in rig.pose.bones:
                bone.rotation_mode = "XYZ"
                bone.rotation_euler = [turn.uniform(-0.35, 0.35) if bone.parent else 0.0 for _ in range(3)]
                bone.keyframe_insert("rotation_euler", frame=frame)
    bpy.ops.wm.save_as_mainfile(filepath=target)
sys.stdout.flush()
os._exit(0)
"""


def main() -> int:
    """Measure all files of a folder; return 1 if one of them failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--output", type=Path, default=Path("demo/characters"))
    parser.add_argument("--segments", default="8")
    parser.add_argument("--covariance", default="auto")
    parser.add_argument("--pieces", default="joined")
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    paths = sorted(path for path in options.folder.iterdir() if path.suffix in FILES)
    if not paths:
        parser.error(f"{options.folder}: there is no file of type {', '.join(FILES)} in it")
    print(
        f"| character | vertices | CPU s a pose | agreement learned | agreement unseen | worst unseen |\n|{'---|' * 6}"
    )
    settings = ["--segments", options.segments, "--covariance", options.covariance]
    settings += ["--pieces", options.pieces]
    results = [measure(path, options.output, settings) for path in paths]
    done = [result for result in results if "error" not in result]
    mean = [np.mean([result[key] for result in done]) for key in ("learned", "unseen", "worst")]
    print(f"| **mean of {len(done)} of {len(paths)}** | | | {mean[0]:.3f} | **{mean[1]:.3f}** | {mean[2]:.3f} |")
    contact_sheet([options.output / f"{path.stem}.png" for path in paths], options.output / "sheet.png")
    return int(len(done) < len(paths))


def measure(path: Path, output: Path, settings: list[str]) -> dict[str, Any]:
    """Run the demo on one file, and print its row of the table."""
    source = posed(path, output)
    command = [sys.executable, "-m", "wks_segment", "demo", "--json", "--input", str(source), "--folder", str(output)]
    command += [*settings, "--learn", str(LEARNED), "--unseen", str(UNSEEN)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=1800, env=one_thread())
    result: dict[str, Any] = json.loads(done.stdout) if done.stdout else {"error": done.stderr[-300:]}
    if "error" in result:
        print(f"| {path.stem} | failed: {result['error']} |", flush=True)
        return result
    learned, unseen = (
        [pose["agreement"] for pose in result["poses"] if pose["learned"] is known] for known in (True, False)
    )
    row = {"learned": np.mean(learned), "unseen": np.mean(unseen), "worst": min(unseen)}
    note = "" if source == path else " (bones rotated at random)"
    seconds = result["seconds"]["signature"] / len(result["poses"])
    print(
        f"| {path.stem}{note} | {result['poses'][0]['vertices']:,} | {seconds:.1f} "
        f"| {row['learned']:.3f} | {row['unseen']:.3f} | {row['worst']:.3f} |",
        flush=True,
    )
    return row


def posed(path: Path, output: Path) -> Path:
    """The file itself, or a copy with random poses if it has a rig but no animation."""
    if path.suffix not in (".glb", ".gltf"):
        return path
    target = output / f"{path.stem}.posed" / f"{path.stem}.blend"
    target.parent.mkdir(exist_ok=True)
    command = [sys.executable, "-c", ADD_RANDOM_POSES, str(path), str(target), str(2 * (LEARNED + UNSEEN))]
    subprocess.run(command, check=True, capture_output=True, timeout=300)
    return target if target.exists() else path


def one_thread() -> dict[str, str]:
    """Environment with one BLAS thread, in which wall time is CPU time."""
    return {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


def contact_sheet(pictures: list[Path], target: Path) -> None:
    """Write all pictures to one, in two columns."""
    tiles = [Image.open(path).convert("RGB") for path in pictures if path.exists()]
    tiles = [tile.resize((SHEET_WIDTH // 2, tile.height * SHEET_WIDTH // 2 // tile.width)) for tile in tiles]
    height = max(tile.height for tile in tiles)
    sheet = Image.new("RGB", (SHEET_WIDTH, height * ((len(tiles) + 1) // 2)), "white")
    for i, tile in enumerate(tiles):
        sheet.paste(tile, (i % 2 * SHEET_WIDTH // 2, i // 2 * height))
    sheet.save(target)
    print(f"\ncontact sheet: {target}")


if __name__ == "__main__":
    sys.exit(main())
