"""`wks_segment batch`: the command line with real children."""

import json
import os
import shutil
import sys
import wave
from pathlib import Path

import bpy
import pytest
from command_line import QUICK, lines, run, start, wait_for_lines, write

from wks_segment.core import PoseSegmentation


@pytest.fixture(scope="module")
def characters(tmp_path_factory):
    """Folder of three characters, and a file that is broken."""
    folder = tmp_path_factory.mktemp("in")
    for i in range(3):
        write(folder / f"{i}.obj", 0.2 * i)
    (folder / "broken.glb").write_bytes(b"glTF and no more")
    return folder


@pytest.fixture(scope="module")
def learned(characters, tmp_path_factory):
    """A batch that learned a model of each file, in a process of its own."""
    out = tmp_path_factory.mktemp("learned") / "models"
    return out, run("batch", "learn", characters, "--output", out, *QUICK, "--no-thumbnails", "--json")


def test_learn_makes_a_model_of_each_file(command, learned, characters, tmp_path):
    out, (code, output, messages) = learned
    result = json.loads(output)
    assert code == 1, messages
    assert (result["files"], result["done"]) == (4, 3)
    assert list(result["failed"]) == [str(characters / "broken.glb")]
    assert "Blender cannot read it" in result["failed"][str(characters / "broken.glb")]
    assert sorted(path.name for path in out.iterdir()) == ["0.json", "1.json", "2.json", "batch.jsonl", "report.html"]
    assert "left" in messages
    alone = tmp_path / "alone.json"
    assert command("learn", characters / "1.obj", "--model", alone, *QUICK).code == 0
    assert alone.read_bytes() == (out / "1.json").read_bytes(), "the same model as without a batch"


def test_apply_writes_scenes_and_pictures(command, learned, characters, tmp_path, needs_rendering):
    model = learned[0] / "0.json"
    done = command(
        "batch", "apply", characters / "*.obj", "--output", tmp_path / "out", "--model", model, "--format", "obj",
        "--cache", tmp_path / "cache", "--processes", 1,
    )  # fmt: skip
    assert done.code == 0, done
    assert "3 of 3 files done" in done.out
    found = {path.relative_to(tmp_path / "out").as_posix() for path in (tmp_path / "out").rglob("*.*")}
    assert {"0.obj", "1.obj", "2.obj", "thumbnails/0.png", "thumbnails/2.png", "report.html"} <= found
    assert len(list((tmp_path / "cache").glob("*.npz"))) == 3
    page = (tmp_path / "out" / "report.html").read_text()
    assert 'src="thumbnails/1.png"' in page
    assert list(bpy.data.images.load(str(tmp_path / "out" / "thumbnails" / "1.png")).size) == [320, 320]


def test_the_best_of_several_models_is_found_and_applied(command, learned, characters, tmp_path):
    common = ("--models", learned[0], "--cache", tmp_path / "cache", "--no-thumbnails", "--processes", 1)
    done = command("batch", "rank", characters / "[02].obj", "--output", tmp_path / "ranked", *common)
    assert done.code == 0, done
    best = {}
    for line in lines(tmp_path / "ranked"):
        (ranking,) = line["result"]["rankings"]
        assert {model["name"] for model in ranking["models"]} == {"0", "1", "2"}
        best[line["name"]] = ranking["models"][0]["name"]
    done = command(
        "batch", "apply", characters / "2.obj", "--output", tmp_path / "out", "--format", "glb", *common
    )  # fmt: skip
    assert done.code == 0, done
    assert [line["result"]["best"] for line in lines(tmp_path / "out")] == [best["2"]]
    assert (tmp_path / "out" / "2.glb").is_file()


def test_a_killed_batch_is_resumed(command, characters, tmp_path):
    out = tmp_path / "out"
    batch = ("batch", "learn", characters / "*.obj", "--output", out, *QUICK, "--no-thumbnails", "--processes", 1)
    process = start(*batch)
    wait_for_lines(out, 1, process)
    process.kill()
    process.communicate(timeout=60)
    before = lines(out)
    assert 1 <= len(before) < 3
    done = command(*batch, "--resume", "--json")
    assert done.code == 0, done
    assert done.result["now"] == 3 - len(before)
    assert lines(out)[: len(before)] == before
    assert {line["name"] for line in lines(out)} == {"0", "1", "2"}
    assert all(isinstance(PoseSegmentation.load(out / f"{i}.json"), PoseSegmentation) for i in range(3))


