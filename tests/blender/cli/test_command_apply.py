"""`wks_segment learn` and `apply`: models, and limits of a job."""

import json
from dataclasses import replace
from itertools import count
from types import SimpleNamespace

import bpy
import pytest
from builders import labels_of, limbed
from command_files import QUICK, assert_fails, empty_scene, mesh_of_scene, save

from wks_segment import core
from wks_segment.blender.cli import resource_limits
from wks_segment.blender.cli.main import answer
from wks_segment.core import PartNotes, PoseSegmentation


@pytest.fixture
def model(command, folder, tmp_path):
    """A model that was learned from three files."""
    path = tmp_path / "model.json"
    done = command("learn", *(folder / f"pose_{i}.obj" for i in range(3)), *QUICK, "--model", path, "--json")
    assert done.code == 0, done
    assert done.result["files"] == {"model": str(path)}
    return path


def test_learned_model_can_be_loaded_by_the_core(model):
    loaded = PoseSegmentation.load(model)
    assert (loaded.n_segments, loaded.n_eigenpairs, loaded.n_energies) == (4, 30, 40)


def test_segment_and_learn_give_the_same_model(command, folder, model, tmp_path):
    other = tmp_path / "other.json"
    command("segment", *(folder / f"pose_{i}.obj" for i in range(3)), *QUICK, "--model", other)
    assert json.loads(other.read_text()) == json.loads(model.read_text())


def test_apply_gives_an_unseen_pose_the_labels_of_the_learned_ones(command, folder, model, tmp_path):
    empty_scene()
    limbed("Unseen", 0.6)
    unseen = save(tmp_path / "unseen.ply")
    labels = {}
    for name, path in (("known", folder / "pose_1.obj"), ("unseen", unseen)):
        output = tmp_path / f"{name}.blend"
        done = command("apply", path, "--model", model, "--output", output, "--json")
        assert done.code == 0, done
        assert done.result["segments"] == 4
        bpy.ops.wm.open_mainfile(filepath=str(output))
        labels[name] = labels_of(mesh_of_scene())
    # Importers rotate axes, and number faces as the file does; both files have the same order of faces.
    assert (labels["known"] == labels["unseen"]).mean() > 0.9


def test_apply_counts_merged_parts(command, folder, model, tmp_path):
    """As the list in the panel counts them; the warning on segments that are missing is about others."""
    learned = PoseSegmentation.load(model)
    learned.part_notes_ = PartNotes(joined={2: 1})
    learned.save(model)
    apply = ("apply", folder / "pose_1.obj", "--model", model, "--output", tmp_path / "out.blend")
    done = command(*apply, "--json")
    assert (done.result["segments"], len(done.result["parts"]), done.result["merged"]) == (3, 3, 1)
    assert not [warning for warning in done.result["warnings"] if "are not on these objects" in warning]
    assert "3 segments, 1 merged into another\n" in command(*apply).out


def test_apply_reads_frames(command, folder, model, tmp_path):
    done = command(
        "apply", folder / "walker.glb", "--frames", 2, "--model", model, "--output", tmp_path / "out.glb", "--json"
    )
    assert done.code == 0, done
    assert len(done.result["poses"]) == 2


def test_apply_without_an_output(command, folder, model):
    assert_fails(command("apply", folder / "pose_0.obj", "--model", model), "--output")


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "no such file"),
        (b"{}", "not a model of WKS Segment"),
        (b"\x80\x04\x95\xff", "binary"),
        (b"hello", "not JSON"),
    ],
)
def test_unreadable_or_foreign_model_file(command, folder, tmp_path, content, words):
    path, output = tmp_path / "foreign.json", tmp_path / "out.blend"
    if content is not None:
        path.write_bytes(content)
    assert_fails(command("apply", folder / "pose_0.obj", "--model", path, "--output", output), "foreign.json", words)
    assert not output.exists()


@pytest.mark.parametrize("name", ["segment", "apply", "demo"])
def test_a_job_above_the_limits_is_refused_until_they_are_raised(command, folder, tmp_path, name):
    model = tmp_path / "model.json"
    assert command("learn", folder / "pose_0.blend", *QUICK, "--model", model).code == 0
    arguments = {
        "segment": ("segment", folder / "pose_0.blend", *QUICK, "--output", tmp_path / "out.blend"),
        "apply": ("apply", folder / "pose_0.blend", "--model", model, "--output", tmp_path / "out.blend"),
        "demo": ("demo", "--input", folder / "walker.blend", "--folder", tmp_path, *QUICK),
    }[name]
    refused = command(*arguments, "--limit-memory", "0.001")
    assert (refused.code, "0.0 GB: raise the limit" in refused.err) == (1, True)
    assert command(*arguments, "--limit-memory", "64", "--limit-minutes", "60").code == 0


def test_limits_that_are_given_hold_for_the_whole_command(command, folder, tmp_path, monkeypatch):
    """Whatever was estimated: the clock and the memory say something else then."""
    arguments = ("learn", folder / "pose_0.obj", "--model", tmp_path / "model.json", *QUICK)
    clock = count(0, 7)
    monkeypatch.setattr(resource_limits, "time", SimpleNamespace(monotonic=lambda: next(clock)))
    done = command(*arguments, "--limit-minutes", "0.2", "--json")
    assert (done.code, "more than 0.2 minutes" in done.result["error"]) == (1, True)
    monkeypatch.undo()
    memory = count(10**9, 10**8)
    monkeypatch.setattr(resource_limits, "resident_memory", lambda pid: next(memory))
    done = command(*arguments, "--limit-memory", "0.3", "--json")
    assert (done.code, "more than 0.3 GB of memory" in done.result["error"]) == (1, True)
    assert "more than 0.3 GB" in answer([str(argument) for argument in (*arguments, "--limit-memory", "0.3")]).error
    assert not (tmp_path / "model.json").exists()
    assert command(*arguments).code == 0, "no limit was given"


def test_a_model_that_asks_for_thousands_of_eigenpairs(command, folder, tmp_path, model):
    content = json.loads(model.read_text())
    content.pop("digest")
    content["parameters"]["n_eigenpairs"] = 5000
    (tmp_path / "large.json").write_text(json.dumps(content))
    done = command("apply", folder / "pose_0.obj", "--model", tmp_path / "large.json", "--output", tmp_path / "a.blend")
    assert_fails(done, "take about", "minutes", "allowed are 5.0 minutes")


def test_apply_says_that_a_model_does_not_fit(command, folder, model, tmp_path, monkeypatch):
    known = core.rank
    monkeypatch.setattr(core, "rank", lambda *given: replace(known(*given), verdict="nothing fits"))
    options = ("--model", model, "--output", tmp_path / "out.blend", "--smallest-part", 20, "--json")
    done = command("apply", folder / "pose_0.obj", *options)
    assert done.code == 0, done
    warnings = "\n".join(done.result["warnings"])
    assert '"model" does not fit' in warnings
    assert "of the model's 4 segments are not on these objects" in warnings
