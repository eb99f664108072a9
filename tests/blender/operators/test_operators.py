"""The buttons: what they do, what they say, and that an error leaves everything as it was."""

from unittest.mock import MagicMock

import bpy
import numpy as np
import pytest
from builders import (
    LIMBS,
    changes,
    error_of,
    labels_of,
    limbed,
    limbed_keys,
    limbed_poses,
    limbed_rigged,
    mesh_object,
    read_labels,
    scene_snapshot,
    select,
    snapshot,
)

from wks_segment.blender import registration
from wks_segment.blender.outputs.labels import write_labels
from wks_segment.blender.scene import poses as reader
from wks_segment.blender.scene.characters import selected_meshes
from wks_segment.blender.scene.poses import Character
from wks_segment.blender.ui import main_panel, models_panel
from wks_segment.blender.workflow import segment_list
from wks_segment.core import PoseSegmentation
from wks_segment.core.spectral import eigenpairs, multilevel

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment
BENDS = (0.0, 0.3, 0.6)
UNSEEN = 0.6


@pytest.fixture
def learned(settings):
    """Three objects in three poses, learned from and labeled."""
    poses = limbed_poses(*BENDS)
    select(*poses)
    assert OPS.learn() == {"FINISHED"}
    return poses


def agreement(first, second):
    return (labels_of(first) == labels_of(second)).mean()


# Learn and Segment


def test_learn_from_objects_labels_each_of_them_alike(learned, settings):
    assert len(np.unique(labels_of(learned[0]))) == settings.n_segments
    assert min(agreement(learned[0], pose) for pose in learned) > 0.9
    assert all("wks_segment_color" in pose.data.color_attributes for pose in learned)
    assert not any(len(pose.data.materials) for pose in learned)


def test_limbs_are_other_parts_than_the_body(learned):
    points = np.array([polygon.center for polygon in learned[0].data.polygons])
    labels = labels_of(learned[0])
    tips = [labels[np.argmax(points @ (limb / np.linalg.norm(limb)))] for limb in LIMBS]
    body = labels[np.argmin(np.linalg.norm(points, axis=1))]
    assert body not in tips


def test_learn_from_frames_labels_the_one_mesh_and_keeps_the_frame(settings):
    obj = limbed_rigged()
    settings.source, settings.pose_count = "FRAMES", 3
    select(obj)
    bpy.context.scene.frame_set(4, subframe=0.5)
    assert OPS.learn() == {"FINISHED"}
    assert len(np.unique(labels_of(obj))) > 1
    assert (bpy.context.scene.frame_current, bpy.context.scene.frame_subframe) == (4, 0.5)
    assert "Walker" in settings.model_summary
    assert "3 poses" in settings.model_summary


def test_learn_from_a_range_of_frames(settings, printed):
    select(limbed_rigged())
    settings.source, settings.pose_count, settings.use_frame_range = "FRAMES", 3, True
    settings.frame_first, settings.frame_last = 2, 3
    assert OPS.learn() == {"FINISHED"}
    assert "2 poses" in settings.model_summary


def test_learn_from_shape_keys_labels_the_object_and_keeps_its_keys(settings):
    obj = limbed_keys(0.4, 0.8)
    obj.active_shape_key_index = 2
    settings.source = "SHAPE_KEYS"
    select(obj)
    assert OPS.learn() == {"FINISHED"}
    assert len(np.unique(labels_of(obj))) > 1
    assert obj.active_shape_key_index == 2
    assert "3 poses" in settings.model_summary


def test_objects_on_one_armature_are_labeled_as_one(settings):
    obj = limbed_rigged("Body")
    hat = mesh_object(
        [(0, 0, 1.5), (1, 0, 1.5), (0, 1, 1.5), (0, 0, 2)], [(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)], "Hat"
    )
    hat.parent = obj.parent
    select(obj, hat)
    assert OPS.learn() == {"FINISHED"}
    assert "Rig" in settings.model_summary
    assert "1 pose" in settings.model_summary
    assert len(labels_of(hat)) == 4


def test_two_objects_that_share_a_mesh_are_learned_from(settings):
    first = limbed()
    second = bpy.data.objects.new("Twin", first.data)
    bpy.context.scene.collection.objects.link(second)
    second.location.x = 8
    select(first, second)
    assert OPS.learn() == {"FINISHED"}
    assert len(np.unique(labels_of(first))) > 1
    OPS.clear()
    assert "wks_segment" not in first.data.attributes


