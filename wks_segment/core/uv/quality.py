"""How good a UV map is: density, stretch and overlaps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..mesh.triangle_mesh import FloatArray, IntArray
from .charts import PolygonMesh, highest_of_each

EVEN = 4.0
"""A polygon has an even density if it is within this factor of the median of all."""
MOST_STRETCH = 100.0
"""A triangle that becomes a line counts as stretched by this."""
MOST_ODD = 0.01
"""Most polygons of a chart, as a share, that may have another density."""


@dataclass(frozen=True)
class UvQuality:
    """Figures of a UV map.

    Attributes
    ----------
    even : float
        Share of the polygons whose density is within 4 times of the median.
    stretch : float
        How much longer a small circle becomes in one direction than across, on average over the area; 1 for none.
    """

    even: float
    stretch: float

    @classmethod
    def of(cls, mesh: PolygonMesh, uvs: FloatArray) -> UvQuality:
        """Measure (c, 2) UVs."""
        is_even = np.abs(np.log(np.maximum(densities(mesh, uvs), 1e-30))) <= np.log(EVEN)
        ratios, areas = _stretches(mesh.triangle_places, uvs[mesh.triangles]), mesh.triangle_areas
        return cls(float(is_even.mean()), float(np.average(ratios, weights=areas)) if areas.any() else 1.0)


def densities(mesh: PolygonMesh, uvs: FloatArray, group: IntArray | None = None) -> FloatArray:
    """(p,) area in the map of each polygon by its area in space, relative to the median; 1 without an area in space.

    With the (p,) group of each polygon, as if groups were scaled so that all have the same area in the map as in space.
    """
    count = len(mesh.sizes)
    in_map = np.bincount(mesh.triangle_polygon, np.abs(_signed_areas(uvs[mesh.triangles])), minlength=count)
    areas = np.bincount(mesh.triangle_polygon, mesh.triangle_areas, minlength=count)
    if group is not None:
        in_map *= (np.bincount(group, areas) / np.maximum(np.bincount(group, in_map), 1e-30))[group]
    has_area = areas > 1e-9 * areas.mean()
    result = np.ones(count)
    if has_area.any():
        ratio = in_map[has_area] / areas[has_area]
        result[has_area] = ratio / max(float(np.median(ratio)), 1e-30)
    return result


def _stretches(places: FloatArray, uvs: FloatArray) -> FloatArray:
    """(t,) ratio of the axes of the ellipse that a circle in each of (t, 3, 3) triangles becomes in (t, 3, 2) UVs."""
    u, v = places[:, 1] - places[:, 0], places[:, 2] - places[:, 0]
    length = np.maximum(np.linalg.norm(u, axis=1), 1e-30)
    x = np.einsum("ij,ij->i", u, v) / length
    y = np.linalg.norm(np.cross(u, v), axis=1) / length
    along = (uvs[:, 1] - uvs[:, 0]) / length[:, None]
    across = (uvs[:, 2] - uvs[:, 0] - x[:, None] * along) / np.maximum(y, 1e-30)[:, None]
    axes = np.linalg.svd(np.stack([along, across], axis=2), compute_uv=False)
    return np.asarray(np.minimum(axes[:, 0] / np.maximum(axes[:, 1], 1e-30), MOST_STRETCH))


def _signed_areas(triangles: FloatArray) -> FloatArray:
    """(t,) areas of (t, 3, 2) triangles in the plane, negative if they are turned over."""
    (ux, uy), (vx, vy) = ((triangles[:, i] - triangles[:, 0]).T for i in (1, 2))
    return np.asarray((ux * vy - uy * vx) / 2)


def covered_pixels(triangles: FloatArray, size: int) -> tuple[IntArray, IntArray]:
    """Pixels of a square image whose centers are in triangles, and the triangle; a pixel occurs once for each triangle.

    Parameters
    ----------
    triangles : (t, 3, 2) array
        In units of the image. Each center on an edge between two triangles is in one of them.
    size : int
        Width of the image in pixels.
    """
    points = triangles * size - 0.5
    low = np.clip(np.ceil(points[:, :, 1].min(axis=1)), 0, size).astype(np.int64)
    high = np.clip(np.ceil(points[:, :, 1].max(axis=1)), 0, size).astype(np.int64)
    of, row = _ranges(low, high)
    left, right = np.full(len(of), np.inf), np.full(len(of), -np.inf)
    for i in range(3):
        ends = np.stack([points[:, i], points[:, i - 2]], axis=1)
        ends = np.take_along_axis(ends, np.argsort(ends[:, :, 1], axis=1, kind="stable")[:, :, None], axis=1)
        (ax, ay), (bx, by) = ends[of, 0].T, ends[of, 1].T
        is_crossed = (ay <= row) & (row < by)
        x = ax + (row - ay) / np.where(is_crossed, by - ay, 1.0) * (bx - ax)
        left = np.where(is_crossed, np.minimum(left, x), left)
        right = np.where(is_crossed, np.maximum(right, x), right)
    is_crossed = left < right
    of, row, left, right = of[is_crossed], row[is_crossed], left[is_crossed], right[is_crossed]
    span, column = _ranges(*(np.clip(np.ceil(x), 0, size).astype(np.int64) for x in (left, right)))
    return row[span] * size + column, of[span]


def _ranges(first: IntArray, end: IntArray) -> tuple[IntArray, IntArray]:
    """All integers from each first to before each end, and which of the ranges each is of."""
    counts = np.maximum(end - first, 0)
    of = np.repeat(np.arange(len(counts)), counts)
    return of, np.arange(len(of)) - np.repeat(np.cumsum(counts) - counts, counts) + first[of]


def overlaps(triangles: FloatArray, group: IntArray, size: int) -> IntArray:
    """(k, 2) pairs of triangles with the same (t,) group that cover the same pixel, one for each pixel."""
    pixel, triangle = covered_pixels(triangles, size)
    order = np.lexsort((group[triangle], pixel))
    pixel, triangle = pixel[order], triangle[order]
    same = np.flatnonzero((pixel[1:] == pixel[:-1]) & (group[triangle[1:]] == group[triangle[:-1]]))
    return np.stack([triangle[same], triangle[same + 1]], axis=1)


def faulty_pairs(mesh: PolygonMesh, uvs: FloatArray, chart: IntArray, size: int) -> IntArray:
    """(k, 2) two polygons of each chart that should not be in one: that lie on each other, or differ most in density.

    Parameters
    ----------
    mesh : PolygonMesh
    uvs : (c, 2) array
    chart : (p,) int array
        Chart of each polygon.
    size : int
        Overlaps below one pixel of a square image of this width do not count.
    """
    pairs = mesh.triangle_polygon[overlaps(uvs[mesh.triangles], chart[mesh.triangle_polygon], size)]
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    found = dict(zip(chart[pairs[:, 0]].tolist(), pairs.tolist(), strict=True))
    density = np.maximum(densities(mesh, uvs, chart), 1e-6)
    is_odd = np.abs(np.log(density)) > np.log(EVEN)
    shares = np.bincount(chart, is_odd) / np.bincount(chart)
    lowest, highest = (highest_of_each(chart, sign * density) for sign in (-1.0, 1.0))
    for i in np.flatnonzero(shares > MOST_ODD).tolist():
        found.setdefault(i, [int(lowest[i]), int(highest[i])])
    return np.array(list(found.values()), dtype=np.int64).reshape(-1, 2)
