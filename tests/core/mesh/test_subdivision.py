"""Subdivision leaves no edge that is too long, and keeps the surface and its borders."""

import numpy as np
import pytest
from shapes import creature, grid, icosphere

from wks_segment.core import TriangleMesh
from wks_segment.core.mesh.subdivision import split_long_edges
from wks_segment.core.mesh.triangle_mesh import unique_edges


@pytest.mark.parametrize("mesh", [creature(0.3, 3), grid(3, 2, 5.0), icosphere(2)], ids=["creature", "grid", "sphere"])
@pytest.mark.parametrize("share", [0.2, 0.5, 0.9, 2.0])
def test_edges_are_short_enough_and_the_surface_is_the_same(mesh, share):
    edges, _, count = unique_edges(mesh.faces)
    lengths = np.linalg.norm(mesh.vertices[edges[:, 0]] - mesh.vertices[edges[:, 1]], axis=1)
    longest = share * lengths.max()
    vertices, faces, parent = split_long_edges(mesh.vertices, mesh.faces, longest, 1_000_000)
    finer = TriangleMesh(vertices, faces)
    np.testing.assert_array_equal(vertices[: mesh.n_vertices], mesh.vertices)
    np.testing.assert_allclose(np.bincount(parent, weights=finer.face_areas), mesh.face_areas, rtol=1e-9)
    new_edges, _, new_count = unique_edges(faces)
    new_lengths = np.linalg.norm(vertices[new_edges[:, 0]] - vertices[new_edges[:, 1]], axis=1)
    assert new_lengths.max() <= longest
    # The borders are as long as before: no vertex lies on an edge of a neighbor.
    assert new_lengths[new_count == 1].sum() == pytest.approx(lengths[count == 1].sum())
    assert (new_count <= 2).all()
    assert len(np.unique(faces)) == len(vertices)


def test_subdivision_stops_before_there_are_too_many_vertices():
    mesh = icosphere(2)
    vertices, faces, _ = split_long_edges(mesh.vertices, mesh.faces, 1e-6, 5000)
    assert mesh.n_vertices < len(vertices) <= 5000
    assert len(np.unique(faces)) == len(vertices)
