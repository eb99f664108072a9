"""Poses at frames and in shape keys; the scene is as before afterward."""

import bpy
import numpy as np
import pytest
from builders import (
    bent,
    changes,
    coordinates,
    limbed,
    limbed_keys,
    limbed_rigged,
    scene_snapshot,
    select,
)

from wks_segment.blender.errors import UserError
from wks_segment.blender.scene import poses as reader
from wks_segment.blender.scene.characters import Character

pytestmark = pytest.mark.usefixtures("scene")


def test_frames_are_read_by_name_and_the_scene_returns_to_its_frame():
    obj, scene = limbed_rigged(), bpy.context.scene
    scene.frame_set(7, subframe=0.25)
    poses = reader.read_frames(bpy.context, Character((obj,)), [1, 11])
    assert [pose.name for pose in poses] == ["Walker, frame 1", "Walker, frame 11"]
    assert not poses[0].is_like(poses[1])
    assert (scene.frame_current, scene.frame_subframe) == (7, 0.25)


def test_frame_returns_after_an_error():
    obj, scene = limbed_rigged(), bpy.context.scene
    obj.modifiers.new("Remesh", "REMESH")
    scene.frame_set(7, subframe=0.5)
    with pytest.raises(UserError):
        reader.read_frames(bpy.context, Character((obj,)), [1, 11])
    assert (scene.frame_current, scene.frame_subframe) == (7, 0.5)


def test_evenly_includes_both_ends_and_repeats_nothing():
    assert reader.evenly(1, 9, 3) == [1, 5, 9]
    assert reader.evenly(0, 3, 10) == [0, 1, 2, 3]
    assert reader.evenly(5, 5, 4) == [5]
    assert reader.evenly(-10, 10, 5) == [-10, -5, 0, 5, 10]
    assert reader.evenly(3, 9, 1) == [3]


def test_own_frames_lie_within_the_action_and_leave_out_its_ends():
    obj, scene = limbed_rigged(bends=((101, 0.0), (141, 0.8))), bpy.context.scene
    scene.frame_start, scene.frame_end = 1, 10
    frames = reader.own_frames(scene, Character((obj,)), 4)
    assert frames == [106, 116, 126, 136]


def test_own_frames_of_a_character_without_action_are_those_of_the_scene():
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 10, 20
    assert reader.own_frames(scene, Character((limbed(),)), 2) in ([12, 18], [12, 17])


def test_own_frames_follow_keyed_shape_keys_and_objects():
    obj, scene = limbed_keys(0.8), bpy.context.scene
    key = obj.data.shape_keys.key_blocks[1]
    key.keyframe_insert("value", frame=50)
    key.keyframe_insert("value", frame=60)
    obj.keyframe_insert("location", frame=40)
    assert reader.own_frames(scene, Character((obj,)), 2) == [45, 55]


def test_shape_keys_are_read_alone_at_their_full_value():
    obj = limbed_keys(0.4, 0.8)
    obj.data.shape_keys.key_blocks[1].value = 0.7
    basis = coordinates(obj.data)
    poses = reader.read_shape_keys(bpy.context, Character((obj,)), 9)
    assert [pose.name for pose in poses] == ["Keyed, Basis", "Keyed, Bend 0.4", "Keyed, Bend 0.8"]
    for pose, bend in zip(poses, (0, 0.4, 0.8), strict=True):
        np.testing.assert_allclose(pose.mesh.vertices, bent(basis, bend), atol=1e-5)


def test_the_number_of_shape_keys_is_limited_evenly():
    obj = limbed_keys(0.1, 0.2, 0.3, 0.4)
    poses = reader.read_shape_keys(bpy.context, Character((obj,)), 3)
    assert [pose.name for pose in poses] == ["Keyed, Basis", "Keyed, Bend 0.2", "Keyed, Bend 0.4"]


@pytest.mark.parametrize("pinned", [True, False])
def test_active_shape_key_and_pin_come_back(pinned):
    obj = limbed_keys(0.4, 0.8)
    obj.active_shape_key_index, obj.show_only_shape_key = 1, pinned
    reader.read_shape_keys(bpy.context, Character((obj,)), 3)
    assert (obj.active_shape_key_index, obj.show_only_shape_key) == (1, pinned)


def test_active_shape_key_comes_back_after_an_error():
    obj = limbed_keys(0.4, 0.8)
    obj.active_shape_key_index = 1
    obj.modifiers.new("Remesh", "REMESH")
    with pytest.raises(UserError):
        reader.read_shape_keys(bpy.context, Character((obj,)), 3)
    assert (obj.active_shape_key_index, obj.show_only_shape_key) == (1, False)


def test_muted_shape_keys_are_left_out():
    obj = limbed_keys(0.4, 0.8)
    obj.data.shape_keys.key_blocks["Bend 0.4"].mute = True
    assert [pose.name for pose in reader.read_shape_keys(bpy.context, Character((obj,)), 9)] == [
        "Keyed, Basis",
        "Keyed, Bend 0.8",
    ]


def test_object_whose_shape_keys_are_all_muted_is_refused():
    obj = limbed_keys(0.4)
    for key in obj.data.shape_keys.key_blocks:
        key.mute = True
    with pytest.raises(UserError, match='"Keyed"'):
        reader.read_shape_keys(bpy.context, Character((obj,)), 3)


def test_object_without_shape_keys_is_refused():
    with pytest.raises(UserError, match='"Limbed" has no shape keys'):
        reader.read_shape_keys(bpy.context, Character((limbed(),)), 3)


def test_reading_leaves_the_scene_as_it_was():
    obj = limbed_rigged()
    obj.modifiers.new("Subdivision", "SUBSURF")
    select(obj)
    before = scene_snapshot()
    reader.read_frames(bpy.context, Character((obj,)), [3, 9])
    assert not changes(before, scene_snapshot())
