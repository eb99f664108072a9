import numpy as np
import pytest
from shapes import grid, icosphere

from wks_segment.core import TriangleMesh

TRIANGLE = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]


def test_areas_of_a_rectangle():
    mesh = grid(4, 3, width=2.0, height=1.5)
    assert mesh.area == pytest.approx(3.0)
    assert mesh.vertex_areas.sum() == pytest.approx(3.0)


def test_area_of_the_sphere():
    assert icosphere(4).area == pytest.approx(4 * np.pi, rel=0.005)


@pytest.mark.parametrize(
    ("vertices", "faces", "message"),
    [
        ([(0, 0), (1, 0), (0, 1)], [(0, 1, 2)], r"vertices must have the shape \(n, 3\), not \(3, 2\)"),
        (TRIANGLE, [(0, 1, 2, 0)], r"faces must have the shape \(m, 3\), not \(1, 4\)"),
        (TRIANGLE, [(0, 1, 3)], r"face 0 uses a vertex that does not exist: \[0, 1, 3\]"),
        (TRIANGLE, [(0, 1, 2), (0, -1, 2)], r"face 1 uses a vertex that does not exist"),
        (TRIANGLE, [(0, 1, 2), (1, 1, 2)], r"face 1 uses a vertex twice: \[1, 1, 2\]"),
        (TRIANGLE, np.empty((0, 3), int), "no faces"),
        (TRIANGLE, [(0.0, 1.0, 2.0)], "faces must be integers"),
        ([(0, 0, 0), (1, np.nan, 0), (0, 1, 0)], [(0, 1, 2)], "vertex 1 has a coordinate that is not finite"),
        ([(0, 0, 0), (1, 0, 0), (0, np.inf, 0)], [(0, 1, 2)], "vertex 2 has a coordinate that is not finite"),
        ([(0, 0, 0), (1, 0, 0), (2, 0, 0)], [(0, 1, 2)], "the mesh has no area"),
    ],
)
def test_the_error_names_the_defect_and_where_it_is(vertices, faces, message):
    with pytest.raises(ValueError, match=message):
        TriangleMesh(vertices, faces)


def test_the_mesh_has_read_only_copies_of_its_arrays():
    vertices = np.array(TRIANGLE, dtype=float)
    mesh = TriangleMesh(vertices, [(0, 1, 2)])
    vertices[0] = 9
    assert mesh.vertices[0].tolist() == [0, 0, 0]
    with pytest.raises(ValueError, match="read-only"):
        mesh.vertices[0] = 9
