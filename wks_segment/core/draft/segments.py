"""A draft: provisional segments of poses within about a second, to look at while the real ones are computed.

Each mesh is reduced to a thousand cells, the same in all of its poses, and a model of few eigenpairs is learned from
these. On five poses of a synthetic body, a horse and an elephant (8,431 to 42,321 vertices) the draft has an adjusted
Rand index of 0.72, 0.55 and 0.32 with the final segments: limbs, head and tail are found, borders lie elsewhere. More
cells, poses or eigenpairs come nearer on some of them, but not on all, and take up to twice as long.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np
from scipy.linalg import LinAlgError
from scipy.spatial import cKDTree

from ..mesh.surface import Connection, connect
from ..mesh.triangle_mesh import IntArray, TriangleMesh
from ..progress import Progress
from ..segmentation import PoseSegmentation
from ..spectral.eigenpairs import SpectrumError, SpectrumWarning
from .reduction import Reduction

PAIRS = 40
"""Eigenpairs; see the docstring of the module."""
LEARNED_POSES = 3
"""Most poses that a draft is learned from, evenly chosen: five take half as long again and come hardly nearer."""
SECONDS = 1.5
"""Seconds of a processor that a draft takes, about."""
REDUCED, DESCRIBED, LEARNED = 0.15, 0.3, 0.95
"""Shares of the time of a draft after which meshes are reduced and described, and segments are learned."""


def draft(
    model: PoseSegmentation,
    meshes: Sequence[TriangleMesh],
    connections: Sequence[Connection],
    progress: Progress | None = None,
) -> list[IntArray] | None:
    """Provisional segments of poses; None if the meshes are too broken for it, or it finds no parts.

    Parameters
    ----------
    model : PoseSegmentation
        Gives the parameters; it stays as it is, fitted or not.
    meshes
    connections
        How each mesh is connected: the same object for all poses of one mesh, as `connect_alike` gives it.
    progress : Progress, optional

    Returns
    -------
    (m,) segment of each face, for each mesh.
    """
    progress = (progress or Progress()).titled("First colors")
    try:
        labels = _drafted(model, meshes, connections, progress)
    except (ValueError, SpectrumError, MemoryError, LinAlgError):
        return None
    # One color for everything tells nothing.
    return labels if any(len(np.unique(of_mesh)) > 1 for of_mesh in labels) else None


def _drafted(
    model: PoseSegmentation, meshes: Sequence[TriangleMesh], connections: Sequence[Connection], progress: Progress
) -> list[IntArray]:
    """See `draft`; raises what the core raises."""
    first = [next(j for j, other in enumerate(connections) if other is one) for one in connections]
    reductions = {
        i: Reduction.of(meshes[i], connections[i]) for i, _ in progress.part(0.0, REDUCED).each(sorted(set(first)))
    }
    learned = np.unique(np.linspace(0, len(meshes) - 1, min(len(meshes), LEARNED_POSES)).round().astype(int)).tolist()
    # Of each mesh, at least one pose is labeled.
    learned_meshes = {first[i] for i in learned}
    needed = [*learned, *(i for i in reductions if i not in learned_meshes)]
    reduced = {i: reductions[first[i]].reduced(meshes[i]) for i in needed}
    poses_of = {mesh: [i for i in needed if first[i] == mesh] for mesh in reductions}
    connected = {mesh: connect(*(reduced[i] for i in poses), pieces=model.pieces) for mesh, poses in poses_of.items()}
    coarse = PoseSegmentation(**{**model.get_params(), "n_eigenpairs": PAIRS, "accuracy": "fast"})
    described = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SpectrumWarning)
        for i, step in progress.part(REDUCED, DESCRIBED).each(needed):
            described[i] = coarse.describe(reduced[i], connected[first[i]], step)
    coarse.fit([described[i] for i in learned], progress.part(DESCRIBED, LEARNED))
    of_cells = {}
    for mesh, poses in poses_of.items():
        triangles = np.arange(reduced[poses[0]].n_faces)
        faces = coarse.segment_polygons([described[i] for i in poses], [triangles] * len(poses))
        of_cells[mesh] = _labels_of_vertices(reduced[poses[0]], faces)
    progress(1.0)
    return [reductions[mesh].to_faces(of_cells[mesh], meshes[i]) for i, mesh in enumerate(first)]


def _labels_of_vertices(mesh: TriangleMesh, of_faces: IntArray) -> IntArray:
    """(n,) label with most area around each vertex; that of the nearest other vertex where there is no face."""
    table = np.zeros((mesh.n_vertices, int(of_faces.max()) + 1))
    np.add.at(table, (mesh.faces.ravel(), np.repeat(of_faces, 3)), np.repeat(mesh.face_areas, 3))
    labels = table.argmax(axis=1)
    has = np.zeros(mesh.n_vertices, dtype=bool)
    has[mesh.faces] = True
    if not has.all():
        nearest = cKDTree(mesh.vertices[has]).query(mesh.vertices[~has])[1]
        labels[~has] = labels[has][nearest]
    return np.asarray(labels)
