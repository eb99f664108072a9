"""Cuts that open charts: tubes along the inner side, limbs to their tips, handles, holes; and any mesh."""

import numpy as np
import pytest
from defects import any_mesh
from hypothesis import given
from shapes import creature, figure, grid, icosphere
from tally import count

from wks_segment.core import TriangleMesh
from wks_segment.core.mesh.triangle_mesh import unique_edges
from wks_segment.core.uv.charts import Charts, PolygonMesh
from wks_segment.core.uv.cuts import HiddenSide, cut_open, split

SIDE = HiddenSide(np.array([0.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))


def polygons(mesh):
    edges, edge, _ = unique_edges(mesh.faces)
    corners = np.arange(mesh.faces.size).reshape(-1, 3)
    made = PolygonMesh(
        mesh.vertices, len(edges), mesh.faces.ravel(), edge.ravel(), np.full(len(mesh.faces), 3), corners
    )
    return made, edges


def opened(mesh, closed=None):
    """The cuts and the charts that they leave."""
    made, edges = polygons(mesh)
    closed = np.zeros(len(edges), dtype=bool) if closed is None else closed
    cuts = cut_open(made, closed, SIDE)
    return cuts, Charts(made, closed | cuts), edges


def tube(around=24, along=30, center=(3.0, 0.0, 0.0), radius=0.5, height=4.0):
    """An open tube that stands beside the middle of a body."""
    angle, level = np.meshgrid(np.arange(around) / around * 2 * np.pi, np.linspace(-0.5, 0.5, along) * height)
    places = np.stack([radius * np.cos(angle), radius * np.sin(angle), level], axis=2).reshape(-1, 3) + center
    i, j = (values.ravel() for values in np.meshgrid(np.arange(around), np.arange(along - 1)))
    a, b = i + around * j, (i + 1) % around + around * j
    return TriangleMesh(
        places, np.concatenate([np.stack([a, b, b + around], 1), np.stack([a, b + around, a + around], 1)])
    )


def torus(around=24, along=48):
    u, v = np.meshgrid(np.arange(around) / around * 2 * np.pi, np.arange(along) / along * 2 * np.pi)
    ring = 3 + np.cos(u)
    places = np.stack([ring * np.cos(v), ring * np.sin(v), np.sin(u)], axis=2).reshape(-1, 3)
    i, j = (values.ravel() for values in np.meshgrid(np.arange(around), np.arange(along)))
    at = lambda i, j: i % around + around * (j % along)  # noqa: E731
    a, b, c, d = at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)
    return TriangleMesh(places, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]))


def is_disk(charts):
    """Whether each chart has one boundary loop and no handle."""
    loops = len(np.unique(charts.rim)) and loops_of(charts)
    return loops == charts.n_charts and (charts.handles == 0).all()


def loops_of(charts):
    from wks_segment.core.mesh.triangle_mesh import connected_groups

    return len(np.unique(connected_groups(charts.rim, charts.n_nodes)[np.unique(charts.rim)]))


@pytest.mark.parametrize("turn", [0.0, 2.0])
def test_a_tube_is_cut_once_along_its_inner_side(turn):
    """Which is the side that is turned to the middle of the body."""
    mesh = tube(center=(3.0 * np.cos(turn), 3.0 * np.sin(turn), 0.0))
    cuts, charts, edges = opened(mesh)
    assert (charts.n_charts, is_disk(charts), cuts.sum()) == (1, True, 29)
    inner = -np.array([np.cos(turn), np.sin(turn), 0.0])
    middles = mesh.vertices[edges[cuts]].mean(axis=1) + 3 * inner
    assert (middles @ inner > 0.4).all()


def test_a_tube_that_the_artist_has_cut_needs_no_other_cut():
    mesh = tube()
    _, edges = polygons(mesh)
    theirs = (edges % 24 == 0).all(axis=1)  # on the outer side
    assert theirs.sum() == 29
    assert not opened(mesh, theirs)[0].any()


def test_a_body_that_is_inside_out_is_cut_on_its_inner_side_too():
    mesh = tube()
    cuts = opened(TriangleMesh(mesh.vertices, mesh.faces[:, ::-1]))[0]
    assert cuts.sum() == 29
    cut_vertices = np.unique(polygons(mesh)[1][cuts])
    assert (mesh.vertices[cut_vertices, 0] < 2.6).all()


def test_a_limb_is_cut_from_its_border_to_its_tip():
    """It is a disk before, but laid flat as it is, its tip would be a point."""
    mesh = creature(0.0, 4)
    height = mesh.vertices[mesh.faces].mean(axis=1)
    limb = np.linalg.norm(height, axis=1) > 1.15
    assert limb.any()
    part = TriangleMesh(mesh.vertices, mesh.faces[limb])
    cuts, charts, edges = opened(part)
    assert is_disk(charts)
    reach = np.linalg.norm(mesh.vertices, axis=1)
    tip = reach[np.unique(part.faces)].max()
    assert reach[np.unique(edges[cuts])].max() > 0.9 * tip


def test_a_flat_surface_and_a_hole_in_it_stay_as_they_are():
    mesh = grid(20, 20)
    assert not opened(mesh)[0].any()
    centers = mesh.vertices[mesh.faces].mean(axis=1)
    middle = centers.mean(axis=0)
    holed = TriangleMesh(mesh.vertices, mesh.faces[np.linalg.norm(centers - middle, axis=1) > 0.2])
    cuts, charts, _ = opened(holed)
    assert loops_of(charts) == 2
    assert not cuts.any()


@pytest.mark.parametrize("make", [lambda: icosphere(3), torus, lambda: creature(0.0, 3), lambda: figure(0.0, 0.0, 3)])
def test_closed_surfaces_become_disks(make):
    mesh = make() if isinstance(make(), TriangleMesh) else TriangleMesh(*make())
    cuts, charts, _ = opened(mesh)
    assert cuts.any()
    assert is_disk(charts)
    assert charts.n_charts == 1


def test_a_chart_is_split_between_two_of_its_polygons():
    mesh = tube()
    made, edges = polygons(mesh)
    nothing = np.zeros(len(edges), dtype=bool)
    cuts = split(made, nothing, np.array([[0, len(mesh.faces) - 1]]))
    chart = Charts(made, cuts).polygon_chart
    assert chart.max() == 1
    assert chart[0] != chart[-1]


@given(any_mesh())
def test_any_mesh_is_cut_into_charts_without_handles(drawn):
    vertices, faces, names = drawn
    try:
        mesh = TriangleMesh(vertices, faces)
    except ValueError:
        count("mesh, cut open", names, "refused")
        return
    charts = opened(mesh)[1]
    assert (charts.handles <= 0).all()
    count("mesh, cut open", names, "cut")
