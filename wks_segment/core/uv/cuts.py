"""Where the charts of a surface are cut, so that each can be laid flat with nearly the same density everywhere.

A tube is cut along its inner side from one end to the other, a limb from its border to its tip. A chart becomes a disk:
its boundary loops and the ends of closed charts are joined by the shortest tree, and handles are opened. Then the
scale of the best conformal map is predicted, which is exp(u) with Δu = K and u = 0 on cuts (Springborn, Schröder and
Pinkall 2008; Sawhney and Crane 2017), and a cut is led to the most compressed place until no place is too dense.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra, minimum_spanning_tree
from scipy.sparse.linalg import splu

from ..mesh.triangle_mesh import BoolArray, FloatArray, IntArray, connected_groups
from .charts import Charts, PolygonMesh, highest_of_each, sums_of, unit

MOST_COMPRESSED = 0.6
"""A cut is led to places whose predicted lengths are below exp(-0.6) = 0.55, or areas below 0.3, of those at cuts."""
MOST_TIPS = 40
"""Most cuts of this kind in a chart."""
FLAT_HOLE = np.pi
"""A boundary loop is left as a hole if what lies in it would have less curvature than this: an eye in a face, not the
end of a tube, in which a half-sphere with 2π would fit."""
INNER_SIDE = 1.5
"""The cost of a cut is by exp(2 * 1.5) = 20 lower on the inner side of a limb than on its outer side."""
CREASE_DISCOUNT, SHARP = 0.5, np.radians(60)
"""And lower by half where the surface bends by 60° or more."""
CREASE_WIDTH = 4.0
"""Where a chart is split, a sharp crease counts as this much wider, so that the border between halves lies in it."""
BACK = 0.25
"""How much the back counts beside the inner side, for charts that are in the middle of the body, such as a head."""
CENTRAL = 0.05
"""Charts that are nearer than this to the axis of the body, in units of the square root of their area, have no inner
side to speak of."""


@dataclass(frozen=True)
class HiddenSide:
    """Where cuts of a body are seen least.

    Attributes
    ----------
    middle : (3,) array
        The middle of the body: the inner side of a limb is turned to it.
    back : (3,) array
        Unit vector to the back of the body.
    """

    middle: FloatArray
    back: FloatArray

    def of_charts(self, charts: Charts) -> FloatArray:
        """(charts, 3) unit vector that normals have where a cut in each chart is seen least.

        It is the inner side, from the axis of the chart to the middle of the body, and a little the back.
        """
        mesh = charts.mesh
        of, areas = charts.polygon_chart[mesh.triangle_polygon], mesh.triangle_areas
        centers = mesh.triangle_places.mean(axis=1)
        size = np.maximum(np.bincount(of, areas, minlength=charts.n_charts), 1e-30)
        middles = sums_of(of, areas[:, None] * centers, charts.n_charts) / size[:, None]
        offsets = centers - middles[of]
        products = (areas[:, None, None] * offsets[:, :, None] * offsets[:, None, :]).reshape(-1, 9)
        axes = np.linalg.eigh(sums_of(of, products, charts.n_charts).reshape(-1, 3, 3))[1][:, :, 2]
        inward = self.middle - middles
        inward -= np.einsum("ij,ij->i", inward, axes)[:, None] * axes
        inward /= (np.linalg.norm(inward, axis=1) + CENTRAL * np.sqrt(size))[:, None]
        # Normals point into a body that is inside out.
        volumes = np.bincount(of, np.einsum("ij,ij->i", mesh.area_vectors, offsets), minlength=charts.n_charts)
        return np.asarray(unit(inward + BACK * self.back) * np.where(volumes < 0, -1.0, 1.0)[:, None])


def cut_open(mesh: PolygonMesh, closed: BoolArray, hidden_side: HiddenSide) -> BoolArray:
    """(e,) edges to be cut in addition to the (e,) closed ones, which separate the charts."""
    charts = Charts(mesh, closed)
    opening = _Opening(charts, _costs(charts, hidden_side))
    opening.join_loops()
    opening.open_handles()
    opening.reach_tips()
    result = np.zeros(mesh.n_edges, dtype=bool)
    result[charts.edge[opening.is_cut]] = True
    return result


def split(mesh: PolygonMesh, closed: BoolArray, pairs: IntArray) -> BoolArray:
    """(e,) edges midway between the two polygons of each of (q, 2) pairs of different charts, rather in creases."""
    charts, n_polygons = Charts(mesh, closed), len(mesh.sizes)
    moments = sums_of(
        mesh.triangle_polygon, mesh.triangle_areas[:, None] * mesh.triangle_places.mean(axis=1), n_polygons
    )
    areas = np.bincount(mesh.triangle_polygon, mesh.triangle_areas, minlength=n_polygons)
    centers = moments / np.maximum(areas, 1e-30)[:, None]
    distances = np.linalg.norm(np.subtract(*centers[charts.faces.T]), axis=1) * (1 + CREASE_WIDTH * _bends(charts))
    origin = _Graph(charts.faces, distances + 1e-12, n_polygons).nearest(np.unique(pairs))[2]
    is_second = (origin >= 0) & np.isin(origin, pairs[:, 1])
    result = np.zeros(mesh.n_edges, dtype=bool)
    result[charts.edge[is_second[charts.faces[:, 0]] != is_second[charts.faces[:, 1]]]] = True
    return result


class _Graph:
    """Paths between nodes along edges with a cost; of several edges between two nodes the cheapest counts."""

    def __init__(self, pairs: IntArray, costs: FloatArray, n_nodes: int) -> None:
        self.n_nodes = n_nodes
        keys = np.sort(pairs, axis=1) @ np.array([n_nodes, 1])
        self.cheapest = highest_of_each(keys, -costs)
        self.keys = keys[self.cheapest]
        a, b = pairs[self.cheapest].T
        cost = costs[self.cheapest]
        self.matrix = csr_matrix((np.tile(cost, 2), (np.r_[a, b], np.r_[b, a])), shape=(n_nodes, n_nodes))

    def nearest(self, sources: IntArray) -> tuple[FloatArray, IntArray, IntArray]:
        """(n,) cost of the path to the nearest source, the next node on it, and the source; negative for none."""
        if not len(sources):
            none = np.full(self.n_nodes, -1)
            return np.full(self.n_nodes, np.inf), none, none
        return dijkstra(self.matrix, indices=sources, min_only=True, return_predecessors=True)

    def edges(self, a: IntArray, b: IntArray) -> IntArray:
        """Index of the cheapest edge between nodes a and b."""
        keys = np.minimum(a, b) * self.n_nodes + np.maximum(a, b)
        return self.cheapest[np.searchsorted(self.keys, keys)]

    def path_edges(self, before: IntArray, ends: IntArray) -> IntArray:
        """Edges on the paths from some nodes to their sources, given the next node of each node."""
        found = [np.zeros(0, dtype=np.int64)]
        while len(ends := np.unique(ends[before[ends] >= 0])):
            found.append(self.edges(ends, before[ends]))
            ends = before[ends]
        return np.concatenate(found)


class _Opening:
    """The edges of charts that are to be cut, given the (q,) costs of a cut along each edge inside of a chart."""

    def __init__(self, charts: Charts, costs: FloatArray) -> None:
        self.charts = charts
        self.costs = costs
        self.graph = _Graph(charts.pairs, costs, charts.n_nodes)
        self.is_cut = np.zeros(len(charts.pairs), dtype=bool)
        on_rim = np.unique(charts.rim)
        self.loop = np.full(charts.n_nodes, -1)
        """(n,) boundary loop of each node."""
        group = connected_groups(charts.rim, charts.n_nodes)[on_rim]
        self.loop[on_rim] = np.unique(group, return_inverse=True)[1].ravel()
        self.n_loops = int(self.loop.max(initial=-1)) + 1
        self.needs_handles = charts.handles > 0
        self.hole = self._flat_holes()
        self.joined = np.where((self.loop >= 0) & ~self.hole[self.loop], self.loop, -1)
        """(n,) number of the loop, or of the end of a closed chart, that each node is on and that is to be joined."""
        ends = self._ends_of_closed_charts()
        self.joined[ends] = self.n_loops + np.arange(len(ends))

    @property
    def reached(self) -> BoolArray:
        """(n,) whether a node is on a cut, or on a boundary that one leads to."""
        reached = self.joined >= 0
        reached[self.charts.pairs[self.is_cut]] = True
        on_loop = self.loop >= 0
        touched = np.bincount(self.loop[on_loop], reached[on_loop], minlength=self.n_loops) > 0
        reached[on_loop] |= touched[self.loop[on_loop]]
        return reached

    def join_loops(self) -> None:
        """Join the boundary loops of each chart, or the two ends of a closed one, by a short tree (Mehlhorn 1988)."""
        cost, before, origin = self.graph.nearest(np.flatnonzero(self.joined >= 0))
        owner = np.where(origin >= 0, self.joined[np.maximum(origin, 0)], -1)
        a, b = self.charts.pairs.T
        across = np.flatnonzero(owner[a] != owner[b])
        ends, costs = owner[self.charts.pairs[across]], cost[a[across]] + self.costs[across] + cost[b[across]]
        bridges = _Graph(ends, costs, int(self.joined.max(initial=-1)) + 1)
        tree = minimum_spanning_tree(bridges.matrix).tocoo()
        chosen = across[bridges.edges(tree.row.astype(np.int64), tree.col.astype(np.int64))]
        self.is_cut[chosen] = True
        self._cut_paths(before, self.charts.pairs[chosen].ravel())

    def open_handles(self) -> None:
        """Cut the shortest loops around handles (Erickson and Whittlesey 2005)."""
        if not self.needs_handles.any():
            return
        charts, n_polygons = self.charts, len(self.charts.mesh.sizes)
        cost, before, _ = self.graph.nearest(np.flatnonzero(self.reached))
        in_tree = self.is_cut.copy()
        ends = np.flatnonzero(before >= 0)
        in_tree[self.graph.edges(ends, before[ends])] = True
        a, b = charts.pairs.T
        rest = np.flatnonzero(~in_tree & self.needs_handles[charts.chart[a]])
        loops = cost[a[rest]] + self.costs[rest] + cost[b[rest]]
        # The longest loops stay closed: polygons are connected across their edges first.
        across = _Graph(charts.faces[rest], 1.0 + np.argsort(np.argsort(-loops, kind="stable")), n_polygons)
        tree = minimum_spanning_tree(across.matrix).tocoo()
        left = np.setdiff1d(rest, rest[across.edges(tree.row.astype(np.int64), tree.col.astype(np.int64))])
        self.is_cut[left] = True
        self._cut_paths(before, charts.pairs[left].ravel())

    def reach_tips(self) -> None:
        """Lead cuts to the most compressed place of each chart, until no place is too compressed."""
        charts = self.charts
        flatness = 2 * np.pi - charts.angles
        on_hole = np.flatnonzero((self.loop >= 0) & self.hole[self.loop])
        sizes = np.bincount(self.loop[self.loop >= 0], minlength=self.n_loops)
        flatness[on_hole] += 2 * np.pi / sizes[self.loop[on_hole]] - np.pi
        active = np.ones(charts.n_charts, dtype=bool)
        for _ in range(MOST_TIPS):
            reached = self.reached
            free = np.flatnonzero(~reached & active[charts.chart])
            if not len(free):
                return
            matrix = charts.laplacian[free][:, free].tocsc()
            factor = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
            compression = factor.solve(flatness[free])
            worst = highest_of_each(charts.chart[free], compression)
            tips = free[worst[compression[worst] > MOST_COMPRESSED]]
            active[:] = False
            active[charts.chart[tips]] = True
            before = self.graph.nearest(np.flatnonzero(reached))[1]
            self._cut_paths(before, tips)

    def _cut_paths(self, before: IntArray, ends: IntArray) -> None:
        self.is_cut[self.graph.path_edges(before, ends)] = True

    def _flat_holes(self) -> BoolArray:
        """(loops + 1,) whether a boundary loop is left as a hole. The last value is False, for nodes without a loop.

        The longest loop of a chart is its outer one. A chart with handles has no holes that are left.
        """
        charts, on = self.charts, np.flatnonzero(self.loop >= 0)
        chart = np.zeros(self.n_loops, dtype=np.int64)
        chart[self.loop[on]] = charts.chart[on]
        turning = np.bincount(self.loop[on], np.pi - charts.angles[on], minlength=self.n_loops)
        along = np.linalg.norm(np.subtract(*charts.places[charts.rim.T]), axis=1)
        length = np.bincount(self.loop[charts.rim[:, 0]], along, minlength=self.n_loops).astype(np.float64)
        is_hole = (2 * np.pi + turning < FLAT_HOLE) & ~self.needs_handles[chart]
        is_hole[highest_of_each(chart, length)] = False
        return np.append(is_hole, False)

    def _ends_of_closed_charts(self) -> IntArray:
        """Two nodes of each chart without a boundary, far from each other."""
        charts = self.charts
        is_closed = np.ones(charts.n_charts, dtype=bool)
        is_closed[charts.chart[self.loop >= 0]] = False
        nodes = np.flatnonzero(is_closed[charts.chart])
        if not len(nodes):
            return nodes
        counts = np.bincount(charts.chart, minlength=charts.n_charts)
        middles = sums_of(charts.chart, charts.places, charts.n_charts) / counts[:, None]
        offsets = np.linalg.norm(charts.places[nodes] - middles[charts.chart[nodes]], axis=1)
        first = nodes[highest_of_each(charts.chart[nodes], offsets)]
        distance = _Graph(charts.pairs, charts.lengths + 1e-12, charts.n_nodes).nearest(first)[0]
        second = nodes[highest_of_each(charts.chart[nodes], distance[nodes])]
        return np.concatenate([first, second])


def _costs(charts: Charts, hidden_side: HiddenSide) -> FloatArray:
    """(q,) costs of a cut along each edge inside of a chart: its length, less on the inner side and in creases."""
    hidden = hidden_side.of_charts(charts)[charts.chart[charts.pairs[:, 0]]]
    normals = unit(charts.normals[charts.pairs].sum(axis=1))
    side = np.einsum("ij,ij->i", normals, hidden)
    costs = charts.lengths * np.exp(-INNER_SIDE * side) * (1 - CREASE_DISCOUNT * _bends(charts))
    return np.asarray(costs + 1e-6 * charts.lengths.mean() + 1e-12) if len(costs) else costs


def _bends(charts: Charts) -> FloatArray:
    """(q,) how much the surface bends at each edge inside of a chart, 1 from `SHARP`."""
    normals = charts.mesh.polygon_normals[charts.faces]
    cosines = np.einsum("ij,ij->i", normals[:, 0], normals[:, 1])
    return np.asarray(np.minimum(np.arccos(np.clip(cosines, -1, 1)) / SHARP, 1))