def test_the_same_seed_gives_the_same_labels(learned):
    before = [labels_of(pose) for pose in learned]
    OPS.learn()
    np.testing.assert_array_equal(before, [labels_of(pose) for pose in learned])


def test_materials_are_written_only_if_asked_for(learned, settings):
    settings.write_materials, settings.write_colors = True, False
    OPS.learn()
    for pose in learned:
        assert len(pose.data.materials) == len(np.unique(labels_of(pose)))
        assert "wks_segment_color" not in pose.data.attributes


def test_learn_says_what_happened(settings, printed):
    select(*limbed_poses(*BENDS))
    printed()
    OPS.learn()
    said = printed().out
    assert "Learned: 3 poses, 1,926 vertices, 4 segments, " in said
    assert "Warning" not in said


def test_one_pose_is_allowed_with_a_hint(printed):
    select(limbed())
    printed()
    assert OPS.learn() == {"FINISHED"}
    assert "Warning: Learned from one pose only" in printed().out


def test_a_fallback_of_the_solver_reaches_the_user(settings, printed, monkeypatch):
    def refuse(*arguments):
        raise multilevel.NotConvergedError

    monkeypatch.setattr(eigenpairs, "multilevel_eigenpairs", refuse)
    monkeypatch.setattr(eigenpairs, "DENSE_BELOW", 0)
    select(*limbed_poses(*BENDS))
    printed()
    assert OPS.learn() == {"FINISHED"}
    assert printed().out.count("Warning: the fast eigensolver did not converge on this mesh") == 1


def test_poses_that_are_all_the_same_give_a_hint(settings, printed):
    select(limbed())
    settings.source, settings.pose_count = "FRAMES", 3
    printed()
    assert OPS.learn() == {"FINISHED"}
    assert "poses are the same: does an animation move the character" in printed().out


# Apply to Selected


def test_unseen_pose_gets_the_labels_of_the_training(learned):
    unseen = limbed("Unseen", UNSEEN)
    select(unseen)
    assert OPS.apply() == {"FINISHED"}
    assert agreement(unseen, learned[1]) > 0.9


def test_apply_leaves_the_other_objects_and_the_model_alone(learned, settings):
    unseen = limbed("Unseen", UNSEEN)
    select(unseen)
    before = scene_snapshot()
    OPS.apply()
    changed = changes(before, scene_snapshot())
    assert changed
    assert all(path.startswith("/meshes/Unseen/") or path == "/segments" for path in changed)


def test_apply_takes_a_finer_mesh(learned):
    finer = limbed("Finer", UNSEEN, subdivisions=5)
    select(finer)
    assert OPS.apply() == {"FINISHED"}
    own = np.array([polygon.center for polygon in learned[1].data.polygons])
    points = np.array([polygon.center for polygon in finer.data.polygons])
    nearest = np.linalg.norm(points[:, None] - own[None], axis=2).argmin(axis=1)
    assert (labels_of(finer) == labels_of(learned[1])[nearest]).mean() > 0.8


def test_apply_takes_a_turned_scaled_and_mirrored_object(learned):
    twin = limbed("Twin", BENDS[1])
    twin.scale, twin.rotation_euler, twin.location = (-3, 3, 3), (1, 2, 3), (4, 5, 6)
    select(twin)
    OPS.apply()
    assert agreement(twin, learned[1]) > 0.95


# Clear


def test_clear_gives_back_what_was(settings):
    poses = limbed_poses(*BENDS)
    poses[0].data.materials.append(bpy.data.materials.new("Skin"))
    settings.write_materials = True
    select(*poses)
    before = scene_snapshot()
    del before["model"]
    OPS.learn()
    assert OPS.clear() == {"FINISHED"}
    assert [path for path in changes(before, scene_snapshot()) if path != "/model"] == []
    assert [material.name for material in bpy.data.materials] == ["Skin"]


def test_clear_touches_only_what_is_selected(learned):
    select(learned[0])
    OPS.clear()
    assert "wks_segment" not in learned[0].data.attributes
    assert "wks_segment" in learned[1].data.attributes


# Gray buttons


def refusal(operator):
    assert not operator.poll()
    with pytest.raises(RuntimeError) as caught:
        operator()
    return str(caught.value)


