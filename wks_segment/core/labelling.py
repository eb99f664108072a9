"""From posteriors at vertices to clean labels of faces or polygons: smooth borders along creases, no crumbs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix, diags
from threadpoolctl import threadpool_limits

from .cut import CREASE, WIDTH, crease_weights, cut_borders
from .mesh import BoolArray, FloatArray, IntArray
from .regions import FaceAdjacency, merge_crumbs
from .smoothing import HeatFlow
from .surface import Surface, indicator

MARKED = 0.1
"""What a border at a marked edge costs, as a share of what it would."""


@threadpool_limits.wrap(limits=1, user_api="blas")  # on arrays this small, threads wait for each other
def clean_labels(
    surfaces: Sequence[Surface],
    posteriors_on: Callable[[int], FloatArray],
    polygons: Sequence[IntArray] | None,
    length: float,
    least_share: float,
    progress: Callable[[float], None] | None = None,
    marked: IntArray | None = None,
    crease: float = CREASE,
    width: float = WIDTH,
) -> tuple[IntArray, FaceAdjacency]:
    """Label the polygons of a mesh from the mean posterior of all poses.

    Parameters
    ----------
    surfaces
        Of the poses.
    posteriors_on
        (n', K) posteriors at the vertices of the i-th surface; asked for one after the other.
    polygons
        For each pose, the polygon of each triangle, -1 for none; None: each triangle is one.
    length : float
        Smoothing length in units of the square root of the area; 0: the likeliest label of each polygon.
    least_share : float
        Connected parts under this share of the area join a neighbour.
    progress
        Called after each pose with the share that is done, 0 to 1.
    marked : (q, 2) int array, optional
        Neighbouring polygons between which a border is welcome.
    crease, width : float
        How much creases draw borders, and over how many smoothing lengths; see `crease_weights`, `cut_borders`.

    Returns
    -------
    (p,) int array of labels, -1 for a polygon without a triangle, and the neighbours among polygons, with loose pieces
    tied to what adopted them.
    """
    if polygons is None:
        polygons = [np.arange(surface.original.n_faces) for surface in surfaces]
    n_polygons = 1 + max(int(polygon_of.max()) for polygon_of in polygons)
    posteriors: FloatArray = np.zeros(())
    areas, poses_seen = np.zeros(n_polygons), np.zeros(n_polygons)
    layouts = []
    for i, (surface, polygon_of) in enumerate(zip(surfaces, polygons, strict=True)):
        original = surface.original
        sum_over = indicator(np.where(polygon_of < 0, n_polygons, polygon_of), n_polygons + 1)[:n_polygons]
        # A triangle without area still speaks, if very softly, or its polygon would have no label.
        weight = original.face_areas / original.area + np.finfo(float).eps
        total = sum_over @ weight
        seen = total > 0
        mean = diags(1 / np.where(seen, total, 1)) @ sum_over @ diags(weight)
        of_vertices = posteriors_on(i)
        if length > 0:
            of_vertices = HeatFlow(surface.mesh, length).smooth(of_vertices)
        posteriors = posteriors + mean @ surface.to_faces(of_vertices)
        areas += total * seen
        poses_seen += seen
        layouts.append(_Layout.of(surface, polygon_of, mean, crease if length > 0 else None))
        if progress:
            progress((i + 1) / len(surfaces))
    # Of one mesh the borders are the same in every pose; modifiers may hide some of them in one.
    layout = max(layouts, key=lambda layout: len(layout.adjacency.pairs))
    others = sum(other.centres for other in layouts) / np.maximum(poses_seen, 1)[:, None]
    centres = np.where(layout.seen[:, None], layout.centres, others)
    areas /= np.maximum(poses_seen, 1)
    posteriors /= np.maximum(poses_seen, 1)[:, None]
    labels = np.where(poses_seen > 0, posteriors.argmax(axis=1), -1)
    adjacency = layout.adjacency
    if length > 0:
        weights = layout.weights
        if marked is not None:
            weights = np.where(adjacency.among(marked), MARKED * weights, weights)
        labels = cut_borders(posteriors, areas, centres, adjacency, weights, length, labels, width=width)
    return merge_crumbs(labels, areas, centres, adjacency, least_share)


@dataclass(frozen=True)
class _Layout:
    """Where the p polygons of a mesh lie in one pose, of area 1.

    Attributes
    ----------
    seen : (p,) bool array
        Whether any triangle is of the polygon.
    centres : (p, 3) array
        0 where not seen.
    adjacency : FaceAdjacency
        Of the polygons.
    weights : (b,) array
        What each border costs by its length, see `crease_weights`.
    """

    seen: BoolArray
    centres: FloatArray
    adjacency: FaceAdjacency
    weights: FloatArray

    @classmethod
    def of(cls, surface: Surface, polygon_of: IntArray, mean: csr_matrix, crease: float | None) -> _Layout:
        """Given the polygon of each triangle and the (p, m) mean of triangles over each polygon.

        Without `crease` every border counts the same.
        """
        original = surface.original
        unit = np.sqrt(original.area)
        adjacency = FaceAdjacency.of(surface.welded_faces, original.vertices / unit)
        across = adjacency.across(polygon_of)
        weights = np.ones(len(across)) if crease is None else crease_weights(surface, adjacency, crease)
        centres = np.asarray(mean @ (original.vertices[original.faces].mean(axis=1) / unit))
        seen = np.asarray(mean.sum(axis=1)).ravel() > 0
        return cls(seen, centres, adjacency.between_polygons(polygon_of), weights[across])
