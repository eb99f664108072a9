"""Models in files: export, import, and what is refused."""

import bpy
import numpy as np
import pytest
from builders import (
    changes,
    error_of,
    labels_of,
    limbed,
    read_labels,
    refuses,
    scene_snapshot,
    select,
)

from wks_segment.blender.scene import poses as reader
from wks_segment.blender.scene.poses import Character
from wks_segment.core import PoseSegmentation

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment


def test_model_is_exported_and_imported(learned, settings, tmp_path):
    path, labels = tmp_path / "model.json", labels_of(learned[0])
    model, summary = settings.model, settings.model_summary
    assert OPS.save_model(filepath=str(path)) == {"FINISHED"}
    settings.model = settings.model_summary = ""
    OPS.clear()
    assert OPS.load_model(filepath=str(path)) == {"FINISHED"}
    assert settings.model == model
    assert settings.model_summary == summary, "what it was learned from"
    select(learned[0])
    OPS.apply()
    assert (labels_of(learned[0]) == labels).mean() > 0.95


def test_exported_model_can_be_loaded_by_core(learned, tmp_path):
    path = tmp_path / "model.json"
    OPS.save_model(filepath=str(path))
    assert PoseSegmentation.load(path).n_segments == 4


@pytest.mark.filterwarnings("ignore:.*blend relative")  # for scripts, from Blender 5.0 on
def test_model_path_may_be_relative_to_the_blend_file(learned, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    assert OPS.save_model(filepath="//model.json") == {"FINISHED"}
    assert (tmp_path / "model.json").is_file()
    assert OPS.load_model(filepath="//model.json") == {"FINISHED"}


@pytest.mark.parametrize(
    ("content", "match"),
    [
        (b"{}", "not a model of WKS Segment"),
        (b"[1, 2", "not JSON"),
        (b"\x80\x04\x95\xff", "binary file"),
        (b'{"format": "wks_segment model", "version": 99}', "version 99"),
        (b'{"format": "wks_segment model", "version": 4, "parameters": {}}', "damaged"),
        (b"", "not JSON"),
    ],
)
def test_foreign_model_file_is_refused(learned, tmp_path, content, match):
    path = tmp_path / "foreign.json"
    path.write_bytes(content)
    refuses(OPS.load_model, f"foreign.json.*{match}", filepath=str(path))


def test_model_with_a_damaged_number_is_refused(learned, settings, tmp_path):
    path = tmp_path / "damaged.json"
    path.write_text(settings.model.replace('"weights": [0.', '"weights": [-0.'))
    refuses(OPS.load_model, "damaged.json.*not positive", filepath=str(path))


def test_model_file_that_does_not_exist(learned, tmp_path):
    refuses(OPS.load_model, "missing.json was not loaded", filepath=str(tmp_path / "missing.json"))


def test_model_with_more_segments_than_colors(settings, tmp_path):
    """The core sets no limit. Whether such a model is refused or colored, nothing may stay behind."""
    obj, path = limbed(), tmp_path / "many.json"
    (pose,) = reader.read_objects(bpy.context, [Character((obj,))])
    PoseSegmentation(n_segments=90, n_eigenpairs=30, n_energies=40).fit([pose.mesh]).save(path)
    select(obj)
    before = scene_snapshot()
    refused = error_of(OPS.load_model, filepath=str(path)) or error_of(OPS.apply)
    if refused:
        assert "Traceback" not in refused
        assert "segments" in refused
    else:
        assert labels_of(obj).max() < 90
        OPS.clear()
    changed = changes(before, scene_snapshot())
    assert changed in ([], ["/model"])


def test_folder_instead_of_a_model_file(learned, tmp_path):
    refuses(OPS.load_model, "was not loaded", filepath=str(tmp_path))


def test_model_that_cannot_be_written(learned, tmp_path):
    refuses(OPS.save_model, "model was not saved", filepath=str(tmp_path / "missing" / "model.json"))


def test_model_is_saved_in_the_blend_file(learned, settings, tmp_path):
    model, summary, labels = settings.model, settings.model_summary, labels_of(learned[0])
    path = tmp_path / "scene.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    assert not bpy.context.scene.wks_segment.model
    bpy.ops.wm.open_mainfile(filepath=str(path))
    settings = bpy.context.scene.wks_segment
    assert (settings.model, settings.model_summary) == (model, summary)
    first = bpy.data.objects["Pose 0"]
    np.testing.assert_array_equal(labels_of(first), labels)
    select(first)
    assert OPS.apply() == {"FINISHED"}
    OPS.clear()
    assert read_labels(first.data) is None
