"""Which of several objects are read from frames, and by which action."""

import bpy
import numpy as np
import pytest
from boxes import CUBE, QUADS, box
from builders import (
    changes,
    labels_of,
    limbed,
    limbed_keys,
    limbed_poses,
    limbed_rigged,
    mesh_object,
    pose_snapshot,
    rig,
    scene_snapshot,
    select,
)

from wks_segment.blender.errors import UserError
from wks_segment.blender.scene.characters import group, mesh_objects
from wks_segment.blender.scene.pose_sources import read_training_poses
from wks_segment.blender.scene.touching import joined
from wks_segment.blender.workflow.report import Report

pytestmark = pytest.mark.usefixtures("scene")
QUICK = ("--segments", 4, "--eigenpairs", 30, "--energies", 40)


@pytest.fixture
def frames(settings):
    settings.source, settings.pose_count = "FRAMES", 3
    return settings


def ground():
    return mesh_object(9 * CUBE * (1, 1, 0.001) + (0, 0, -1), QUADS, "Ground")


def walker(name, x, scale=1.0):
    obj = limbed_rigged(name)
    obj.parent.name = f"{name} rig"
    obj.parent.location.x, obj.parent.scale = x, (scale,) * 3
    return obj


def learned(settings):
    report = Report([])
    poses = read_training_poses(bpy.context, settings, report)
    return [pose.character.name for pose in poses], report.choices


def action_of(armature, name, *bends):
    """A further action that bends the limb at frames 1, 11 …; the armature has its own action again."""
    own = armature.animation_data.action
    action = bpy.data.actions.new(name)
    action.use_fake_user = True
    armature.animation_data.action = action
    for i, bend in enumerate(bends):
        armature.pose.bones["limb"].rotation_euler = (bend, 0, 0)
        armature.pose.bones["limb"].keyframe_insert("rotation_euler", frame=1 + 10 * i)
    armature.animation_data.action = own
    bpy.context.scene.frame_set(1)
    return action


# Characters


def test_what_does_not_move_is_left_out_by_name(frames):
    obj, lamp = walker("Hero", 0), bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    bpy.context.scene.collection.objects.link(lamp)
    gizmo, floor = box(name="Gizmo"), ground()
    gizmo.parent = lamp
    select(floor, gizmo, obj)
    names, notes = learned(frames)
    assert names == ["Hero"] * 3
    assert notes == ['Left out, as they do not move: "Gizmo", "Ground"']


def test_the_largest_of_several_that_move_is_taken_unless_another_one_is_active(frames):
    small, large = walker("Small", 0, 0.5), walker("Large", 9)
    floor = ground()
    select(floor, small, large)
    names, notes = learned(frames)
    assert names == ["Large"] * 3
    assert notes[1].startswith('Several characters move: "Large", "Small". "Large" is taken')
    select(small, large, floor)
    assert learned(frames)[0] == ["Small"] * 3
    select(small)
    assert learned(frames) == (["Small"] * 3, [])


def test_command_line_takes_what_moves_most_and_objects_that_are_named(command, tmp_path):
    path = tmp_path / "scene.blend"
    walker("Small", 0, 0.5), walker("Large", 9), ground()
    bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True)
    done = command("segment", path, "--frames", 2, *QUICK, "--json")
    assert [pose["name"] for pose in done.result["poses"]] == ["Large, frame 6", "Large, frame 16"]
    assert 'Left out, as they do not move: "Ground"' in done.result["notes"]
    done = command("segment", path, "--frames", 2, "--object", "Small", *QUICK, "--json")
    assert [pose["name"] for pose in done.result["poses"]] == ["Small, frame 6", "Small, frame 16"]


@pytest.mark.usefixtures("needs_rendering")
def test_the_demo_takes_a_character_that_is_named(command, tmp_path):
    path = tmp_path / "scene.blend"
    walker("Small", 0, 0.5), walker("Large", 9), ground()
    bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True)
    demo = ("demo", "--input", path, "--folder", tmp_path, "--learn", 1, "--unseen", 1, *QUICK, "--json")
    done = command(*demo, "--object", "Small")
    assert done.code == 0, done
    assert [pose["name"] for pose in done.result["poses"]] == ["Small, frame 6", "Small, frame 16"]


def test_a_prop_in_a_file_of_another_format_is_left_out(command, tmp_path):
    walker("Hero", 0), ground()
    bpy.ops.export_scene.gltf(filepath=str(tmp_path / "scene.glb"))
    done = command("segment", tmp_path / "scene.glb", "--frames", 2, *QUICK, "--json")
    assert [pose["name"] for pose in done.result["poses"]] == ["Hero, frame 6", "Hero, frame 16"]
    assert any("Ground" in note for note in done.result["notes"]), done.result["notes"]


