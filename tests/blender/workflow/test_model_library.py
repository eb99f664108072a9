"""The models of a scene: kept, used, renamed, copied, removed, undone; and files of the time when there was one."""

from unittest.mock import MagicMock

import bpy
import numpy as np
import pytest
from builders import error_of, labels_of, limbed_poses, select

from wks_segment.blender.props.preferences import EXTENSION, WKSSegmentPreferences, model_folder, preference
from wks_segment.blender.ui import models_panel
from wks_segment.blender.workflow import model_library
from wks_segment.blender.workflow.live_session import session_of
from wks_segment.core import PoseSegmentation

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment


def names(settings):
    return [row.name for row in settings.models]


@pytest.fixture
def poses(settings):
    found = limbed_poses(0.0, 0.3, 0.6)
    select(*found)
    return found


@pytest.fixture
def two(poses, settings):
    """Two models, of four and of three segments, the second in use; the first one's names are its own."""
    settings.keep_models = True
    OPS.learn(n_segments=4)
    settings.segments[0].name = "Head"
    OPS.learn(n_segments=3)
    settings.segments[0].name = "Cap"
    assert len(settings.models) == 2
    return settings


def test_learning_again_adds_a_model_if_both_are_kept(poses, settings):
    settings.keep_models = True
    OPS.learn()
    first = settings.model
    assert names(settings) == ["Pose 0, Pose 1, Pose 2"]
    assert settings.models[0].n_segments == 4
    assert len(settings.models[0].date) == 10
    OPS.learn(n_segments=3)
    assert len(settings.models) == 2
    assert (settings.active_model, settings.used_model) == (1, 1)
    assert names(settings)[1] == "Pose 0, Pose 1, Pose 2 2"
    OPS.use_model(name=names(settings)[0])
    assert settings.model == first


def test_learning_again_replaces_the_characters_own_model(poses, settings):
    OPS.learn()
    settings.models[0].name = "Hero"
    OPS.learn(n_segments=5)
    assert [(row.name, row.n_segments) for row in settings.models] == [("Hero", 5)]
    assert PoseSegmentation.from_json(settings.model).n_segments_ == 5
    hero = settings.model
    select(*limbed_poses(0.1, 0.2))
    OPS.learn()
    assert [row.n_segments for row in settings.models] == [5, 5], "another character's model stays"
    assert settings.models[0].model == hero


def test_active_row_is_used_with_its_names(two):
    assert two.notes().names == {0: "Cap"}
    second = two.model
    two.active_model = 0
    assert PoseSegmentation.from_json(two.model).n_segments_ == 4
    assert two.notes().names == {0: "Head"}
    two.active_model = 1
    assert two.model == second
    assert two.notes().names == {0: "Cap"}


def test_names_and_colors_are_applied_with_the_model(two, poses):
    two.active_model = 0
    select(poses[1])
    OPS.apply()
    assert {item.name for item in two.segments} > {"Head"}
    assert len(np.unique(labels_of(poses[1]))) == 4


def test_labels_stay_until_the_model_is_applied(two, poses):
    before = labels_of(poses[0])
    two.active_model = 0
    np.testing.assert_array_equal(labels_of(poses[0]), before)
    assert two.n_segments == 4, "the number that the model will be applied with"
    assert session_of(bpy.context).is_current(bpy.context.scene), "labels must not follow another model"


def test_another_number_of_segments_keeps_the_row(two):
    two.n_segments = 2
    assert OPS.update() == {"FINISHED"}
    assert len(two.models) == 2
    assert two.models[1].n_segments == 2


def test_model_names_are_unique(two):
    two.models[0].name = "Hero"
    two.models[1].name = "Hero"
    assert names(two) == ["Hero", "Hero 2"]
    two.models[1].name = ""
    assert names(two) == ["Hero", "Model"]
    two.models[1].name = "Hero 2"
    assert names(two) == ["Hero", "Hero 2"]


def test_duplicated_model_is_independent(two):
    text = two.model
    assert OPS.duplicate_model() == {"FINISHED"}
    assert (len(two.models), two.used_model) == (3, 2)
    assert two.model == text
    assert two.notes().names == {0: "Cap"}
    two.segments[0].name = "Hat"  # the objects are labeled by the other one
    assert two.notes().names == {0: "Cap"}
    two.active_model = 1
    assert two.notes().names == {0: "Hat"}


def test_removing_a_model_uses_the_next(two):
    first = two.models[0].model
    assert OPS.remove_model() == {"FINISHED"}
    assert (len(two.models), two.used_model, two.model) == (1, 0, first)
    assert two.notes().names == {0: "Head"}
    assert OPS.remove_model() == {"FINISHED"}
    assert (len(two.models), two.used_model, two.model) == (0, -1, "")
    assert not OPS.remove_model.poll()
    assert not OPS.duplicate_model.poll()
    assert not OPS.use_model.poll()


def test_learning_after_the_last_model_was_removed(two, poses):
    OPS.remove_model()
    OPS.remove_model()
    select(*poses)
    OPS.learn()
    assert (len(two.models), two.used_model) == (1, 0)


def test_unknown_model_name_is_refused(two):
    message = error_of(OPS.use_model, name="Nobody")
    assert 'no model named "Nobody"' in message
    assert names(two)[0] in message


