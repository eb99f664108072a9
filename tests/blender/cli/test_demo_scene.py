"""The demo: choice of the learned poses, agreement of labels, and a run with a small character."""

import bpy
import numpy as np
import pytest
from builders import limbed_rigged, mesh_object

from wks_segment.blender.cli.demo_scene import Demo, agreements, polygon_areas, spread
from wks_segment.blender.errors import UserError
from wks_segment.blender.scene import poses as reader
from wks_segment.blender.scene.poses import Character
from wks_segment.blender.workflow.describing import Run
from wks_segment.blender.workflow.report import Report
from wks_segment.core.progress import Progress


@pytest.mark.parametrize(("count", "learned"), [(8, 4), (5, 4), (4, 3), (2, 1), (9, 5)])
def test_spread_chooses_a_number_of_poses_beginning_with_the_first(count, learned):
    result = spread(count, learned)
    assert len(result) == count
    assert sum(result) == learned
    assert result[0]


def test_unseen_poses_lie_between_learned_ones():
    assert spread(5, 3) == [True, False, True, False, True]


def test_agreement_is_the_share_of_the_area_with_the_usual_label():
    labels = [np.array([0, 1, 2]), np.array([0, 1, 2]), np.array([0, 1, 1]), np.array([1, 1, 2])]
    areas = [np.array([1.0, 2.0, 1.0])] * 3 + [np.array([3.0, 1.0, 1.0])]
    assert agreements(labels, [True, True, False, False], areas) == [1.0, 1.0, 0.75, 0.4]


def test_unseen_poses_have_no_vote():
    labels = [np.array([0, 0]), np.array([1, 1]), np.array([1, 1])]
    assert agreements(labels, [True, False, False], [np.ones(2)] * 3) == [1.0, 0.0, 0.0]


def test_area_of_a_polygon_is_that_of_its_triangles(scene):
    obj = mesh_object([(0, 0, 0), (2, 0, 0), (2, 3, 0), (0, 3, 0), (0, 0, 4)], [(0, 1, 2, 3), (0, 1, 4)])
    (pose,) = reader.read_objects(bpy.context, [Character((obj,))])
    assert polygon_areas(pose, 2) == pytest.approx([6, 4])


def test_demo_of_a_small_character(settings, tmp_path, needs_rendering):
    character = Character((limbed_rigged(),))
    shares = []
    run = Run(Report([]), Progress(lambda stage, share: shares.append(share)))
    result = Demo(character, tmp_path / "walk.1", 2, 2).run(bpy.context, settings, run)
    assert [pose["learned"] for pose in result["poses"]] == [True, False, False, True]
    assert result["agreement"] > 0.9
    assert result["agreement"] == pytest.approx(np.mean([pose["agreement"] for pose in result["poses"][1:3]]), abs=1e-3)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["walk.1.blend", "walk.1.json", "walk.1.png"]
    assert (np.diff(shares) > -1e-9).all(), "it falls by more than rounding"
    assert 0 <= shares[0] < shares[-1] <= 1


def test_demo_needs_enough_frames(settings, tmp_path):
    character = Character((limbed_rigged(bends=((1, 0.0), (3, 0.5))),))
    with pytest.raises(UserError, match="needs 8 poses, but the animation has only"):
        Demo(character, tmp_path / "walk", 4, 4).run(bpy.context, settings, Run(Report([])))