def test_that_nothing_moves_is_said_of_each_character(command, tmp_path):
    still = [limbed("One"), limbed("Two")]
    still[1].location.x = 9
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "still.blend"), copy=True)
    done = command("segment", tmp_path / "still.blend", "--frames", 2, *QUICK, "--json")
    for obj in ("One", "Two"):
        assert any(f'poses of "{obj}" are the same' in warning for warning in done.result["warnings"]), done


def test_fewer_different_frames_than_asked_for_are_said(settings):
    obj = limbed_rigged(bends=((1, 0.0), (3, 0.9)))
    settings.source, settings.pose_count = "FRAMES", 9
    select(obj)
    bpy.ops.wks_segment.learn()
    report = bpy.context.window_manager.wks_segment_session.job.report
    assert any("number of different poses is" in warning and "not 9" in warning for warning in report.warnings)


def test_a_bone_shape_under_an_empty_is_no_character():
    body, shape = limbed("Body"), box(name="Widget")
    shape.parent = bpy.data.objects.new("Shapes", None)
    rig([body]).pose.bones["limb"].custom_shape = shape
    assert mesh_objects([shape, body]) == [body]


# Objects that touch


def snowman(*names):
    """Boxes on top of each other, each with a little space to the next."""
    return [mesh_object(CUBE + (0, 0, 2.01 * i), QUADS, name) for i, name in enumerate(names)]


def test_objects_that_touch_are_one_character(command, tmp_path):
    snowman("Base", "Belly", "Head")
    box(name="Far").location.x = 9
    ground().location.z = 0
    bpy.context.view_layer.update()
    characters, notes = joined(bpy.context, group(mesh_objects(bpy.context.scene.objects)))
    assert [len(character.objects) for character in characters] == [3, 1, 1]
    assert notes == ['Taken as one character, as they touch: "Base", "Belly", "Head"']


def test_objects_in_different_collections_and_on_different_armatures_stay_apart():
    objects = snowman("Base", "Head")
    other = bpy.data.collections.new("Other")
    bpy.context.scene.collection.children.link(other)
    bpy.context.scene.collection.objects.unlink(objects[1])
    other.objects.link(objects[1])
    assert len(joined(bpy.context, group(objects))[0]) == 2
    pair = [limbed_rigged("One"), limbed_rigged("Other")]
    assert len(joined(bpy.context, group(pair))[0]) == 2


def test_poses_that_lie_on_each_other_stay_apart():
    assert len(joined(bpy.context, group(limbed_poses(0.0, 0.4, 0.8)))[0]) == 3


def test_selected_objects_are_one_character_if_the_user_says_so(settings):
    objects = [limbed("Body", subdivisions=3), limbed("Belt", subdivisions=3)]
    objects[1].location.x = 2
    select(*objects)
    for together, count in ((False, 2), (True, 1)):
        settings.one_character = together
        assert len(read_training_poses(bpy.context, settings, Report([]))) == count
    assert bpy.ops.wks_segment.learn() == {"FINISHED"}
    assert bpy.ops.wks_segment.apply() == {"FINISHED"}
    assert len(bpy.context.window_manager.wks_segment_session.job.poses) == 1


# Actions


def test_a_static_action_is_replaced_by_the_one_that_moves_most_and_comes_back(frames):
    obj = limbed_rigged(bends=((1, 0.2), (11, 0.2)))
    armature = obj.parent
    action_of(armature, "Breathe", 0.0, 0.05)
    action_of(armature, "Wave", 0.0, 0.9, -0.5)
    still = armature.animation_data.action.name
    select(obj)
    before = scene_snapshot(), pose_snapshot(armature)
    report = Report([])
    poses = read_training_poses(bpy.context, frames, report)
    assert not changes(before[0], scene_snapshot())
    assert not changes(before[1], pose_snapshot(armature))
    assert [pose.name for pose in poses] == ["Walker, frame 4", "Walker, frame 11", "Walker, frame 18"]
    assert not poses[0].is_like(poses[1])
    assert report.choices == [f'"Walker": the poses are from the action "Wave"; others: "Breathe", "{still}"']


def test_the_action_that_the_artist_sees_stays_if_it_moves_the_character(frames):
    obj = limbed_rigged(bends=((1, 0.0), (11, 0.3)))
    own = obj.parent.animation_data.action.name
    action_of(obj.parent, "Wave", 0.0, 0.9, -0.5)
    select(obj)
    assert learned(frames)[1] == [f'"Walker": the poses are from the action "{own}"; others: "Wave"']
    bpy.ops.wks_segment.learn()
    assert '"Wave"' in frames.model_summary


