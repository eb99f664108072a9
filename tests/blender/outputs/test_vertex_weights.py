"""Weights of vertices that a pose does not show one to one, because modifiers change or hide faces."""

from dataclasses import replace

import bpy
import numpy as np
import pytest
from builders import (
    limbed,
    mesh_object,
    numbers,
)
from group_checks import fitted, learned, ours, read, weights_of

from wks_segment.blender.outputs.vertex_weights import at_own_vertices, soft_weights
from wks_segment.blender.scene.mesh_arrays import Body
from wks_segment.core import TriangleMesh
from wks_segment.core.progress import Progress

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment


def modified(kind, **options):
    obj = limbed()
    modifier = obj.modifiers.new("Modifier", kind)
    for name, value in options.items():
        setattr(modifier, name, value)
    return obj


@pytest.mark.parametrize(
    ("kind", "options", "same"),
    [
        ("CAST", {"factor": 0.3}, True),
        ("SUBSURF", {"levels": 0}, True),
        ("SUBSURF", {"show_viewport": False}, True),
        ("SUBSURF", {"levels": 1}, False),
        ("MIRROR", {}, False),
        ("SOLIDIFY", {"thickness": 0.1}, False),
    ],
)
def test_a_pose_knows_the_own_vertices_if_faces_are_the_same(kind, options, same):
    pose = read(modified(kind, **options))
    assert pose.vertex_of.shape == (pose.mesh.n_vertices,)
    if same:
        np.testing.assert_array_equal(pose.vertex_of, np.arange(642))
    else:
        assert (pose.vertex_of == -1).all()


def test_corners_decide_whether_vertices_are_known_not_the_kind_of_modifier():
    """Triangulate changes nothing of triangles, but splits a quad."""
    pose = read(modified("TRIANGULATE"))
    np.testing.assert_array_equal(pose.vertex_of, np.arange(642))
    quads = mesh_object([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [(0, 1, 2, 3)])
    quads.modifiers.new("Triangulate", "TRIANGULATE")
    assert (read(quads).vertex_of == -1).all()


@pytest.mark.parametrize(
    ("kind", "options"),
    [
        ("SUBSURF", {"levels": 1}),
        ("MIRROR", {"use_axis": (False, True, False)}),
        ("SOLIDIFY", {"thickness": 0.05}),
        ("EDGE_SPLIT", {"split_angle": 0.2}),
    ],
)
def test_soft_weights_through_modifiers_that_make_faces(settings, kind, options):
    obj = modified(kind, **options)
    settings.n_segments = 2
    learned(settings, "soft", obj)
    weights = weights_of(obj)
    np.testing.assert_allclose(weights.sum(axis=1), 1, atol=1e-6)
    columns = np.array([int(name.split()[-1]) - 1 for name in ours(obj)])
    assert (columns[weights.argmax(axis=1)] == numbers(obj.data, "wks_segment_vertex")).mean() > 0.9


def test_weights_through_polygons_are_close_to_weights_through_vertices():
    model, pose = fitted(limbed())
    described = [model.describe(pose.mesh)]
    body = Body.of(pose.character)
    exact = soft_weights(model, [pose], described, body, Progress())
    over_polygons = soft_weights(model, [replace(pose, vertex_of=np.full(642, -1))], described, body, Progress())
    assert np.abs(exact - over_polygons).max() > 1e-3, "both are computed in the same way"
    assert np.abs(exact - over_polygons).mean() < 0.05
    assert (exact.argmax(axis=1) == over_polygons.argmax(axis=1)).mean() > 0.95


def test_vertex_gets_the_mean_over_its_polygons_by_area():
    """Two faces, one three times as large, with values 0 and 4 all around, meet in an edge."""
    obj = mesh_object([(0, 0, 0), (0, 1, 0), (-1, 0, 0), (3, 0, 0), (9, 9, 9)], [(0, 1, 2), (0, 3, 1)])
    pose = read(obj)
    split = TriangleMesh(pose.mesh.vertices[pose.mesh.faces.ravel()], np.arange(6).reshape(2, 3))
    apart = replace(pose, mesh=split, vertex_of=np.full(6, -1))
    values = np.repeat(np.where(pose.polygon_of == 0, 0.0, 4.0), 3)[:, None]
    own, seen = at_own_vertices(apart, values, Body.of(pose.character))
    np.testing.assert_allclose(own[:, 0], [3, 3, 0, 4, 0])
    np.testing.assert_array_equal(seen, [True, True, True, True, False])


def test_masked_vertices_take_the_weights_of_the_nearest_ones(settings):
    obj = limbed()
    high = [vertex.index for vertex in obj.data.vertices if vertex.co.x > 1.5]
    group = obj.vertex_groups.new(name="Hidden")
    group.add(high, 1.0, "REPLACE")
    mask = obj.modifiers.new("Mask", "MASK")
    mask.vertex_group, mask.invert_vertex_group = "Hidden", True
    assert read(obj).mesh.n_vertices < len(obj.data.vertices)
    learned(settings, "soft", obj)
    weights = weights_of(obj)
    np.testing.assert_allclose(weights.sum(axis=1), 1, atol=1e-6)
    seen = np.setdiff1d(np.arange(len(weights)), high)
    points = np.array([vertex.co for vertex in obj.data.vertices])
    tip = high[np.argmax(points[high, 0])]
    nearest = seen[np.linalg.norm(points[seen] - points[tip], axis=1).argmin()]
    # The ring at the cut is seen through the faces that are left, and may be nearer.
    assert np.abs(weights[tip] - weights[nearest]).sum() < 0.5


def test_a_vertex_without_faces_has_soft_weights(settings):
    obj = limbed()
    obj.data.vertices.add(1)
    obj.data.vertices[-1].co = (5, 0, 1)
    obj.data.update()
    learned(settings, "soft", obj)
    np.testing.assert_allclose(weights_of(obj).sum(axis=1), 1, atol=1e-6)
    learned(settings, "hard", obj)
    assert weights_of(obj)[-1].sum() == 0
