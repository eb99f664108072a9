"""Measures of labels against the bones of a rig, and of the borders between labels. Nothing here needs Blender.

All take labels and bones of faces as integers from 0 on. Meshes must be welded for what is about borders: faces with a
common edge have its two vertices in common.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.spatial import cKDTree

from wks_segment.core.mesh.triangle_mesh import FloatArray, IntArray, TriangleMesh, edges_of

NEAR_JOINT = 0.03
"""Largest distance of a border that lies at a joint, in units of the square root of the area: about half the thickness
of a forearm."""
SAMPLES = 10
"""Points on a border within `NEAR_JOINT`: its length is measured to a tenth of that."""
MIRRORED = 1e-4
"""Largest distance of a mirrored vertex from its counterpart, as a fraction of the size: files keep less than that."""
FACING = 0.001
"""Weight of the direction of a face beside its place, as a fraction of the size: it only decides between faces at one
place."""


def bones_whole(labels: IntArray, bones: IntArray, areas: FloatArray) -> float:
    """Share of the area that has the commonest label of its bone: 1 if no bone is cut."""
    return float(_common_areas(labels, bones, areas).max(axis=0).sum() / areas.sum())


def segments_pure(labels: IntArray, bones: IntArray, areas: FloatArray) -> float:
    """Share of the area that belongs to the largest bone of its segment, relative to the most that is possible.

    K segments could have the K largest bones, each one of them; all bones if there are not more than K.
    """
    common = _common_areas(labels, bones, areas)
    of_bones = np.sort(common.sum(axis=0))[::-1]
    n_used = int((common.sum(axis=1) > 0).sum())
    return float(common.max(axis=1).sum() / of_bones[:n_used].sum())


def border_at_joints(mesh: TriangleMesh, labels: IntArray, bones: IntArray) -> float:
    """Share of the length of borders between labels that is near a border between bones; NaN without a border."""
    near = NEAR_JOINT * np.sqrt(mesh.area)
    ours, lengths = _sampled(mesh.vertices, border_edges(mesh.faces, labels), near / SAMPLES)
    joints, _ = _sampled(mesh.vertices, border_edges(mesh.faces, bones), near / SAMPLES)
    if not len(ours):
        return float("nan")
    if not len(joints):
        return 0.0
    distances = cKDTree(joints).query(ours, distance_upper_bound=near)[0]
    return float(np.average(distances <= near, weights=lengths))


def turning(mesh: TriangleMesh, labels: IntArray) -> float:
    """Mean angle in degrees by which borders between labels turn at a vertex; NaN without a border.

    At the vertices where exactly two edges of borders meet: neither at ends, nor where three labels meet.
    """
    vertices, edges = mesh.vertices, border_edges(mesh.faces, labels)
    degree = np.bincount(edges.ravel(), minlength=len(vertices))
    ends = np.concatenate([edges, edges[:, ::-1]])
    ends = ends[degree[ends[:, 0]] == 2]
    if not len(ends):
        return float("nan")
    ends = ends[np.argsort(ends[:, 0], kind="stable")]
    along = vertices[ends[:, 1]] - vertices[ends[:, 0]]
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), np.finfo(float).tiny)
    cosines = np.einsum("ij,ij->i", -along[::2], along[1::2])
    return float(np.degrees(np.arccos(np.clip(cosines, -1, 1))).mean())


def border_edges(faces: IntArray, labels: IntArray) -> IntArray:
    """(b, 2) edges, as pairs of vertices, between faces with different labels; each edge once."""
    edges = edges_of(faces)
    order = np.lexsort((edges[:, 1], edges[:, 0]))
    edges, of_edges = edges[order], labels[order // 3]
    differ = (edges[1:] == edges[:-1]).all(axis=1) & (of_edges[1:] != of_edges[:-1])
    return np.unique(edges[1:][differ], axis=0)


def mirror_images(mesh: TriangleMesh, axis: int) -> IntArray | None:
    """(m,) the face that each face is mirrored to, in the plane through the center across an axis.

    None if a vertex has no mirror image, or each face is its own. Squares may be cut another way on the other side:
    then the mirror image is the face of its size whose center is nearest to where it should be. Of two at one place, as
    of thin cloth, it is the one that faces the right way.
    """
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(float).tiny)
    points = mesh.vertices[np.unique(mesh.faces)]
    low, high = points.min(axis=0), points.max(axis=0)
    size = (high - low).max()
    flip = np.where(np.arange(3) == axis, -1, 1)
    points, centers = ((p - (low + high) / 2) / size for p in (points, mesh.face_centers))
    if (cKDTree(points).query(points * flip)[0] > MIRRORED).any():
        return None
    # Half of a large square is not mirrored to a small face beside its image.
    faces = np.concatenate([centers, FACING * normals, np.sqrt(mesh.face_areas)[:, None] / size], axis=1)
    images = cKDTree(faces).query(faces * np.append(np.tile(flip, 2), 1))[1]
    return None if (images == np.arange(len(images))).all() else np.asarray(images)


def sides_differ(mesh: TriangleMesh, labels: IntArray, bones: IntArray) -> float:
    """Share of the area whose label differs from that of its mirror image; NaN unless the mesh is symmetric.

    Of several planes, the one that mirrors most bones to themselves or their counterparts tells left from right.
    """
    images = [found for axis in range(3) if (found := mirror_images(mesh, axis)) is not None]
    if not images:
        return float("nan")
    best = max(images, key=lambda image: float(mesh.face_areas @ (bones == bones[image])))
    return float(np.average(labels != labels[best], weights=mesh.face_areas))


def _common_areas(labels: IntArray, bones: IntArray, areas: FloatArray) -> FloatArray:
    """(labels, bones) area that each label and each bone have in common."""
    return np.asarray(coo_matrix((areas, (labels, bones))).toarray())


def _sampled(vertices: FloatArray, edges: IntArray, spacing: float) -> tuple[FloatArray, FloatArray]:
    """Points along edges, at most a spacing apart, and the length that each stands for."""
    begin, end = vertices[edges[:, 0]], vertices[edges[:, 1]]
    lengths = np.linalg.norm(end - begin, axis=1)
    counts = np.maximum(np.ceil(lengths / spacing), 1).astype(int)
    edge = np.repeat(np.arange(len(edges)), counts)
    number = np.arange(len(edge)) - np.repeat(np.cumsum(counts) - counts, counts)
    share = ((number + 0.5) / counts[edge])[:, None]
    return begin[edge] * (1 - share) + end[edge] * share, (lengths / counts)[edge]