def test_command_line_takes_the_action_that_moves_most_unless_one_is_named(command, tmp_path):
    obj = limbed_rigged(bends=((1, 0.0), (11, 0.3)))
    own = obj.parent.animation_data.action.name
    action_of(obj.parent, "Wave", 0.0, 0.9, -0.5)
    action_of(obj.parent, "Hold", 0.4, 0.4)
    path = tmp_path / "actions.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True)
    output = tmp_path / "out.blend"
    done = command("segment", path, "--frames", 2, *QUICK, "--output", output, "--json")
    assert f'"Walker": the poses are from the action "Wave"; others: "Hold", "{own}"' in done.result["notes"]
    done = command("segment", path, "--frames", 2, "--action", "Hold", *QUICK, "--json")
    assert any("the same" in warning for warning in done.result["warnings"])
    bpy.ops.wm.open_mainfile(filepath=str(output))
    assert bpy.data.objects["Rig"].animation_data.action.name == own
    assert np.unique(labels_of(bpy.data.objects["Walker"])).size == 4


def test_ten_actions_of_a_gltf_file_are_named(command, tmp_path, printed):
    """In the window as on the command line: the one that was taken, and the others."""
    obj = limbed_rigged(bends=((1, 0.2), (11, 0.2)))
    obj.parent.animation_data.action.name = "Hold"
    for i in range(9):
        action_of(obj.parent, f"Move {i}", 0.0, 0.1 * (i + 1))
    path = tmp_path / "ten.glb"
    bpy.ops.export_scene.gltf(filepath=str(path))
    taken = 'the poses are from the action "Move 8'  # before 4.4, the importer adds the name of the rig
    done = command("segment", path, "--frames", 2, *QUICK, "--json")
    (note,) = [note for note in done.result["notes"] if taken in note]
    assert note.count('"Move') == 8  # with the one that was taken
    assert note.endswith(" …"), "more than eight others are too many for a line"
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.import_scene.gltf(filepath=str(path))
    assert len(bpy.data.actions) == 10
    body = next(obj for obj in bpy.context.scene.objects if obj.find_armature())
    (held,) = (action for action in bpy.data.actions if action.name.startswith("Hold"))
    body.find_armature().animation_data.action = held
    settings = bpy.context.scene.wks_segment
    settings.source, settings.pose_count, settings.n_segments, settings.n_eigenpairs = "FRAMES", 2, 4, 30
    select(body)
    printed()
    assert bpy.ops.wks_segment.learn() == {"FINISHED"}
    assert taken in printed().out
    assert taken in settings.model_summary, "the panel shows it as well"
    assert body.find_armature().animation_data.action == held


def test_the_place_of_the_armature_comes_back_and_actions_of_another_rig_are_not_tried(frames):
    obj, other = limbed_rigged(bends=((1, 0.2), (11, 0.2))), walker("Other", 9)
    armature = obj.parent
    armature.animation_data.action.name = "Hold"
    jump = action_of(armature, "Jump", 0.0, 0.9)
    own, armature.animation_data.action = armature.animation_data.action, jump
    armature.location.z = 5
    armature.keyframe_insert("location", frame=1)
    armature.animation_data.action, armature.location.z = own, 0
    bpy.data.actions.new("Other rig|Dance")
    track = other.parent.animation_data.nla_tracks.new()
    track.strips.new("Strip", 1, action_of(other.parent, "Waits in a track", 0.0, 1.5))
    track.mute = True
    select(obj)
    before = pose_snapshot(armature), tuple(armature.location)
    assert learned(frames)[1] == ['"Walker": the poses are from the action "Jump"; others: "Hold"']
    assert (pose_snapshot(armature), tuple(armature.location)) == before


def test_parts_of_an_animated_parent_are_one_character(frames):
    root = bpy.data.objects.new("Root", None)
    bpy.context.scene.collection.objects.link(root)
    parts = [box(-0.5, 0.5, f"Part {i}") for i in range(3)]
    for i, part in enumerate(parts):
        part.parent, part.location.z = root, 9 * i
    for frame, x in ((1, 0), (21, 3)):
        root.location.x = x
        root.keyframe_insert("location", frame=frame)
    select(*parts)
    report = Report([])
    poses = read_training_poses(bpy.context, frames, report)
    assert [len(pose.character.objects) for pose in poses] == [3, 3, 3]
    assert [pose.name for pose in poses] == ["Part 0, frame 4", "Part 0, frame 11", "Part 0, frame 18"]


