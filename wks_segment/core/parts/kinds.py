"""Kinds of parts: which regions are repeats of each other, and the order in which kinds are merged.

A kind is a part of the body, or its repeats: left and right, the fingers, the legs of a spider, the same part of
another body. Kinds are merged where their regions touch, so a head and a thigh are never one kind although their
signatures are alike.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.spatial.distance import squareform

from ..mesh.triangle_mesh import BoolArray, FloatArray, IntArray
from ..progress import Progress
from .evidence import Evidence
from .part_graph import PartGraph

FINEST, WHOLE = 2.0, 0.2
"""Log-odds down to which regions grow: fine regions, each of which gets a kind; and parts as a whole, which are
clustered on several meshes to begin with, because finer ones differ from body to body."""
LEAST_REGION = 0.003
"""Regions below this share of the area are merged with a neighbor in any case."""
MOST_GROWN = 60
"""Most regions of a mesh, but at least `REGIONS_PER_SEGMENT` for each segment that is asked for."""
REGIONS_PER_SEGMENT = 4
SAME_KIND = 0.7
"""Regions are repeats if their mean signatures differ by less than this, in standard deviations inside regions and root
mean square over the axes, with the weighted difference of the logarithms of their areas added."""
SIZE_WEIGHT, LEAST_SIZE = 0.5, 1e-3
"""Weight of the logarithm of an area beside signatures, and what is added to the area, so that tiny parts are alike."""
NO_REPEAT = 1e3
"""Distance of regions that are no repeats of each other in any case."""
WITHIN = 1e-3
"""Added to the variance inside regions, against a division by zero."""
MIRRORED_SHARE = 0.6
"""Share of two regions that must be mirror images for them to be one kind."""
KINDS_OF_BODIES, KINDS_PER_SEGMENT = 12, 1.5
"""Number of kinds on several meshes: the first, or the second for each segment if that is more."""
UNTOUCHED = 3.0
"""Taken from the log-odds of two kinds if no region of the smaller one touches the other, in part if some do not."""
SMALL_KIND = 0.01
"""Kinds below this share of the area are merged before all others: an eye goes before a head."""
FIRST = 100.0
"""Taken from the loss of small kinds: more than any."""
DOUBT, SIZE = 4.0, 0.75
"""A merge of kinds with log-odds o, of which the smaller one has the area a, is taken to lose `a ** SIZE * tanh(-o / 2
/ DOUBT)`: what is mixed if they are two parts, less what is made whole if they are one. What loses least comes first,
so fingers are merged before limbs."""


AgreeFunction = Callable[[Sequence[PartGraph], Sequence[IntArray]], list[IntArray]]
"""Gives the (r,) kind of each region of each mesh, on which the meshes agree, from those to begin with."""


@dataclass(frozen=True)
class Kinds:
    """Kinds of parts on learned meshes, and the order in which they are merged.

    Attributes
    ----------
    of_faces
        For each mesh, (m,) kind of each face: 0, 1, …, k − 1.
    merges : (k − 1, 2) int array
        Kinds that each step merges, the larger one first, whose number the result keeps.
    likeness : (k − 1,) array
        Log-odds with which each step found its two kinds to be one part.
    """

    of_faces: Sequence[IntArray]
    merges: IntArray
    likeness: FloatArray

    @property
    def count(self) -> int:
        """Number of kinds."""
        return len(self.merges) + 1

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Arrays by name, to be cached; `of_arrays` reads them."""
        kinds = {f"kind_{i}": kind for i, kind in enumerate(self.of_faces)}
        return {"merges": self.merges, "likeness": self.likeness, **kinds}

    @classmethod
    def of_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> Kinds | None:
        """The kinds in arrays that `arrays` made; None if there are none."""
        if "merges" not in arrays:
            return None
        of_faces = [arrays[f"kind_{i}"] for i in range(sum(name.startswith("kind_") for name in arrays))]
        return cls(of_faces, arrays["merges"], arrays["likeness"])


def n_regions_of_mesh(n_segments: int) -> int:
    """Most regions of one mesh for a number of segments."""
    return max(MOST_GROWN, REGIONS_PER_SEGMENT * n_segments)


def n_kinds_of_bodies(n_segments: int) -> int:
    """Number of kinds on several meshes for a number of segments."""
    return max(KINDS_OF_BODIES, round(KINDS_PER_SEGMENT * n_segments))


def least_kinds_of_bodies(n_segments: int) -> int:
    """Number of kinds that several meshes keep, the same for all numbers of segments with as many kinds."""
    return round(n_kinds_of_bodies(n_segments) / KINDS_PER_SEGMENT)


