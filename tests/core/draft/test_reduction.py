"""Cells of a mesh: connected, about as many as asked for, the same in all poses."""

import numpy as np
from shapes import creature, grid, split_at_every_corner, together

from wks_segment.core import TriangleMesh, connect
from wks_segment.core.draft.reduction import Reduction
from wks_segment.core.mesh.triangle_mesh import islands_of_vertices

MESH = creature(subdivisions=4)


def reduction_of(mesh, n_cells):
    return Reduction.of(mesh, connect(mesh), n_cells)


def test_cells_are_as_many_as_asked_for_and_one_surface():
    reduction = reduction_of(MESH, 300)
    small = reduction.reduced(MESH)
    assert 200 < small.n_vertices < 600
    assert small.n_vertices == reduction.cell.max() + 1
    assert 0.8 < small.area / MESH.area < 1.05
    assert (islands_of_vertices(small.faces, small.n_vertices) == 0).all()


def test_cells_follow_the_pose():
    other = creature(0.5, subdivisions=4)
    reduction = reduction_of(MESH, 300)
    first, second = reduction.reduced(MESH), reduction.reduced(other)
    np.testing.assert_array_equal(first.faces, second.faces)
    for mesh, small in ((MESH, first), (other, second)):
        away = np.linalg.norm(small.vertices[reduction.cell] - mesh.vertices, axis=1)
        assert away.max() < 4 * np.sqrt(mesh.area / small.n_vertices)


def test_a_small_mesh_keeps_its_vertices():
    mesh = creature(subdivisions=2)
    reduction = reduction_of(mesh, 1000)
    small = reduction.reduced(mesh)
    assert small.n_vertices == mesh.n_vertices
    labels = np.arange(mesh.n_vertices)
    found = reduction.to_faces(labels[np.argsort(np.argsort(reduction.cell))], mesh)
    assert all(label in mesh.faces[i] for i, label in enumerate(found))


def test_split_vertices_are_in_one_cell():
    whole = reduction_of(MESH, 300)
    soup = split_at_every_corner(MESH)
    split = reduction_of(soup, 300)
    assert split.cell.max() == whole.cell.max()
    np.testing.assert_allclose(split.reduced(soup).area, whole.reduced(MESH).area, rtol=1e-3)


def test_labels_come_back_to_all_faces():
    mesh = together(
        MESH, TriangleMesh(grid(3, 3, 1e-9, 1e-9).vertices + 3, grid(3, 3).faces)
    )  # too small for a surface
    reduction = reduction_of(mesh, 300)
    assert (reduction.cell < 0).any()
    of_cells = (reduction.reduced(mesh).vertices[:, 0] > 0).astype(int)
    labels = reduction.to_faces(of_cells, mesh)
    assert labels.shape == (mesh.n_faces,)
    right = mesh.face_centers[:, 0] > 0
    assert np.average(labels == right, weights=mesh.face_areas) > 0.9
    assert labels[-1] in (0, 1)
