import tracemalloc
from dataclasses import replace

import numpy as np
from shapes import creature, icosphere, together

from wks_segment.core import TriangleMesh, prepare_surface
from wks_segment.core.geometry.normalized_cuts import normalized_cut
from wks_segment.core.learning.merge_tree import PoseGeometry


def dumbbell(rings=60, around=40):
    """Two balls of radius 1, joined by a neck of radius 0.35."""
    x = -2 * np.cos(np.linspace(0, np.pi, rings + 2))[1:-1]
    radius = np.maximum(np.sqrt(np.maximum(1 - (np.abs(x) - 1) ** 2, 0)), np.where(np.abs(x) < 1, 0.35, 0))
    turn = np.linspace(0, 2 * np.pi, around, endpoint=False)
    y, z = np.outer(radius, np.cos(turn)), np.outer(radius, np.sin(turn))
    tube = np.stack([np.repeat(x, around), y.ravel(), z.ravel()])
    faces = []
    for i in range(rings - 1):
        a, b = i * around + np.arange(around), i * around + (np.arange(around) + 1) % around
        faces += [np.stack([a, b, b + around], axis=1), np.stack([a, b + around, a + around], axis=1)]
    first, last = np.arange(around), (rings - 1) * around + np.arange(around)
    poles = rings * around, rings * around + 1
    faces.append(np.stack([np.full(around, poles[0]), np.roll(first, -1), first], axis=1))
    faces.append(np.stack([np.full(around, poles[1]), last, np.roll(last, -1)], axis=1))
    return TriangleMesh(np.concatenate([tube.T, [(-2, 0, 0), (2, 0, 0)]]), np.concatenate(faces))


def test_patches_are_joined_except_across_a_crease():
    # Six squares in a row, with a crease between the third and the fourth.
    pairs = np.stack([np.arange(5), np.arange(1, 6)], axis=1)
    borders = 0.4 * np.array([1, 1, 0.01, 1, 1])
    areas = np.full(6, 1 / 6)
    np.testing.assert_array_equal(normalized_cut(np.arange(6), areas, pairs, borders, 0.1), [0, 0, 0, 1, 1, 1])
    assert normalized_cut(np.arange(6), areas, pairs, borders, 0.0).max() == 0
    assert normalized_cut(np.arange(6), areas, pairs, borders, 100.0).max() == 5


def test_thousands_of_islands_need_no_table_of_all_pairs():
    # Islands of two patches: a table of all pairs would take 128 MB.
    n = 2_000
    pairs = np.arange(2 * n).reshape(n, 2)
    borders = np.where(np.arange(n) % 2, 0.01, 0.0)
    tracemalloc.start()
    found = normalized_cut(np.arange(2 * n), np.full(2 * n, 1 / (2 * n)), pairs, borders, 10.0)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 12.5e6
    together_ = found[pairs[:, 0]] == found[pairs[:, 1]]
    np.testing.assert_array_equal(together_, borders > 0)
    assert len(np.unique(found)) == 2 * n - np.count_nonzero(together_)


def test_a_dumbbell_has_two_parts_that_meet_at_its_neck():
    surface = prepare_surface(dumbbell())
    part = PoseGeometry.of(surface).cuts[1]
    x = surface.original.face_centers[:, 0]
    left, right = np.unique(part[x < -0.3]), np.unique(part[x > 0.3])
    assert len(left) == len(right) == 1
    assert left != right


def test_islands_are_different_parts():
    body, ball = creature(0.3, 4), icosphere(2)
    surface = prepare_surface(together(body, TriangleMesh(ball.vertices + 9, ball.faces)), pieces="separate")
    for part in PoseGeometry.of(surface).cuts:
        assert not set(part[: body.n_faces]) & set(part[body.n_faces :])


def test_labels_are_compared_with_parts_by_rand_index():
    geometry = PoseGeometry.of(prepare_surface(dumbbell()))
    shares = geometry.surface.original.face_areas / geometry.surface.original.area
    alone = replace(geometry, cuts=geometry.cuts[1:2])
    assert alone.rand_error(geometry.cuts[1]) < 1e-9
    # One label for all faces is wrong for each pair of faces in different parts.
    apart = np.mean([1 - np.square(np.bincount(part, shares)).sum() for part in geometry.cuts])
    np.testing.assert_allclose(geometry.rand_error(np.zeros(len(shares), dtype=int)), apart)