def find_kinds(
    meshes: Sequence[Evidence],
    signatures: Sequence[FloatArray],
    n_segments: int,
    progress: Progress,
    agree: AgreeFunction | None = None,
) -> Kinds:
    """Cut meshes into parts, find the kinds of these, and merge them one by one.

    Parameters
    ----------
    meshes
    signatures
        For each mesh, (m, d) values of its faces along uncorrelated axes.
    n_segments : int
        Number of segments that there should be at least.
    progress : Progress
    agree : function, optional
        Makes several meshes agree on the kinds of their regions.
    """
    graphs = []
    for (evidence, signature), step in progress.each(list(zip(meshes, signatures, strict=True))):
        graph = PartGraph.of(evidence, signature, step)
        grow(graph, FINEST, n_regions_of_mesh(n_segments))
        graphs.append(graph)
    if len(meshes) == 1:
        kinds = [_repeats(meshes[0], signatures[0], graphs[0])]
    else:
        kinds = _kinds_of_wholes(graphs, n_kinds_of_bodies(n_segments))
        if agree is not None:
            kinds = agree(graphs, kinds)
    return Kinds(*_Merging(graphs, kinds).run())


def grow(graph: PartGraph, least: float, most_regions: int) -> None:
    """Merge the likeliest pair of regions while its log-odds are above a limit, or regions are too many or small."""
    while True:
        first, second = divmod(int(graph.likeness.argmax()), len(graph.alive))
        if not np.isfinite(graph.likeness[first, second]):
            return
        if graph.likeness[first, second] < least and np.count_nonzero(graph.alive) <= most_regions:
            touching = np.isfinite(graph.likeness.max(axis=1))
            small = np.flatnonzero(graph.alive & touching & (graph.areas < LEAST_REGION))
            if not len(small):
                return
            first = int(small[graph.areas[small].argmin()])
            second = int(graph.likeness[first].argmax())
        graph.merge_both(first, second, least)


def _repeats(evidence: Evidence, signature: FloatArray, graph: PartGraph) -> IntArray:
    """(r,) kind of each region of one mesh: regions with the same signature and area, and mirror images, are one."""
    means, areas = graph.mean_signatures(), graph.areas[graph.regions]
    if len(areas) == 1:
        return np.zeros(1, dtype=np.int64)
    inside = means[np.searchsorted(graph.regions, graph.region_of_faces())]
    variance = evidence.areas @ (signature - inside) ** 2
    scaled = means / np.sqrt(variance + WITHIN)
    distance = np.sqrt(((scaled[:, None] - scaled) ** 2).mean(axis=2))
    distance += SIZE_WEIGHT * np.abs(np.subtract.outer(np.log(areas), np.log(areas)))
    mirrored = _mirrored(evidence, graph)
    distance[mirrored] = 0
    # A region across the mirror plane is a neck or a tail, and no repeat of another one, however alike they are.
    central = np.diagonal(mirrored)
    distance[central] = distance[:, central] = NO_REPEAT
    np.fill_diagonal(distance, 0)
    tree = scipy.cluster.hierarchy.linkage(squareform(distance, checks=False), "average")
    return np.asarray(scipy.cluster.hierarchy.fcluster(tree, SAME_KIND, "distance") - 1, dtype=np.int64)


def _kinds_of_wholes(graphs: Sequence[PartGraph], count: int) -> list[IntArray]:
    """(r,) kind of each region of each mesh: that of the part as a whole that it belongs to."""
    wholes = [deepcopy(graph) for graph in graphs]
    for graph in wholes:
        grow(graph, WHOLE, MOST_GROWN)
    of_wholes = _kinds_of_bodies(wholes, count)
    return [
        kind[np.searchsorted(whole.regions, whole.owner[graph.regions])]
        for graph, whole, kind in zip(graphs, wholes, of_wholes, strict=True)
    ]


def _kinds_of_bodies(graphs: Sequence[PartGraph], count: int) -> list[IntArray]:
    """(r,) kind of each region of each mesh: a fixed number of clusters of mean signature and area (Ward, 1963)."""
    means = np.concatenate([graph.mean_signatures() for graph in graphs])
    areas = np.concatenate([graph.areas[graph.regions] for graph in graphs])
    offset = means - np.average(means, axis=0, weights=areas)
    unit = np.sqrt(np.average(np.square(offset).sum(axis=1), weights=areas)) or 1.0
    # Small parts count less, but more than their area: a hand has a hundredth of it.
    places = np.column_stack([offset / unit, SIZE_WEIGHT * np.log(areas + LEAST_SIZE)]) * areas[:, None] ** 0.25
    kind = np.zeros(len(areas), dtype=np.int64)
    if len(areas) > 1:
        tree = scipy.cluster.hierarchy.linkage(places, "ward")
        kind = np.asarray(scipy.cluster.hierarchy.fcluster(tree, count, "maxclust") - 1, dtype=np.int64)
    return np.split(kind, np.cumsum([len(graph.regions) for graph in graphs])[:-1])


def _mirrored(evidence: Evidence, graph: PartGraph) -> BoolArray:
    """(r, r) whether two regions are mirror images of each other."""
    count = len(graph.regions)
    if evidence.image is None:
        return np.zeros((count, count), dtype=bool)
    region = np.searchsorted(graph.regions, graph.region_of_faces())
    has = evidence.image >= 0
    common = np.zeros((count, count))
    np.add.at(common, (region[has], region[evidence.image[has]]), evidence.areas[has])
    areas = np.maximum(np.bincount(region, evidence.areas, count), np.finfo(float).tiny)
    share = np.minimum(common / areas[:, None], common / areas)
    return np.asarray(np.minimum(share, share.T) > MIRRORED_SHARE)