@pytest.mark.parametrize("name", ["learn", "apply", "clear"])
def test_buttons_are_gray_in_edit_mode(learned, name):
    bpy.ops.object.mode_set(mode="EDIT")
    assert "Switch to Object Mode first" in refusal(getattr(OPS, name))
    bpy.ops.object.mode_set(mode="OBJECT")
    assert getattr(OPS, name).poll()


@pytest.mark.parametrize("name", ["learn", "apply"])
def test_buttons_are_gray_without_a_selected_mesh(learned, name):
    select()
    assert "Select the mesh of a character first" in refusal(getattr(OPS, name))
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    bpy.context.scene.collection.objects.link(camera)
    select(camera)
    assert "Select the mesh of a character first" in refusal(getattr(OPS, name))


def test_a_selected_armature_stands_for_its_visible_meshes(settings):
    body, coat, hidden = limbed_rigged("Body"), limbed("Coat"), limbed("Hidden")
    for obj in (coat, hidden):
        obj.parent = body.parent
    bpy.context.view_layer.update()
    hidden.hide_set(True)
    other, alone = limbed_rigged("Other"), limbed("Alone")
    select(body.parent, alone)
    assert [obj.name for obj in selected_meshes(bpy.context)] == ["Alone", "Body", "Coat"]
    select(body.parent, coat, other)
    assert [obj.name for obj in selected_meshes(bpy.context)] == ["Coat", "Other"]


def test_the_armature_is_all_that_needs_to_be_selected(settings):
    obj = limbed_rigged()
    select(obj.parent)
    settings.source, settings.pose_count = "FRAMES", 3
    settings.n_segments, settings.n_eigenpairs, settings.n_energies = 3, 60, 40
    assert OPS.learn() == {"FINISHED"}
    learned = labels_of(obj)
    assert OPS.clear() == {"FINISHED"}
    assert read_labels(obj.data) is None
    assert OPS.apply() == {"FINISHED"}
    assert (labels_of(obj) == learned).mean() > 0.95


def test_clear_through_the_armature_takes_back_a_separation(settings):
    body, coat = limbed_rigged("Body"), limbed("Coat")
    coat.parent = body.parent
    write_labels(body.data, np.arange(len(body.data.polygons)) % 2)
    write_labels(coat.data, np.zeros(len(coat.data.polygons), dtype=np.int64))
    select(body)
    assert OPS.separate() == {"FINISHED"}
    pieces = {obj.name for obj in bpy.data.objects} - {"Body", "Coat", body.parent.name}
    assert len(pieces) == 2
    select(body.parent)
    assert OPS.clear() == {"FINISHED"}
    assert not pieces & {obj.name for obj in bpy.data.objects}
    assert bpy.data.objects["Body"].visible_get()
    assert all(read_labels(bpy.data.objects[name].data) is None for name in ("Body", "Coat"))


def test_the_list_is_of_the_meshes_on_the_selected_armature(settings):
    one, other = limbed_rigged("One"), limbed_rigged("Other")
    for obj in (one, other):
        write_labels(obj.data, np.zeros(len(obj.data.polygons), dtype=np.int64))
    select(one.parent)
    assert segment_list.labeled(settings) == [one]
    select()
    assert segment_list.labeled(settings) == [one, other]


@pytest.mark.parametrize("name", ["apply", "save_model"])
def test_buttons_are_gray_without_a_model(name):
    select(limbed())
    assert "No model yet" in refusal(getattr(OPS, name))


def test_clear_is_gray_where_there_are_no_segments():
    select(limbed())
    assert "Select an object that has segments" in refusal(OPS.clear)


def test_clear_is_gray_where_only_the_artist_used_our_name():
    obj = limbed()
    obj.data["wks_segment"] = 1
    select(obj)
    assert not OPS.clear.poll()


# Errors


def fails(operator, match, **options):
    """The operator refuses with this message, and nothing in the file has changed."""
    before = scene_snapshot()
    with pytest.raises(RuntimeError, match=match):
        operator(**options)
    assert not changes(before, scene_snapshot())


def test_not_finite_coordinate(learned):
    broken = limbed("Broken")
    broken.data.vertices[3].co.z = float("nan")
    broken.data.update()
    select(learned[0], broken)
    fails(OPS.learn, '"Broken".*vertex 3 .*not finite')
    fails(OPS.apply, '"Broken".*vertex 3 .*not finite')