def test_import_adds_a_model_and_export_writes_the_active_one(two, tmp_path):
    path = tmp_path / "hero.json"
    two.active_model = 0
    OPS.save_model(filepath=str(path))
    assert PoseSegmentation.load(path).n_segments_ == 4
    OPS.load_model(filepath=str(path))
    assert names(two)[2] == "hero"
    assert (two.used_model, len(two.models)) == (2, 3)
    assert two.notes().names == {0: "Head"}


def test_changes_of_the_model_list_can_be_undone(two):
    bpy.ops.ed.undo_push(message="two")
    first, second, called = two.models[0].model, two.model, names(two)
    for change, options in ((OPS.remove_model, {}), (OPS.duplicate_model, {}), (OPS.use_model, {"name": called[0]})):
        assert change(**options) == {"FINISHED"}
        bpy.ops.ed.undo_push(message="changed")
        bpy.ops.ed.undo()
        settings = bpy.context.scene.wks_segment
        assert (len(settings.models), settings.used_model, settings.active_model) == (2, 1, 1)
        assert (settings.models[0].model, settings.model) == (first, second)
        assert settings.notes().names == {0: "Cap"}


def test_undo_of_learning_removes_the_row(poses, settings):
    bpy.ops.ed.undo_push(message="before")
    OPS.learn()
    bpy.ops.ed.undo_push(message="learned")
    bpy.ops.ed.undo()
    settings = bpy.context.scene.wks_segment
    assert (len(settings.models), settings.model) == (0, "")
    bpy.ops.ed.redo()
    settings = bpy.context.scene.wks_segment
    assert len(settings.models) == 1
    assert settings.model


def test_all_models_are_saved_with_the_file(two, tmp_path):
    first, second, called = two.models[0].model, two.model, names(two)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    assert not bpy.context.scene.wks_segment.models
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    settings = bpy.context.scene.wks_segment
    assert names(settings) == called
    assert settings.model == second
    settings.active_model = 0
    assert settings.model == first
    assert settings.notes().names == {0: "Head"}


def test_model_without_a_row_is_listed(poses, settings):
    """As a script leaves it that writes the settings only."""
    OPS.learn()
    model = settings.model
    settings.models.clear()
    settings.used_model = -1
    OPS.learn(n_segments=3)
    assert len(settings.models) == 2
    assert settings.models[0].model == model


def test_damaged_row_is_ignored(two):
    two.used_model = 7
    two.active_model = 1
    assert model_library.active_row(two) is not None
    assert two.model


def test_details_fit_into_the_sidebar(two):
    lines = models_panel.details(two)
    assert lines[0].startswith("From Pose 0")
    assert any(two.models[1].date in line for line in lines)
    two.models.clear()
    two.used_model, two.model = -1, ""
    assert models_panel.details(two)[0] == "No model yet:"


# Model folder and preferences


def test_models_of_the_model_folder(two, tmp_path):
    OPS.save_model(filepath=str(tmp_path / "b.json"))
    OPS.save_model(filepath=str(tmp_path / "a.json"))
    (tmp_path / "notes.txt").write_text("no model")
    assert list(model_library.in_folder(str(tmp_path))) == ["a", "b"]
    assert model_library.in_folder("") == model_library.in_folder(str(tmp_path / "missing")) == {}


def test_preferences_belong_to_the_extension():
    assert WKSSegmentPreferences.bl_idname == EXTENSION == "wks_segment"


@pytest.fixture
def kept():
    """Preferences, as an installed extension has them."""
    addon = bpy.context.preferences.addons.new()
    addon.module = EXTENSION
    yield addon.preferences
    bpy.context.preferences.addons.remove(addon)


def test_preferences_are_used_when_installed(kept, tmp_path):
    kept.model_folder, kept.cache_megabytes, kept.live_seconds = str(tmp_path), 7, 0.5
    assert preference(bpy.context, "live_seconds") == 0.5
    assert model_folder(bpy.context) == str(tmp_path)
    session = session_of(bpy.context)
    assert session.cache.limit == 7_000_000
    bpy.context.preferences.addons[EXTENSION].preferences.cache_megabytes = 9
    assert session.cache.limit == 9_000_000


def test_model_folder_is_in_the_menu(kept, tmp_path):
    (tmp_path / "horse.json").write_text("{}")
    kept.model_folder = str(tmp_path)
    menu = MagicMock()
    models_panel.WKS_SEGMENT_MT_model_folder.draw(menu, bpy.context)
    assert menu.layout.operator_context == "EXEC_DEFAULT"
    assert menu.layout.operator.call_args.kwargs["text"] == "horse"
    assert menu.layout.operator.return_value.filepath == str(tmp_path / "horse.json")
    kept.model_folder = ""
    models_panel.WKS_SEGMENT_MT_model_folder.draw(menu, bpy.context)
    assert "preferences" in menu.layout.label.call_args.kwargs["text"]


def test_defaults_without_an_installed_extension():
    assert preference(bpy.context, "model_folder") == ""
    assert preference(bpy.context, "cache_megabytes") == 1000
    assert preference(bpy.context, "live_seconds") == 5.0
