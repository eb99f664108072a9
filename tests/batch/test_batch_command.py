"""`wks_segment batch`: the command line with real children."""

import json

import pytest
from command_line import QUICK, lines, run, start, wait_for_lines, write

from wks_segment.core import PoseSegmentation

pytestmark = pytest.mark.usefixtures("needs_bpy")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Three characters, and a file that is broken."""
    folder = tmp_path_factory.mktemp("in")
    for i in range(3):
        write(folder / f"{i}.obj", 0.2 * i)
    (folder / "broken.glb").write_bytes(b"glTF and no more")
    return folder


@pytest.fixture(scope="module")
def learned(folder, tmp_path_factory):
    """A batch that learned a model of each file."""
    out = tmp_path_factory.mktemp("learned") / "models"
    return out, run("batch", "learn", folder, "--output", out, *QUICK, "--no-thumbnails", "--json")


def test_learn_makes_a_model_of_each_file(learned, folder, tmp_path):
    out, (code, output, messages) = learned
    result = json.loads(output)
    assert code == 1, messages
    assert (result["files"], result["done"]) == (4, 3)
    assert list(result["failed"]) == [str(folder / "broken.glb")]
    assert "Blender cannot read it" in result["failed"][str(folder / "broken.glb")]
    assert sorted(path.name for path in out.iterdir()) == ["0.json", "1.json", "2.json", "batch.jsonl", "report.html"]
    assert "left" in messages
    alone = tmp_path / "alone.json"
    assert run("learn", folder / "1.obj", "--model", alone, *QUICK)[0] == 0
    assert alone.read_bytes() == (out / "1.json").read_bytes(), "the same model as without a batch"


def test_apply_writes_scenes_and_pictures(learned, folder, tmp_path, needs_rendering):
    model = learned[0] / "0.json"
    code, output, messages = run(
        "batch", "apply", folder / "*.obj", "--output", tmp_path / "out", "--model", model, "--format", "obj",
        "--cache", tmp_path / "cache", "--processes", 1,
    )  # fmt: skip
    assert code == 0, messages
    assert "3 of 3 files done" in output
    found = {path.relative_to(tmp_path / "out").as_posix() for path in (tmp_path / "out").rglob("*.*")}
    assert {"0.obj", "1.obj", "2.obj", "thumbnails/0.png", "thumbnails/2.png", "report.html"} <= found
    assert len(list((tmp_path / "cache").glob("*.npz"))) == 3
    page = (tmp_path / "out" / "report.html").read_text()
    assert 'src="thumbnails/1.png"' in page


def test_the_best_of_several_models_is_found_and_applied(learned, folder, tmp_path):
    common = ("--models", learned[0], "--cache", tmp_path / "cache", "--no-thumbnails")
    code, _, messages = run("batch", "rank", folder / "[02].obj", "--output", tmp_path / "ranked", *common)
    assert code == 0, messages
    best = {}
    for line in lines(tmp_path / "ranked"):
        (ranking,) = line["result"]["rankings"]
        assert {model["name"] for model in ranking["models"]} == {"0", "1", "2"}
        best[line["name"]] = ranking["models"][0]["name"]
    code, _, messages = run(
        "batch", "apply", folder / "2.obj", "--output", tmp_path / "out", "--format", "glb", *common
    )
    assert code == 0, messages
    assert [line["result"]["best"] for line in lines(tmp_path / "out")] == [best["2"]]
    assert (tmp_path / "out" / "2.glb").is_file()
    code, _, messages = run("batch", "rank", folder, "--output", tmp_path / "no", "--models", tmp_path / "nowhere")
    assert (code, "nowhere: there is no such folder" in messages) == (1, True)


def test_a_killed_batch_is_resumed(folder, tmp_path):
    out = tmp_path / "out"
    command = ("batch", "learn", folder / "*.obj", "--output", out, *QUICK, "--no-thumbnails", "--processes", 1)
    process = start(*command)
    wait_for_lines(out, 1, process)
    process.kill()
    process.communicate(timeout=60)
    before = lines(out)
    assert 1 <= len(before) < 3
    code, output, messages = run(*command, "--resume", "--json")
    assert code == 0, messages
    assert json.loads(output)["now"] == 3 - len(before)
    assert lines(out)[: len(before)] == before
    assert {line["name"] for line in lines(out)} == {"0", "1", "2"}
    assert all(isinstance(PoseSegmentation.load(out / f"{i}.json"), PoseSegmentation) for i in range(3))


def test_wrong_usage(folder, tmp_path):
    code, _, messages = run("batch", "learn", folder, "--output", tmp_path / "out", "--part", "3/2")
    assert code == 2
    assert "must be I/N" in messages
    assert not (tmp_path / "out").exists()