def test_object_without_faces(learned):
    select(learned[0], mesh_object([(0, 0, 0), (1, 0, 0)], [], "Wire"))
    fails(OPS.learn, '"Wire" has no faces')
    fails(OPS.apply, '"Wire" has no faces')


def test_linked_object(tmp_path):
    limbed("Foreign")
    path = tmp_path / "library.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True)
    bpy.data.objects.remove(bpy.data.objects["Foreign"])
    with bpy.data.libraries.load(str(path), link=True) as (source, target):
        target.objects = source.objects
    bpy.context.scene.collection.objects.link(target.objects[0])
    select(target.objects[0])
    fails(OPS.learn, '"Foreign" is linked from another file')


def test_several_characters_for_frames(settings):
    settings.source = "FRAMES"
    select(*limbed_poses(0, 0.5))
    bpy.context.view_layer.objects.active = None
    fails(OPS.learn, "2 characters are selected")


def test_frame_range_that_ends_before_it_begins(settings):
    settings.source, settings.use_frame_range, settings.frame_first, settings.frame_last = "FRAMES", True, 20, 10
    select(limbed_rigged())
    fails(OPS.learn, r"ends \(10\) before it begins \(20\)")


def test_object_without_shape_keys(settings):
    settings.source = "SHAPE_KEYS"
    select(limbed())
    fails(OPS.learn, '"Limbed" has no shape keys')


def test_of_several_characters_the_active_one_gives_the_frames(settings):
    settings.source = "FRAMES"
    obj, other = limbed_rigged(), limbed("Other")
    select(obj, other)
    for active in (obj, obj.parent):
        bpy.context.view_layer.objects.active = active
        assert OPS.learn() == {"FINISHED"}
        assert labels_of(obj) is not None
        assert "wks_segment" not in other.data.attributes


def test_modifier_without_trace_of_origin_at_a_later_pose(learned):
    learned[2].modifiers.new("Remesh", "REMESH")
    fails(OPS.learn, '"Pose 2".*modifier')


def test_surface_that_the_core_refuses_is_named(learned):
    """A needle whose short edge is none."""
    speck = mesh_object([(0, 0, 0), (1, 0, 0), (1, 1e-7, 0)], [(0, 1, 2)], "Speck")
    select(learned[0], speck)
    fails(OPS.learn, '"Speck": every face of the mesh collapses')
    fails(OPS.apply, '"Speck": every face of the mesh collapses')


def test_single_triangle_is_too_little_or_enough_but_breaks_nothing(settings):
    triangle = mesh_object([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)], "Triangle")
    select(triangle)
    fails(OPS.learn, "1 faces, too few for")


def test_more_segments_than_the_surface_has_different_places(settings):
    """All signatures of a regular tetrahedron's refined surface repeat 24 times."""
    corners = [(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)]
    solid = mesh_object(corners, [(0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2)], "Solid")
    settings.n_segments, settings.n_eigenpairs = 64, 20
    select(solid)
    before = scene_snapshot()
    refused = error_of(OPS.learn)
    if refused:  # either outcome is right, a traceback is not
        assert "segments" in refused
        assert "Traceback" not in refused
        assert not changes(before, scene_snapshot())
    else:
        assert labels_of(solid).max() < 64