def test_a_folder_of_models_that_does_not_exist(command, characters, tmp_path):
    done = command("batch", "rank", characters, "--output", tmp_path / "no", "--models", tmp_path / "nowhere")
    assert done.code == 1
    assert "nowhere: there is no such folder" in done.err


def test_relative_paths_in_a_scene_lead_to_the_same_files(command, learned, characters, tmp_path):
    """From the place of the result, also where that is in a folder of its own, and whatever Blender saves there."""
    inputs, out = tmp_path / "in", tmp_path / "out"
    (inputs / "inner").mkdir(parents=True)
    for folder in (inputs, inputs / "inner"):
        save_with_relative_paths(characters / "0.obj", folder)
    common = ("--model", learned[0] / "0.json", "--processes", 1, "--no-thumbnails")
    done = command("batch", "apply", inputs / "**" / "hero.blend", "--output", out, *common)
    assert done.code == 0, done
    for folder in (inputs, inputs / "inner"):
        bpy.ops.wm.open_mainfile(filepath=str(out / folder.relative_to(inputs) / "hero.blend"))
        paths = bpy.utils.blend_paths()
        assert len(paths) == 3
        assert all(path.startswith("//") for path in paths)
        found = {os.path.normpath(bpy.path.abspath(path)) for path in paths}
        assert found == {str(folder / name) for name in ("skin.png", "library.blend", "sound.wav")}
        assert "Shared" in bpy.data.materials
    left = {path.name for path in out.rglob("*") if path.is_file()}
    assert left == {"hero.blend", "batch.jsonl", "report.html"}


def save_with_relative_paths(mesh, folder):
    """Save a character with an image, a library and a sound beside it."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.data.materials.new("Shared").use_fake_user = True
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "library.blend"), copy=True)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "hero.blend"))
    bpy.ops.wm.obj_import(filepath=str(mesh))
    with bpy.data.libraries.load("//library.blend", link=True, relative=True) as (_, target):
        target.materials = ["Shared"]
    bpy.context.object.data.materials.append(bpy.data.materials["Shared"])
    skin = bpy.data.images.new("skin", 4, 4)
    skin.filepath_raw, skin.file_format = str(folder / "skin.png"), "PNG"
    skin.save()
    skin.filepath, skin.use_fake_user = "//skin.png", True
    with wave.open(str(folder / "sound.wav"), "wb") as sound:
        sound.setparams((1, 2, 8000, 8, "NONE", ""))
        sound.writeframes(bytes(16))
    bpy.data.sounds.load("//sound.wav").use_fake_user = True
    bpy.ops.wm.save_mainfile()


@pytest.mark.skipif(sys.platform != "linux", reason="other systems have no such names")
def test_a_name_that_is_not_utf_8(command, characters, learned, tmp_path):
    """It is done or fails by itself; list, report and resuming work for all files."""
    inputs, out = tmp_path / "in", tmp_path / "out"
    inputs.mkdir()
    odd = Path(os.fsdecode(os.fsencode(inputs) + b"/odd\xe9.obj"))
    shutil.copyfile(characters / "0.obj", odd)
    shutil.copyfile(characters / "1.obj", inputs / "plain.obj")
    batch = ("batch", "apply", inputs, "--model", learned[0] / "0.json", "--output", out, "--format", "obj",
             "--processes", 1, "--no-thumbnails")  # fmt: skip
    done = command(*batch)
    listed = {line["name"]: line for line in lines(out)}
    assert listed["plain"]["status"] == "done"
    assert listed["odd\udce9"]["input"] == str(odd)
    assert (out / "report.html").read_text().count("odd") >= 1
    assert done.code == (0 if listed["odd\udce9"]["status"] == "done" else 1), done
    done = command(*batch, "--resume", "--json")
    assert done.result["now"] == 0
    with (out / "batch.jsonl").open() as log:
        assert len(log.readlines()) == 2
    shutil.copyfile(learned[0] / "0.json", odd.with_suffix(".json"))
    done = command("apply", inputs / "plain.obj", "--model", odd.with_suffix(".json"), "--output", tmp_path / "a.blend")
    assert done.code == 0, done


def test_wrong_usage(command, characters, tmp_path):
    done = command("batch", "learn", characters, "--output", tmp_path / "out", "--part", "3/2")
    assert done.code == 2
    assert "must be I/N" in done.err
    assert not (tmp_path / "out").exists()