class _Merging:
    """Kinds that are merged one by one, each with all of its regions that touch."""

    def __init__(self, graphs: Sequence[PartGraph], kinds: Sequence[IntArray]) -> None:
        self._graphs = graphs
        self._first = [graph.region_of_faces() for graph in graphs]
        self._start: list[IntArray] = []
        self._kind: list[IntArray] = []
        """For each graph, kind of each number; −1 for numbers of no region."""
        for graph, kind in zip(graphs, kinds, strict=True):
            of_number = np.full(len(graph.alive), -1)
            of_number[graph.regions] = kind
            self._kind.append(of_number)
            self._start.append(of_number.copy())
        self._count = 1 + max(int(kind.max()) for kind in kinds)

    def run(self) -> tuple[list[IntArray], IntArray, FloatArray]:
        """Merge until one kind is left; see `Kinds`."""
        of_faces = [start[region] for start, region in zip(self._start, self._first, strict=True)]
        merges, likeness = [], []
        left = set(range(self._count))
        if len(self._graphs) > 1:  # on one mesh, regions of a kind that touch are left and right
            for kind in left:
                self._merge(kind, kind)
        table = np.full((self._count, self._count), -np.inf)
        areas = self._areas()
        for i in left:
            for j in left:
                if i < j:
                    table[i, j] = self._likeness(i, j)
        while len(left) > 1:
            smaller = np.minimum.outer(areas, areas)
            loss = smaller**SIZE * np.tanh(-table / 2 / DOUBT) - FIRST * (smaller < SMALL_KIND)
            loss[~np.isfinite(table)] = np.inf
            first, second = divmod(int(loss.argmin()), self._count)
            if not np.isfinite(table[first, second]):
                first, second = self._untouched(sorted(left), areas)
            kept, gone = (first, second) if areas[first] >= areas[second] else (second, first)
            merges.append((kept, gone))
            likeness.append(max(float(table[min(kept, gone), max(kept, gone)]), -FIRST))
            self._merge(kept, gone)
            areas[kept] += areas[gone]
            areas[gone] = 1.0
            left.remove(gone)
            table[gone] = table[:, gone] = -np.inf
            for other in left - {kept}:
                table[min(kept, other), max(kept, other)] = self._likeness(kept, other)
        return of_faces, np.array(merges, dtype=np.int64).reshape(-1, 2), np.array(likeness)

    def _areas(self) -> FloatArray:
        """Mean share of each kind in the area of a mesh."""
        total = np.zeros(self._count)
        for graph, kind in zip(self._graphs, self._kind, strict=True):
            total += np.bincount(kind[graph.regions], graph.areas[graph.regions], self._count)
        return total / len(self._graphs)

    def _likeness(self, first: int, second: int) -> float:
        """Log-odds that two kinds are one part, mean over the regions of the smaller one; −inf if none touch."""
        area = [0.0, 0.0]
        best: list[list[tuple[FloatArray, FloatArray]]] = [[], []]
        for graph, kind in zip(self._graphs, self._kind, strict=True):
            regions = [np.flatnonzero(graph.alive & (kind == k)) for k in (first, second)]
            for side in (0, 1):
                area[side] += graph.areas[regions[side]].sum()
            block = graph.likeness[np.ix_(*regions)]
            if block.size:  # not every mesh has regions of both kinds
                for side in (0, 1):
                    best[side].append((block.max(axis=1 - side), graph.areas[regions[side]]))
        smaller = best[0] if area[0] <= area[1] else best[1]
        if not smaller:
            return -np.inf
        values, weights = (np.concatenate([one[i] for one in smaller]) for i in (0, 1))
        touch = np.isfinite(values)
        if not touch.any():
            return -np.inf
        cover = float(weights[touch].sum() / weights.sum())
        return float(np.average(values[touch], weights=weights[touch])) - UNTOUCHED * (1 - cover)

    def _merge(self, kept: int, gone: int) -> None:
        """Merge all regions of two kinds that touch."""
        for graph, kind in zip(self._graphs, self._kind, strict=True):
            while True:
                ours, theirs = (np.flatnonzero(graph.alive & (kind == k)) for k in (kept, gone))
                block = graph.likeness[np.ix_(ours, theirs)]
                if not block.size or not np.isfinite(block.max()):
                    break
                i, j = divmod(int(block.argmax()), len(theirs))
                kind[graph.merge(ours[i], theirs[j])] = kept
            kind[kind == gone] = kept

    def _untouched(self, left: list[int], areas: FloatArray) -> tuple[int, int]:
        """The smallest kind and the largest one, if no two kinds touch."""
        by_area = sorted(left, key=lambda k: areas[k])
        return by_area[0], by_area[-1]