def test_damaged_model_of_the_file(learned, settings):
    settings.model = settings.model[: len(settings.model) // 2]
    fails(OPS.apply, "The model in this file cannot be used")


# Undo


def test_operators_that_change_something_can_be_undone():
    for name in ("learn", "apply", "clear", "load_model"):
        cls = getattr(registration, f"WKS_SEGMENT_OT_{name}")
        assert {"REGISTER", "UNDO"} <= cls.bl_options, name


def test_undo_gives_back_what_was():
    select(limbed())
    bpy.ops.ed.undo_push(message="before")
    before = snapshot(bpy.data.meshes["Limbed"])
    OPS.learn()
    bpy.ops.ed.undo_push(message="learned")
    assert "wks_segment" in bpy.data.meshes["Limbed"].attributes
    assert bpy.ops.ed.undo() == {"FINISHED"}
    assert not changes(before, snapshot(bpy.data.meshes["Limbed"]))
    assert not bpy.context.scene.wks_segment.model
    assert bpy.ops.ed.redo() == {"FINISHED"}
    assert "wks_segment" in bpy.data.meshes["Limbed"].attributes
    assert bpy.context.scene.wks_segment.model


# The model


def test_model_goes_to_a_file_and_comes_back(learned, settings, tmp_path):
    path, labels = tmp_path / "model.json", labels_of(learned[0])
    model = settings.model
    assert OPS.save_model(filepath=str(path)) == {"FINISHED"}
    settings.model = settings.model_summary = ""
    OPS.clear()
    assert OPS.load_model(filepath=str(path)) == {"FINISHED"}
    assert settings.model == model
    assert "model.json" in settings.model_summary
    select(learned[0])
    OPS.apply()
    assert (labels_of(learned[0]) == labels).mean() > 0.95


def test_saved_model_is_one_of_the_core(learned, tmp_path):
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
        (b"[1, 2", "no JSON"),
        (b"\x80\x04\x95\xff", "binary file"),
        (b'{"format": "wks_segment model", "version": 99}', "version 99"),
        (b'{"format": "wks_segment model", "version": 4, "parameters": {}}', "damaged"),
        (b"", "no JSON"),
    ],
)
def test_foreign_model_file_is_refused_and_the_old_model_stays(learned, tmp_path, content, match):
    path = tmp_path / "foreign.json"
    path.write_bytes(content)
    fails(OPS.load_model, f"foreign.json.*{match}", filepath=str(path))


def test_model_with_a_damaged_number_is_refused(learned, settings, tmp_path):
    path = tmp_path / "damaged.json"
    path.write_text(settings.model.replace('"weights": [0.', '"weights": [-0.'))
    fails(OPS.load_model, "damaged.json.*not positive", filepath=str(path))


def test_model_file_that_does_not_exist(learned, tmp_path):
    fails(OPS.load_model, "missing.json was not loaded", filepath=str(tmp_path / "missing.json"))


def test_model_of_more_segments_than_there_are_colors(settings, tmp_path):
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


def test_folder_in_the_place_of_a_model(learned, tmp_path):
    fails(OPS.load_model, "was not loaded", filepath=str(tmp_path))


def test_model_that_cannot_be_written(learned, tmp_path):
    fails(OPS.save_model, "model was not saved", filepath=str(tmp_path / "missing" / "model.json"))


def test_model_stays_with_the_blend_file(learned, settings, tmp_path):
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


# Settings and panel


def test_every_setting_has_a_tooltip_and_numbers_have_limits(settings):
    own = [prop for prop in settings.bl_rna.properties if prop.identifier not in ("rna_type", "name")]
    assert len(own) >= 15
    for prop in own:
        assert len(prop.description) > 10, prop.identifier
        if prop.type in ("INT", "FLOAT") and prop.identifier not in ("frame_first", "frame_last", "random_state"):
            assert -1e6 < prop.hard_min < prop.hard_max < 1e6, prop.identifier


def test_settings_reach_the_model(settings):
    settings.n_segments, settings.n_eigenpairs, settings.n_energies = 5, 77, 33
    settings.covariance_type, settings.scaling, settings.random_state = "diag", "raw", 9
    model = settings.new_model()
    assert (model.n_segments, model.n_eigenpairs, model.n_energies) == (5, 77, 33)
    assert (model.covariance_type, model.scaling, model.random_state) == ("diag", "raw", 9)


def test_defaults_are_those_of_the_paper_and_of_the_core(scene):
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    model = bpy.context.scene.wks_segment.new_model()
    assert vars(model) == vars(PoseSegmentation())
    assert (model.n_eigenpairs, model.n_energies) == (300, 100)


def test_automatic_number_shows_its_curve(settings, printed):
    settings.auto_segments = True
    select(*limbed_poses(*BENDS))
    printed()
    assert OPS.learn() == {"FINISHED"}
    model = PoseSegmentation.from_json(settings.model)
    assert (model.n_segments, 2 <= model.n_segments_ <= 16) == ("auto", True)
    (line,) = [line for line in settings.model_summary.splitlines() if line.startswith("Certainty")]
    assert line.startswith("Certainty by segments: 2 0.")
    assert line.endswith(f" ({model.n_segments_} taken)")
    assert f"{model.n_segments_} {model.grouping_.curve()[model.n_segments_ - 1]:.2f} " in line
    assert line.count("·") == 14
    said = printed().out
    assert said.index(line) < said.index("Learned: 3 poses")


