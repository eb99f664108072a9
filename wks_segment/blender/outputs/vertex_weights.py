"""How much each vertex belongs to each segment: what the vertex groups hold."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import bpy
import numpy as np
from scipy.sparse import csr_matrix
from scipy.spatial import cKDTree

from ...core import PoseSegmentation, Workpiece
from ...core.mesh.surface import indicator
from ...core.mesh.triangle_mesh import BoolArray, FloatArray, IntArray
from ..parts import part_ids
from ..scene.mesh_arrays import Body
from ..scene.poses import Pose
from ..scene.topology import corners_of

LEAST = 0.01
"""Smaller soft weights are left out: nearly every vertex would be in every group."""


def hard_weights(mesh: bpy.types.Mesh, labels: IntArray) -> dict[int, FloatArray]:
    """For each part (n,) 1 where a vertex is a corner of a polygon of it, else 0; given the (p,) parts of polygons."""
    vertices, polygons = corners_of(mesh)
    of_corner = labels[polygons]
    weights = {part: np.zeros(len(mesh.vertices)) for part in part_ids.unique_parts(labels)}
    for part, of_part in weights.items():
        of_part[vertices[of_corner == part]] = 1.0
    return weights


def soft_weights(
    model: PoseSegmentation, poses: Sequence[Pose], described: Sequence[Workpiece], body: Body,
    tick: Callable[[float], None] | None = None,
) -> FloatArray:  # fmt: skip
    """(n, n_segments) mean posterior, over poses of the same meshes, at each of the character's own vertices.

    Rows sum to 1; weights below `LEAST` are left out. The vertices of all objects are numbered one object after
    another. One that no pose shows (masked out, say) takes the weights of the nearest one. `tick` is called with the
    share that is done.
    """
    sums, times_seen = np.zeros(()), np.zeros(len(body.vertices), dtype=np.int64)
    for i, (pose, of_pose) in enumerate(zip(poses, described, strict=True)):
        if tick:
            tick(i / len(poses))
        own, seen = own_vertices(pose, model.predict_soft(of_pose), body)
        sums, times_seen = sums + own, times_seen + seen
    weights = sums / np.maximum(times_seen, 1)[:, None]
    unseen = times_seen == 0
    if unseen.any():
        places = body.vertices
        weights[unseen] = weights[~unseen][cKDTree(places[~unseen]).query(places[unseen])[1]]
    # Among very many segments, the largest can be small too.
    weights[(weights < LEAST) & (weights < weights.max(axis=1, keepdims=True))] = 0
    return np.asarray(weights / weights.sum(axis=1, keepdims=True))


def by_parts(weights: FloatArray, labels: IntArray, body: Body) -> dict[int, FloatArray]:
    """Weights of parts at each of a character's n own vertices, whose sum over a segment's parts is the segment's.

    Parameters
    ----------
    weights : (n, n_segments) array
        Of segments.
    labels : (p,) int array
        Part of each of the character's polygons. A vertex has the weights of the nearest part of each segment.
    """
    vertices, polygons = body.vertices, body.polygons
    result: dict[int, FloatArray] = {}
    for segment in np.flatnonzero(weights.any(axis=0)).tolist():
        mine = np.flatnonzero(part_ids.segments_of(labels) == segment)
        found = part_ids.unique_parts(labels[mine]) or [segment]
        nearest = np.full(len(vertices), found[0])
        if len(found) > 1:
            nearest = labels[mine[cKDTree(polygons[mine]).query(vertices)[1]]]
        result |= {part: np.where(nearest == part, weights[:, segment], 0.0) for part in found}
    return result


def own_vertices(pose: Pose, values: FloatArray, body: Body) -> tuple[FloatArray, BoolArray]:
    """Carry (n', k) values at the vertices of a pose to the (n, k) own ones of its character, and which are seen.

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
    # 1 where a polygon has a corner at a vertex.
    around = csr_matrix((np.ones(len(body.corners[0])), body.corners), shape=(n_vertices, len(body.polygons)))
    of_polygon = indicator(pose.polygon_of, around.shape[1])
    # A polygon without area still speaks, if very softly.
    areas = pose.mesh.face_areas / pose.mesh.area + np.finfo(float).eps
    sums = around @ (of_polygon @ (areas[:, None] * values[pose.mesh.faces].mean(axis=1)))
    totals = around @ (of_polygon @ areas)
    by_polygons = ~seen & (totals > 0)
    own[by_polygons] = sums[by_polygons] / totals[by_polygons, None]
    return own, seen | by_polygons
