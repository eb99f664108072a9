"""Measures of labels against bones, on grids whose result can be counted by hand."""

import numpy as np
import pytest

from benchmarks.part_measures import (
    bones_whole,
    border_at_joints,
    border_edges,
    mirror_images,
    segments_pure,
    sides_differ,
    turning,
)
from wks_segment.core import TriangleMesh


def grid(columns, rows=4):
    """A flat strip of squares of side 1, each cut into two triangles, and the column and row of each triangle."""
    x, y = np.meshgrid(np.arange(columns + 1.0), np.arange(rows + 1.0), indexing="ij")
    vertices = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    corner = np.arange(x.size).reshape(x.shape)
    a, b, c, d = corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]
    faces = np.stack([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)], axis=2).reshape(-1, 3)
    column, row = (np.repeat(n.ravel(), 2) for n in np.indices((columns, rows)))
    return TriangleMesh(vertices, faces), column, row


AREAS = np.ones(8)
BONES = np.array([0, 0, 0, 0, 1, 1, 2, 2])


def test_bones_are_whole_if_none_is_cut():
    assert bones_whole(BONES, BONES, AREAS) == 1
    assert bones_whole(np.zeros(8, dtype=int), BONES, AREAS) == 1
    assert bones_whole(np.array([0, 0, 0, 5, 1, 1, 2, 2]), BONES, AREAS) == pytest.approx(7 / 8)


def test_purity_is_relative_to_what_so_many_segments_could_have():
    assert segments_pure(BONES, BONES, AREAS) == 1
    # Two segments could have two bones, 6 of 8; the second has two bones, and so only one of them.
    assert segments_pure(np.array([0, 0, 0, 0, 1, 1, 1, 1]), BONES, AREAS) == 1
    assert segments_pure(np.array([0, 0, 3, 3, 3, 3, 3, 3]), BONES, AREAS) == pytest.approx(4 / 6)
    assert segments_pure(np.array([0, 1, 2, 3, 4, 4, 4, 5]), BONES, AREAS) == pytest.approx(7 / 8)


def test_purity_counts_area():
    areas = np.array([1.0, 3.0, 4.0])
    assert segments_pure(np.array([0, 0, 1]), np.array([0, 1, 2]), areas) == pytest.approx(7 / 7)
    assert segments_pure(np.array([0, 1, 1]), np.array([0, 1, 2]), areas) == pytest.approx(5 / 7)


def test_a_border_is_at_a_joint_or_not():
    mesh, column, row = grid(40)
    bones = (column >= 20).astype(int)
    assert border_at_joints(mesh, bones, bones) == 1
    # 3 % of the square root of 160 is 0.38.
    assert border_at_joints(mesh, (column >= 21).astype(int), bones) == 0
    # Along the middle: only the part next to the crossing is near.
    across = border_at_joints(mesh, (row >= 2).astype(int), bones)
    assert across == pytest.approx(2 * 0.03 * np.sqrt(160) / 40, abs=0.005)


def test_without_borders_there_is_no_number():
    mesh, column, _ = grid(4)
    bones = (column >= 2).astype(int)
    assert np.isnan(border_at_joints(mesh, np.zeros_like(bones), bones))
    assert np.isnan(turning(mesh, np.zeros_like(bones)))
    assert border_at_joints(mesh, bones, np.zeros_like(bones)) == 0


def test_straight_borders_do_not_turn_and_teeth_do():
    mesh, column, row = grid(8)
    assert turning(mesh, (column >= 4).astype(int)) == 0
    corner = ((column >= 4) & (row >= 2)).astype(int)
    n_inner = len(border_edges(mesh.faces, corner)) - 1
    assert turning(mesh, corner) == pytest.approx(90 / n_inner)
    diagonal = (column - row >= 2).astype(int)
    assert turning(mesh, diagonal) == pytest.approx(90)


def test_three_labels_meet_where_no_turning_is_counted():
    mesh, column, row = grid(8)
    labels = np.where(column >= 4, 2, np.where(row >= 2, 1, 0))
    assert turning(mesh, labels) == 0


def symmetric():
    """A strip that is its own mirror image across x: the squares of its right half are cut the other way."""
    mesh, column, _ = grid(4)
    left = mesh.faces[column < 2]
    mirrored = mesh.vertices * (-1, 1, 1) + (4, 0, 0)
    vertices = np.concatenate([mesh.vertices, mirrored])
    return TriangleMesh(vertices, np.concatenate([left, left[:, ::-1] + mesh.n_vertices]))


def test_mirror_images_of_faces():
    mesh = symmetric()
    numbers = np.arange(mesh.n_faces)
    np.testing.assert_array_equal(mirror_images(mesh, 0), np.roll(numbers, len(numbers) // 2))
    assert mirror_images(mesh, 2) is None, "each its own image"
    moved = mesh.vertices.copy()
    moved[mesh.faces[0, 0]] += (0.01, 0.0, 0.0)
    assert mirror_images(TriangleMesh(moved, mesh.faces), 0) is None


def test_squares_are_mirrored_however_they_are_cut():
    mesh, column, row = grid(4)
    images = mirror_images(mesh, 0)
    np.testing.assert_array_equal(column[images], 3 - column)
    np.testing.assert_array_equal(row[images], row)


def test_of_two_layers_the_one_that_faces_the_right_way_is_the_image():
    mesh = symmetric()
    both = TriangleMesh(mesh.vertices, np.concatenate([mesh.faces, mesh.faces[:, ::-1]]))
    layer = np.arange(both.n_faces) // mesh.n_faces
    np.testing.assert_array_equal(layer[mirror_images(both, 0)], layer)


def test_sides_differ_where_the_mirror_image_has_another_label():
    mesh, column, row = grid(4)
    labels, bones = np.zeros(mesh.n_faces, dtype=int), row  # bones are symmetric across x only
    assert sides_differ(mesh, labels, bones) == 0
    assert sides_differ(mesh, row, bones) == 0
    labels[(column == 0) & (row == 0)] = 1
    assert sides_differ(mesh, labels, bones) == pytest.approx(2 / 16)
    one = TriangleMesh(mesh.vertices + 0.1 * mesh.vertices**2, mesh.faces)
    assert np.isnan(sides_differ(one, labels, bones))