def test_automatic_number_survives_a_file_and_apply(settings, tmp_path):
    settings.auto_segments = True
    first, other = limbed_poses(*BENDS[:2])
    select(first)
    OPS.learn()
    line = settings.model_summary.splitlines()[-1]
    OPS.save_model(filepath=str(tmp_path / "model.json"))
    settings.auto_segments = False
    OPS.load_model(filepath=str(tmp_path / "model.json"))
    assert settings.model_summary.splitlines()[-1] == line
    select(other)
    assert OPS.apply() == {"FINISHED"}
    assert labels_of(other).max() < 16


def test_a_number_that_was_given_shows_no_curve(learned, settings):
    assert "Certainty" not in settings.model_summary


def test_automatic_number_needs_the_robust_method(settings):
    settings.auto_segments, settings.preset = True, "paper"
    select(limbed())
    fails(OPS.learn, "cannot be automatic with the method of the paper")


def test_automatic_number_fits_a_mesh_of_few_faces(settings):
    """Eight segments would be too many for a cube; two are not."""
    settings.auto_segments, settings.n_segments = True, 8
    corners = [(x, y, z) for x in (0, 1) for y in (0, 1.5) for z in (0, 4)]
    cube = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    select(mesh_object(corners, cube))
    assert OPS.learn() == {"FINISHED"}


def drawn(panel):
    """The layout that a panel was drawn on."""
    layout = MagicMock()
    shown = type("Shown", (panel.__bases__[0],), {"layout": layout})()
    panel.draw(shown, bpy.context)
    return layout


@pytest.mark.parametrize("automatic", [False, True])
def test_number_is_gray_where_it_is_automatic(settings, automatic):
    settings.auto_segments = automatic
    column = drawn(main_panel.WKS_SEGMENT_PT_main).column.return_value
    column.prop.assert_any_call(settings, "auto_segments")
    number = column.column.return_value
    number.prop.assert_called_once_with(settings, "n_segments")
    assert number.enabled is not automatic


def test_sides_can_be_chosen_in_the_panel(settings):
    shown = drawn(main_panel.WKS_SEGMENT_PT_main).column.return_value.prop.call_args_list
    assert (settings, "sides") in [call.args for call in shown]


@pytest.mark.parametrize("materials", [False, True])
def test_outputs_can_be_chosen_in_the_panel(settings, materials):
    settings.write_materials = materials
    shown = [call.args[1] for call in drawn(main_panel.WKS_SEGMENT_PT_outputs).column.return_value.prop.call_args_list]
    assert {"palette", "write_colors", "vertex_groups", "write_face_sets", "write_seams"} < set(shown)
    assert ("material_template" in shown) is materials
    buttons = drawn(main_panel.WKS_SEGMENT_PT_outputs).column.return_value.operator.call_args_list
    assert {call.args[0] for call in buttons} == {f"wks_segment.{name}" for name in ("unwrap", "separate", "transfer")}
    drawn(main_panel.WKS_SEGMENT_PT_bake).operator.assert_called_once_with("wks_segment.bake", icon="RENDER_STILL")


def test_panel_breaks_long_lines_and_keeps_pairs_together(settings):
    settings.model = "{}"
    settings.model_summary = "From Fox\nCertainty by segments: " + " · ".join(f"{i} 0.91" for i in range(2, 17))
    labels = drawn(models_panel.WKS_SEGMENT_PT_models).column.return_value.label.call_args_list
    lines = [call.kwargs["text"] for call in labels]
    assert lines[0] == "From Fox"
    assert max(map(len, lines)) <= main_panel.WIDTH
    assert all(line.count("\N{NO-BREAK SPACE}") == line.count("0.91") for line in lines)


def test_panel_sits_in_the_sidebar_under_its_own_tab():
    main = main_panel.CLASSES[0]
    assert (main.bl_space_type, main.bl_region_type, main.bl_category) == ("VIEW_3D", "UI", "WKS")
    for child in main_panel.CLASSES[1:]:
        assert child.bl_parent_id == main.bl_idname


def test_extension_can_be_disabled_and_enabled_again(extension):
    extension.unregister()
    try:
        assert not hasattr(bpy.types.Scene, "wks_segment")
        assert not hasattr(bpy.types, "WKS_SEGMENT_OT_learn")
    finally:
        extension.register()
    assert bpy.context.scene.wks_segment.n_segments >= 2