def test_an_error_while_frames_are_read_gives_the_action_back(frames):
    obj = limbed_rigged(bends=((1, 0.2), (11, 0.2)))
    action_of(obj.parent, "Wave", 0.0, 0.9, -0.5)
    obj.modifiers.new("Remesh", "REMESH")
    select(obj)
    before = pose_snapshot(obj.parent)
    with pytest.raises(UserError, match="Remesh"):
        read_training_poses(bpy.context, frames, Report([]))
    assert not changes(before, pose_snapshot(obj.parent))


def test_actions_of_shape_keys_are_chosen_as_well(frames):
    obj = limbed_keys(0.9)
    keys = obj.data.shape_keys
    for name, values in (("Smile", (0.0, 1.0)), ("Still", (0.2, 0.2))):
        keys.animation_data_create().action = action = bpy.data.actions.new(name)
        action.use_fake_user = True
        for i, value in enumerate(values):
            keys.key_blocks[1].value = value
            keys.key_blocks[1].keyframe_insert("value", frame=1 + 10 * i)
    bpy.context.scene.frame_set(1)
    select(obj)
    before = scene_snapshot()
    assert learned(frames)[1] == ['"Keyed": the poses are from the action "Smile"; others: "Still"']
    assert not changes(before, scene_snapshot())
    assert (keys.animation_data.action.name, round(keys.key_blocks[1].value, 3)) == ("Still", 0.2)


def robot(path, separate):
    """A glTF file of two boxes without armature, under a turning node, with an animation for each of two names."""
    turning = bpy.data.objects.new("Turning", None)
    bpy.context.scene.collection.objects.link(turning)
    body, arm = limbed("Body", subdivisions=2), limbed("Arm", subdivisions=2)
    arm.location = (0, 0, 4)
    for obj in (body, arm):
        obj.parent = turning
    if not separate:
        arm.parent = body
    for name, bend in (("Wave", 1.2), ("Nod", 0.3)):
        for obj, axis, angle in ((turning, 2, 0.5), (arm, 0, bend)):
            data = obj.animation_data_create()
            data.action = bpy.data.actions.new(f"{name} {obj.name}")
            for frame in (1, 11, 21):
                obj.rotation_euler[axis] = angle * (frame == 11)
                obj.keyframe_insert("rotation_euler", frame=frame)
            track = data.nla_tracks.new()
            track.name = name
            track.strips.new(name, 1, data.action)
            data.action = None
    bpy.ops.export_scene.gltf(filepath=str(path), export_animation_mode="NLA_TRACKS")


@pytest.mark.parametrize("separate", [False, True])
def test_animations_of_nodes_are_chosen_as_actions(command, tmp_path, separate):
    path = tmp_path / "robot.glb"
    robot(path, separate)
    done = command("segment", path, "--frames", 3, *QUICK, "--json")
    assert any('the poses are from the action "Wave"; others: "Nod"' in note for note in done.result["notes"]), done
    assert not any("the same" in warning for warning in done.result["warnings"])
    done = command("segment", path, "--frames", 3, "--action", "Nod", *QUICK, "--json")
    assert (done.code, len(done.result["poses"])) == (0, 3)
    assert not any("Wave" in note for note in done.result["notes"])


@pytest.mark.parametrize("separate", [False, True])
def test_animations_of_nodes_come_back(frames, tmp_path, separate):
    """In the window what the importer assigned stays, unless the character does not move by it."""
    robot(tmp_path / "robot.glb", separate)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.import_scene.gltf(filepath=str(tmp_path / "robot.glb"))
    arm, turning = bpy.data.objects["Arm"], bpy.data.objects["Turning"]
    for obj in (arm, turning):
        obj.animation_data.action = None
    arm.rotation_quaternion = turned = (0.8, 0.6, 0, 0)
    select(bpy.data.objects["Body"], arm)
    settings = bpy.context.scene.wks_segment
    settings.source, settings.pose_count = "FRAMES", 3
    before = scene_snapshot(), tuple(turning.rotation_quaternion)
    report = Report([])
    poses = read_training_poses(bpy.context, settings, report)
    assert any('the action "Wave"' in note for note in report.choices), report.choices
    assert not poses[0].is_like(poses[1])
    assert not changes(before[0], scene_snapshot())
    assert arm.animation_data.action is turning.animation_data.action is None
    assert tuple(arm.rotation_quaternion) == pytest.approx(turned)
    assert tuple(turning.rotation_quaternion) == before[1]
