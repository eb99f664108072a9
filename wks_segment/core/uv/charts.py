"""Charts: the pieces of a surface that is cut along edges, before they are laid flat."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import coo_matrix, csc_matrix, diags

from ..mesh.triangle_mesh import BoolArray, FloatArray, IntArray, connected_groups

MOST_COTANGENT = 10.0
"""Bound of the cotangents of angles: needles and faces without area do not outweigh all others."""
LEAST_COTANGENT = 1e-2
"""Least weight between two nodes, so that scales of obtuse triangles have no oscillation."""


@dataclass(frozen=True, eq=False)
class PolygonMesh:
    """Polygons as arrays, with the triangles that they are drawn as.

    Attributes
    ----------
    vertices : (n, 3) array
    n_edges : int
    corner_vertex, corner_edge : (c,) int arrays
        Vertex of each corner, and the edge from it to the next corner of the polygon.
    sizes : (p,) int array
        Number of corners of each polygon; corners are ordered by polygon.
    triangles : (t, 3) int array
        Corners of each triangle.
    """

    vertices: FloatArray
    n_edges: int
    corner_vertex: IntArray
    corner_edge: IntArray
    sizes: IntArray
    triangles: IntArray

    @cached_property
    def polygon(self) -> IntArray:
        """(c,) polygon of each corner."""
        return np.repeat(np.arange(len(self.sizes)), self.sizes)

    @cached_property
    def next_corner(self) -> IntArray:
        """(c,) next corner of the same polygon."""
        following = np.arange(len(self.corner_vertex)) + 1
        ends = np.cumsum(self.sizes)
        following[ends - 1] = ends - self.sizes
        return following

    def part(self, shown: BoolArray) -> PolygonMesh:
        """These (p,) polygons alone, with all vertices and edges."""
        corners = shown[self.polygon]
        number = np.cumsum(corners) - 1
        triangles = number[self.triangles[shown[self.triangle_polygon]]]
        vertex, edge = self.corner_vertex[corners], self.corner_edge[corners]
        return PolygonMesh(self.vertices, self.n_edges, vertex, edge, self.sizes[shown], triangles)

    @property
    def middle(self) -> FloatArray:
        """(3,) center of the surface."""
        centers = self.triangle_places.mean(axis=1)
        return np.asarray(self.triangle_areas @ centers / max(float(self.triangle_areas.sum()), 1e-30))

    @cached_property
    def triangle_polygon(self) -> IntArray:
        """(t,) polygon of each triangle."""
        return self.polygon[self.triangles[:, 0]]

    @cached_property
    def triangle_places(self) -> FloatArray:
        """(t, 3, 3) positions of the corners of triangles."""
        return self.vertices[self.corner_vertex[self.triangles]]

    @cached_property
    def area_vectors(self) -> FloatArray:
        """(t, 3) normals of triangles, as long as their areas."""
        a, b, c = np.moveaxis(self.triangle_places, 1, 0)
        return np.asarray(np.cross(b - a, c - a) / 2)

    @cached_property
    def triangle_areas(self) -> FloatArray:
        """(t,) areas of triangles."""
        return np.asarray(np.linalg.norm(self.area_vectors, axis=1))

    @cached_property
    def polygon_normals(self) -> FloatArray:
        """(p, 3) unit normals of polygons; 0 without area."""
        return unit(sums_of(self.triangle_polygon, self.area_vectors, len(self.sizes)))


class Charts:
    """The charts of a mesh that is cut along closed edges, at its boundary and where more than two polygons meet.

    Attributes
    ----------
    node : (c,) int array
        Node of each corner: the corners at a vertex whose polygons are connected there. A vertex on a cut is several.
    chart, polygon_chart : (n,), (p,) int arrays
        Chart of each node and polygon.
    edge, pairs, faces : (q,), (q, 2), (q, 2) int arrays
        Edges inside of charts, and the nodes and polygons that each lies between.
    rim : (r, 2) int array
        The nodes of each polygon's edge that is a cut or a boundary.
    places : (n, 3) array
    lengths : (q,) array
    """

    def __init__(self, mesh: PolygonMesh, closed: BoolArray) -> None:
        self.mesh = mesh
        following, polygon = mesh.next_corner, mesh.polygon
        count = np.bincount(mesh.corner_edge, minlength=mesh.n_edges)
        first = (np.cumsum(count) - count)[(count == 2) & ~closed]
        order = np.argsort(mesh.corner_edge, kind="stable")
        a, b = order[first], order[first + 1]
        is_inside = polygon[a] != polygon[b]
        a, b = a[is_inside], b[is_inside]
        self.edge: IntArray = mesh.corner_edge[a]
        is_turned = mesh.corner_vertex[a] == mesh.corner_vertex[b]
        starts = np.stack([a, np.where(is_turned, b, following[b])], axis=1)
        ends = np.stack([following[a], np.where(is_turned, following[b], b)], axis=1)
        self.node: IntArray = connected_groups(np.concatenate([starts, ends]), len(polygon))
        self.n_nodes = int(self.node.max(initial=-1)) + 1
        self.pairs: IntArray = np.stack([self.node[a], self.node[following[a]]], axis=1)
        self.faces: IntArray = np.stack([polygon[a], polygon[b]], axis=1)
        self.polygon_chart: IntArray = connected_groups(self.faces, len(mesh.sizes))
        self.n_charts = int(self.polygon_chart.max(initial=-1)) + 1
        self.chart: IntArray = np.zeros(self.n_nodes, dtype=np.int64)
        self.chart[self.node] = self.polygon_chart[polygon]
        inside = np.zeros(mesh.n_edges, dtype=bool)
        inside[self.edge] = True
        outside = np.flatnonzero(~inside[mesh.corner_edge])
        self.rim: IntArray = np.stack([self.node[outside], self.node[following[outside]]], axis=1)
        self.places: FloatArray = np.zeros((self.n_nodes, 3))
        self.places[self.node] = mesh.vertices[mesh.corner_vertex]
        self.lengths: FloatArray = np.linalg.norm(np.subtract(*self.places[self.pairs.T]), axis=1)

    @property
    def handles(self) -> IntArray:
        """(charts,) number of cuts that a chart needs beside those that join its boundary loops: 2 for each handle."""
        loops = np.zeros(self.n_charts, dtype=np.int64)
        on_rim = np.unique(self.rim)
        one_each = np.unique(connected_groups(self.rim, self.n_nodes)[on_rim], return_index=True)[1]
        np.add.at(loops, self.chart[on_rim[one_each]], 1)
        nodes, polygons = (np.bincount(of, minlength=self.n_charts) for of in (self.chart, self.polygon_chart))
        edges = np.bincount(self.chart[np.concatenate([self.pairs[:, 0], self.rim[:, 0]])], minlength=self.n_charts)
        return np.asarray(2 - loops - (nodes - edges + polygons))

    @cached_property
    def corner_angles(self) -> FloatArray:
        """(t, 3) angles of the triangles."""
        return np.stack([np.arctan2(cross, dot) for cross, dot in self._products()], axis=1)

    @cached_property
    def angles(self) -> FloatArray:
        """(n,) sum of the angles around each node: 2π where the chart is flat, π on a straight rim."""
        nodes = self.node[self.mesh.triangles]
        sums = np.bincount(nodes.ravel(), self.corner_angles.ravel(), minlength=self.n_nodes)
        return sums.astype(np.float64)

    @cached_property
    def laplacian(self) -> csc_matrix:
        """(n, n) cotangent weights; positive semidefinite."""
        nodes = self.node[self.mesh.triangles]
        weights = np.concatenate(
            [
                np.clip(dot / np.maximum(cross, 1e-30), -MOST_COTANGENT, MOST_COTANGENT)
                for cross, dot in self._products()
            ]
        )
        ends = np.concatenate([nodes[:, [1, 2]], nodes[:, [2, 0]], nodes[:, [0, 1]]])
        half = coo_matrix((weights / 2, (ends[:, 0], ends[:, 1])), shape=(self.n_nodes,) * 2).tocsr()
        full = half + half.T
        full.data = np.maximum(full.data, LEAST_COTANGENT)
        return (diags(np.asarray(full.sum(axis=1)).ravel()) - full).tocsc()

    @cached_property
    def normals(self) -> FloatArray:
        """(n, 3) unit normals of nodes."""
        nodes = self.node[self.mesh.triangles].ravel()
        return unit(sums_of(nodes, np.repeat(self.mesh.area_vectors, 3, axis=0), self.n_nodes))

    def _products(self) -> list[tuple[FloatArray, FloatArray]]:
        """Lengths of cross products and dot products, (t,) each, of the two edges at each of the three corners."""
        places = np.moveaxis(self.mesh.triangle_places, 1, 0)
        result = []
        for i in range(3):
            u, v = places[i - 2] - places[i], places[i - 1] - places[i]
            result.append((np.linalg.norm(np.cross(u, v), axis=1), np.einsum("ij,ij->i", u, v)))
        return result


def unit(vectors: FloatArray) -> FloatArray:
    """(k, 3) vectors scaled to length 1; 0 stays 0."""
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1), 1e-30)[:, None])


def sums_of(owner: IntArray, vectors: FloatArray, count: int) -> FloatArray:
    """(count, d) sums of (k, d) vectors by their (k,) owners."""
    return np.stack([np.bincount(owner, column, minlength=count).astype(np.float64) for column in vectors.T], axis=1)


def highest_of_each(group: IntArray, values: FloatArray) -> IntArray:
    """Index of the highest of the (k,) values in each group, ordered by group; the first one of equal values."""
    order = np.lexsort((-values, group))
    is_first = np.ones(len(order), dtype=bool)
    is_first[1:] = group[order][1:] != group[order][:-1]
    return order[is_first]
