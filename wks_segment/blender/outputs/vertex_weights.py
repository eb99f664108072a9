"""Weights of vertices in segments and parts, as vertex groups hold them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ... import core
from ...core.mesh.triangle_mesh import BoolArray, FloatArray, IntArray
from ...core.progress import Progress
from ..parts import part_ids
from ..scene.attributes import read_floats
from ..scene.mesh_arrays import Body
from ..scene.poses import Pose
from ..scene.topology import corners_of

LEAST_WEIGHT = 0.01
"""Soft weights below this are left out: posteriors are nowhere exactly 0, so nearly every vertex would be in every
group."""


def hard_weights(mesh: bpy.types.Mesh, labels: IntArray) -> dict[int, FloatArray]:
    """(n,) weights of the vertices in each of the (p,) parts of polygons: 1 at corners of its polygons, else 0."""
    vertices, polygons = corners_of(mesh)
    label_of_corner = labels[polygons]
    weights = {part: np.zeros(len(mesh.vertices)) for part in part_ids.unique_parts(labels)}
    for part, in_part in weights.items():
        in_part[vertices[label_of_corner == part]] = 1.0
    return weights


def soft_weights(
    model: core.PoseSegmentation,
    poses: Sequence[Pose],
    described: Sequence[core.Workpiece],
    body: Body,
    progress: Progress,
) -> FloatArray:
    """(n, n_segments) mean posterior, over poses of the same meshes, at each of the character's own vertices.

    Rows sum to 1; weights below `LEAST_WEIGHT` are left out. The vertices of all objects are numbered one object after
    another. A vertex that no pose shows (because it is masked out, say) takes the weights of the nearest one.
    """
    sums, times_seen = np.zeros(()), np.zeros(len(body.vertices), dtype=np.int64)
    pairs = list(zip(poses, described, strict=True))
    for (pose, workpiece), _ in progress.each(pairs):
        posterior, seen = at_own_vertices(pose, model.predict_soft(workpiece), body)
        sums, times_seen = sums + posterior, times_seen + seen
    weights = sums / np.maximum(times_seen, 1)[:, None]
    unseen = times_seen == 0
    if unseen.any():
        weights[unseen] = _of_nearest(weights[~unseen], body.vertices[~unseen], body.vertices[unseen])
    # The largest weight stays in any case: among very many segments, it can be small as well.
    weights[(weights < LEAST_WEIGHT) & (weights < weights.max(axis=1, keepdims=True))] = 0
    return np.asarray(weights / weights.sum(axis=1, keepdims=True))


def weights_of_parts(weights: FloatArray, labels: IntArray, body: Body) -> dict[int, FloatArray]:
    """(n,) weights of a character's own vertices in each part. Over the parts of a segment they sum to its weights.

    Parameters
    ----------
    weights : (n, n_segments) array
        Weights in segments.
    labels : (p,) int array
        Part of each of the character's polygons. The weight of a vertex in a segment goes to the segment's part whose
        polygons are nearest to the vertex.
    """
    result: dict[int, FloatArray] = {}
    for segment in np.flatnonzero(weights.any(axis=0)).tolist():
        in_segment = np.flatnonzero(part_ids.segments_of(labels) == segment)
        nearest, parts = _nearest_part(labels[in_segment], body.polygon_centers[in_segment], body.vertices, segment)
        result |= {part: np.where(nearest == part, weights[:, segment], 0.0) for part in parts}
    return result


def move_weights(
    mesh: bpy.types.Mesh, weights: Mapping[int, FloatArray], before: IntArray, after: IntArray
) -> dict[int, FloatArray]:  # fmt: skip
    """(n,) weights of the vertices in each part after the (p,) parts of polygons changed.

    The weight of a vertex in a part goes to what the nearest polygon of that part has become.
    """
    result: dict[int, FloatArray] = {}
    vertices, centers = read_floats(mesh.vertices, "co", 3), read_floats(mesh.polygons, "center", 3)
    for part, in_part in weights.items():
        polygons = np.flatnonzero(before == part)
        nearest, parts = _nearest_part(after[polygons], centers[polygons], vertices, part)
        for new in parts:
            result[new] = result.get(new, 0.0) + np.where(nearest == new, in_part, 0.0)
    return result


def at_own_vertices(pose: Pose, values: FloatArray, body: Body) -> tuple[FloatArray, BoolArray]:
    """(n, k) values at a character's own vertices, given (n', k) at those of a pose; and (n,) whether the pose has it.

    Where modifiers change faces, only polygons are known: a vertex gets the mean over the polygons around it, by area.
    Rows of vertices that are not seen are 0.
    """
    n_vertices = len(body.vertices)
    own, seen = np.zeros((n_vertices, values.shape[1])), np.zeros(n_vertices, dtype=bool)
    known = np.flatnonzero(pose.vertex_of >= 0)
    own[pose.vertex_of[known]] = values[known]
    seen[pose.vertex_of[known]] = True
    if seen.all():
        return own, seen
    import scipy

    from ...core.mesh.surface import indicator

    # 1 where a polygon has a corner at a vertex.
    around = scipy.sparse.csr_matrix(
        (np.ones(len(body.corners[0])), body.corners), shape=(n_vertices, len(body.polygon_centers))
    )
    of_polygon = indicator(pose.polygon_of, around.shape[1])
    # Polygons without area count as well, but hardly.
    areas = pose.mesh.face_areas / pose.mesh.area + np.finfo(float).eps
    sums = around @ (of_polygon @ (areas[:, None] * values[pose.mesh.faces].mean(axis=1)))
    totals = around @ (of_polygon @ areas)
    by_polygons = ~seen & (totals > 0)
    own[by_polygons] = sums[by_polygons] / totals[by_polygons, None]
    return own, seen | by_polygons


def _nearest_part(
    labels: IntArray, centers: NDArray[Any], vertices: NDArray[Any], default: int
) -> tuple[IntArray, list[int]]:  # fmt: skip
    """(n,) label of the polygon that is nearest to each vertex, and the labels that occur; the default without any."""
    parts = part_ids.unique_parts(labels) or [default]
    if len(parts) == 1:
        return np.full(len(vertices), parts[0]), parts
    return _of_nearest(labels, centers, vertices), parts


def _of_nearest(values: NDArray[Any], places: NDArray[Any], targets: NDArray[Any]) -> NDArray[Any]:
    """Value at the place that is nearest to each target."""
    import scipy

    return values[scipy.spatial.cKDTree(places).query(targets)[1]]
