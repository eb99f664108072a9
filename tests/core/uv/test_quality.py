"""Figures of UV maps whose values are known."""

import numpy as np
import pytest
from shapes import grid

from wks_segment.core.mesh.triangle_mesh import unique_edges
from wks_segment.core.uv.charts import PolygonMesh
from wks_segment.core.uv.quality import UvQuality, covered_pixels, faulty_pairs, overlaps


def flat(nx=10, ny=10):
    """A flat mesh, and its own places as UVs."""
    mesh = grid(nx, ny)
    edges, edge, _ = unique_edges(mesh.faces)
    made = PolygonMesh(
        mesh.vertices, len(edges), mesh.faces.ravel(), edge.ravel(), np.full(len(mesh.faces), 3),
        np.arange(mesh.faces.size).reshape(-1, 3),
    )  # fmt: skip
    flattened = mesh.vertices - mesh.vertices.min(axis=0)
    axes = np.argsort(-np.ptp(flattened, axis=0), kind="stable")[:2]
    return made, flattened[mesh.faces.ravel()][:, np.sort(axes)] / np.ptp(flattened)


def test_every_pixel_is_in_one_of_the_triangles_that_tile_the_image():
    made, uvs = flat()
    pixel, triangle = covered_pixels(uvs[made.triangles], 64)
    assert len(pixel) == len(np.unique(pixel)) == 64 * 64
    centers = (np.stack([pixel % 64, pixel // 64], axis=1) + 0.5) / 64
    corners = uvs[made.triangles][triangle]
    assert (centers >= corners.min(axis=1) - 1e-12).all()
    assert (centers <= corners.max(axis=1) + 1e-12).all()


def test_a_map_without_distortion():
    made, uvs = flat()
    quality = UvQuality.of(made, 0.3 * uvs + 0.1)
    assert quality.even == 1
    assert quality.stretch == pytest.approx(1, abs=1e-6)


def test_a_map_that_is_stretched_and_uneven():
    made, uvs = flat()
    assert UvQuality.of(made, uvs * [1.0, 0.5]).stretch == pytest.approx(2, rel=1e-6)
    squeezed = np.where(uvs < 0.3, uvs * 0.1, uvs)
    assert 0.5 < UvQuality.of(made, squeezed).even < 1


def test_polygons_that_lie_on_each_other_are_found_within_a_chart_only():
    made, uvs = flat()
    folded = np.stack([np.abs(uvs[:, 0] - 0.5), uvs[:, 1]], axis=1)
    one = np.zeros(len(made.sizes), dtype=int)
    assert not len(overlaps(uvs[made.triangles], one, 256))
    assert len(overlaps(folded[made.triangles], one, 256)) > 10_000
    pair = faulty_pairs(made, folded, one, 256)
    centers = uvs[made.triangles].mean(axis=1)[pair[0]]
    assert (centers[0, 0] - 0.5) * (centers[1, 0] - 0.5) < 0
    halves = (uvs[made.triangles].mean(axis=1)[:, 0] > 0.5).astype(int)
    assert not len(faulty_pairs(made, folded, halves, 256))


def test_a_chart_that_is_uneven_is_found_by_its_extremes():
    made, uvs = flat()
    uneven = np.stack([uvs[:, 0] ** 6, uvs[:, 1]], axis=1)
    pair = faulty_pairs(made, uneven, np.zeros(len(made.sizes), dtype=int), 256)
    x = uvs[made.triangles].mean(axis=1)[pair[0], 0]
    assert x[0] < 0.2
    assert x[1] > 0.8


def test_a_surface_without_area_has_figures():
    made, uvs = flat()
    point = PolygonMesh(
        0 * made.vertices, made.n_edges, made.corner_vertex, made.corner_edge, made.sizes, made.triangles
    )
    assert UvQuality.of(point, uvs) == UvQuality(1.0, 1.0)
