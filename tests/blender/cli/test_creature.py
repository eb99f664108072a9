"""The creature of the demo: its surface, its walk, and what else is in its scene."""

import bpy
import numpy as np
import pytest
from builders import coordinates

from wks_segment.blender.cli.creature import FIRST_FRAME, LAST_FRAME, build_creature
from wks_segment.blender.cli.demo_scene import creature_in
from wks_segment.blender.scene import poses as reader
from wks_segment.blender.scene.poses import Character
from wks_segment.core import prepare_surface


@pytest.fixture
def creature(scene):
    return build_creature(scene)


def test_surface_is_one_closed_island_of_5_to_20_thousand_vertices(creature):
    (pose,) = reader.read_objects(bpy.context, [Character((creature,))])
    assert 5_000 <= pose.mesh.n_vertices <= 20_000
    assert prepare_surface(pose.mesh).n_islands == 1
    edges = np.sort(pose.mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    assert set(np.unique(edges, axis=0, return_counts=True)[1].tolist()) == {2}
    # Euler's formula for a sphere: no handles.
    assert pose.mesh.n_vertices - len(np.unique(edges, axis=0)) + pose.mesh.n_faces == 2


def test_its_poses_differ_without_distortion(scene, creature):
    poses = reader.read_frames(bpy.context, Character((creature,)), [FIRST_FRAME, 8, 20, 33])
    for i, pose in enumerate(poses):
        assert not any(pose.is_like(other) for other in poses[:i])
    moved = np.linalg.norm(poses[1].mesh.vertices - poses[0].mesh.vertices, axis=1)
    assert 0.1 < moved.max() < 1.5
    areas = [pose.mesh.area for pose in poses]
    assert max(areas) < 1.1 * min(areas), "a pose stretches or compresses the surface"


def test_its_walk_is_a_loop(scene, creature):
    first, last = reader.read_frames(bpy.context, Character((creature,)), [FIRST_FRAME, LAST_FRAME + 1])
    assert first.is_like(last)
    assert Character((creature,)).frame_ranges() == [(FIRST_FRAME, LAST_FRAME + 1)]


def test_its_right_half_mirrors_the_left(creature):
    points = coordinates(creature.data)
    mirrored = points * (-1, 1, 1)
    order, other = (np.lexsort(np.round(p, 3).T) for p in (points, mirrored))
    np.testing.assert_allclose(points[order], mirrored[other], atol=2e-3)


def test_building_it_leaves_no_other_data(scene, creature):
    assert {obj.type for obj in scene.objects} == {"MESH", "ARMATURE"}
    assert [len(bpy.data.meshes), len(bpy.data.armatures), len(bpy.data.actions)] == [1, 1, 1]


def test_demo_sets_the_frames_of_the_scene(scene):
    character = creature_in(scene)
    assert (scene.frame_start, scene.frame_end) == (FIRST_FRAME, LAST_FRAME)
    assert [obj.type for obj in character.objects] == ["MESH"]
