"""How the demo splits poses and measures whether parts stay the same. (The demo itself runs in CI.)"""

import bpy
import numpy as np
import pytest
from builders import limbed_rigged, mesh_object

from wks_segment.blender.cli import demo_scene
from wks_segment.blender.errors import UserError
from wks_segment.blender.scene import poses as reader
from wks_segment.blender.scene.poses import Character


@pytest.mark.parametrize(("count", "learned"), [(8, 4), (5, 4), (4, 3), (2, 1), (9, 5)])
def test_split_learns_from_so_many_poses_and_leaves_the_rest(count, learned):
    result = demo_scene.split(count, learned)
    assert len(result) == count
    assert sum(result) == learned
    assert result[0]


def test_unseen_poses_lie_between_learned_ones():
    assert demo_scene.split(5, 3) == [True, False, True, False, True]


def test_agreement_is_the_share_of_the_area_with_the_usual_label():
    labels = [np.array([0, 1, 2]), np.array([0, 1, 2]), np.array([0, 1, 1]), np.array([1, 1, 2])]
    areas = [np.array([1.0, 2.0, 1.0])] * 3 + [np.array([3.0, 1.0, 1.0])]
    assert demo_scene.agreements(labels, [True, True, False, False], areas) == [1.0, 1.0, 0.75, 0.4]


def test_unseen_poses_have_no_vote():
    labels = [np.array([0, 0]), np.array([1, 1]), np.array([1, 1])]
    assert demo_scene.agreements(labels, [True, False, False], [np.ones(2)] * 3) == [1.0, 0.0, 0.0]


def test_area_of_a_polygon_is_that_of_its_triangles(scene):
    obj = mesh_object([(0, 0, 0), (2, 0, 0), (2, 3, 0), (0, 3, 0), (0, 0, 4)], [(0, 1, 2, 3), (0, 1, 4)])
    (pose,) = reader.read_objects(bpy.context, [Character((obj,))])
    assert demo_scene.polygon_areas(pose, 2) == pytest.approx([6, 4])


def test_demo_of_a_small_character(settings, tmp_path, needs_rendering):
    character = Character((limbed_rigged(),))
    stages = []
    result = demo_scene.run(
        bpy.context, character, settings, tmp_path / "walk.1", 2, 2, lambda *stage: stages.append(stage)
    )
    assert [pose["learned"] for pose in result["poses"]] == [True, False, False, True]
    assert result["agreement"] > 0.9
    assert result["agreement"] == pytest.approx(np.mean([pose["agreement"] for pose in result["poses"][1:3]]), abs=1e-3)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["walk.1.blend", "walk.1.json", "walk.1.png"]
    fractions = [fraction for _, fraction in stages]
    assert fractions == sorted(fractions)
    assert 0 <= fractions[0] < fractions[-1] <= 1


def test_demo_needs_enough_frames(settings, tmp_path):
    character = Character((limbed_rigged(bends=((1, 0.0), (3, 0.5))),))
    with pytest.raises(UserError, match="8 poses are asked for, but the animation has only"):
        demo_scene.run(bpy.context, character, settings, tmp_path / "walk", 4, 4, lambda stage, fraction: None)
