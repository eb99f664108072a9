"""The same name for the same region in every pose: which of several alike it is, and whether left or right.

Signatures are the same on left and right. The images of two mirrored regions in signature space are the same, too, but
passed through in opposite senses: for two functions f and g of the signature, df ∧ dg is the signed area that a face
covers in the plane (f, g), and its sum, weighed by a function that is positive near a region and negative near those
alike, tells these apart: left from right by their surroundings, on any meshing and in any pose. After Ren, Poulenard,
Wonka and Ovsjanikov, "Continuous and orientation-preserving correspondences via functional maps" (2018), whose operator
keeps a map from turning left into right. Here there is no map, only a few numbers a region.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.sparse import coo_matrix
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from ..mesh.adjacency import FaceAdjacency, connected_regions
from ..mesh.surface import Surface
from ..mesh.triangle_mesh import FloatArray, IntArray, TriangleMesh
from ..poses.pose_cache import Workpiece
from ..spectral.laplacian import unit_area_masses

FIELDS = 6
"""Functions of the signature that regions are told apart by."""
PLANES = FIELDS * (FIELDS - 1) // 2
REACH = 0.3
"""How far a region's surroundings reach, in units of the square root of the area."""
NOISE = {"area": 0.5, "signature": 0.5, "handedness": 0.5, "distance": 0.1}
"""How much traits change from pose to pose, if there is one pose only: of the logarithm of the area, of the signature,
of handedness in units of its root mean square, of distances …"""
LEAST_NOISE = {"area": 0.1, "signature": 0.1, "handedness": 0.2, "distance": 0.03}
"""… and at least, however alike the learned poses are."""
LEAST_OVERLAP = 1e-6
"""Regions whose heat overlaps less than this are as far apart as that."""
IMPOSSIBLE = 1e6
"""What it costs to take a region for one of another segment."""
SWEEPS = 3
"""Rounds over all segments in which each is matched again, given the others."""
MOST_REGIONS = 200
"""Regions of a pose that are told apart, the largest ones."""
ALIKE = 0.5
"""Parts on two sides are one part twice if the smaller has at least this share of the larger one's area."""
MIDDLE = 0.05
"""Regions nearer than this to each other, across the mirror plane, are neither left nor right."""
BENT = 0.1
"""The same where no mirroring brings the regions close to each other."""
SIDE_REACH = 0.15
"""What `REACH` is, where a part's side is that of what is near to it."""
SURE = 0.5
"""A part is left or right from this mean of `side_field` on: heat from one side is three times that from the other."""


@dataclass(frozen=True)
class Regions:
    """Connected regions of a pose.

    Attributes
    ----------
    region : (m,) int array
        Of each face: the r largest are numbered 0, 1, …, r − 1, and others on from there.
    segment : (r,) int array
        Segment of each of those.
    """

    region: IntArray
    segment: IntArray

    @classmethod
    def of(cls, labels: IntArray, adjacency: FaceAdjacency, original: TriangleMesh) -> Regions:
        """Given the segment of each face of a mesh, and which faces hang together."""
        region = connected_regions(labels, adjacency)
        segment_of = np.zeros(int(region.max()) + 1, dtype=np.int64)
        segment_of[region] = labels
        largest = np.argsort(-np.bincount(region, original.face_areas), kind="stable")[:MOST_REGIONS]
        order = np.append(np.sort(largest), np.setdiff1d(np.arange(len(segment_of)), largest))
        return cls(np.argsort(order)[region], segment_of[np.sort(largest)])

    def traits(self, pose: Workpiece, fields: FloatArray) -> Traits:
        """What tells the r largest apart in a pose, given the (n', FIELDS) fields on its surface."""
        large = np.where(self.region < len(self.segment), self.region, -1)
        return Traits.of(pose, fields, large, self.segment)

    def centers(self, mesh: TriangleMesh) -> FloatArray:
        """(r, 3) center of each of the r largest in units of the square root of the area; x from the middle."""
        places = mesh.unit_face_centers
        middle = np.average(places[:, 0], weights=mesh.face_areas)
        count = int(self.region.max()) + 1
        weights = mesh.face_areas + np.finfo(float).tiny
        sums = np.stack([np.bincount(self.region, weights * axis, count) for axis in places.T], axis=1)
        centers = sums / np.bincount(self.region, weights, count)[:, None]
        return np.asarray(centers[: len(self.segment)] - (middle, 0, 0))

    def numbered(self, names: IntArray, n_known: int) -> IntArray:
        """(m,) name of each face's region, given those of the r largest; others are numbered on."""
        others = int(self.region.max()) + 1 - len(names)
        first = max(n_known, int(names.max()) + 1)
        return np.append(names, first + np.arange(others))[self.region]


@dataclass(frozen=True)
class Traits:
    """What tells the r connected regions of a pose apart. None of it depends on the pose or the meshing.

    Attributes
    ----------
    segment : (r,) int array
    area : (r,) array
        Share of the whole.
    signature : (r, FIELDS) array
        Mean over the region.
    handedness : (r, PLANES) array
        Σ over faces of h df ∧ dg for all pairs of fields; h is near 1 at the region and near −1 at the others of its
        segment. The opposite at the mirrored region.
    distance : (r, r) array
        Between regions, from how their heat overlaps (Varadhan, 1967), in units of the square root of the area.
    """

    segment: IntArray
    area: FloatArray
    signature: FloatArray
    handedness: FloatArray
    distance: FloatArray

    @classmethod
    def of(cls, pose: Workpiece, fields: FloatArray, region: IntArray, segment: IntArray) -> Traits:
        """Describe regions of one pose.

        Parameters
        ----------
        pose : Workpiece
            With n' vertices on its surface and m original faces.
        fields : (n', FIELDS) array
            Functions of the signature.
        region : (m,) int array
            Region of each face, numbered 0, 1, …, r − 1; -1 for one of none.
        segment : (r,) int array
            Segment of each region.
        """
        surface, mesh, original = pose.surface, pose.surface.mesh, pose.surface.original
        count = len(segment)
        area = np.bincount(region[region >= 0], original.face_areas[region >= 0], count) / original.area
        masses = unit_area_masses(mesh)
        inside = _at_vertices(surface, region, count)
        heat = pose.flows.over(REACH).smooth(inside).astype(np.float64)
        weighed = inside * masses[:, None]
        signature = weighed.T @ fields / np.maximum(weighed.sum(axis=0), LEAST_OVERLAP)[:, None]
        against = np.where(segment[:, None] == segment, -1.0, 0.0)
        np.fill_diagonal(against, 0)
        against /= np.maximum(-against.sum(axis=0), 1)
        np.fill_diagonal(against, (against != 0).any(axis=0))
        handedness = (heat @ against)[mesh.faces].mean(axis=1).T @ _signed_areas(pose, fields)
        overlap = heat.T @ (heat * masses[:, None]) / masses.sum()
        size = np.sqrt(np.maximum(area, LEAST_OVERLAP))
        distance = -REACH * np.log(np.maximum(overlap / np.outer(size, size), LEAST_OVERLAP))
        return cls(segment, np.maximum(area, LEAST_OVERLAP), signature, handedness, distance)


@dataclass(frozen=True)
class RegionAtlas:
    """The regions that were learned, and how to know them again.

    Attributes
    ----------
    n_groups : int
        Groups of components whose connected regions they are.
    traits : Traits
        Means over the learned poses.
    side : (r,) int array
        1: left, which is +x as in Blender; −1: right; 0: neither.
    noise : (4,) array
        How much log area, signature, handedness and distance change from pose to pose: standard deviations.
    """

    n_groups: int
    traits: Traits
    side: IntArray
    noise: FloatArray

    @classmethod
    def learned(cls, n_groups: int, poses: Sequence[Traits], centers: FloatArray, alike: bool = False) -> RegionAtlas:
        """From one or several poses, and the (r, 3) centers of the first one's regions, best at rest.

        `alike`: the poses are of one mesh, and have their regions in the same order.
        """
        side = np.zeros(len(centers), dtype=np.int64)
        atlas = cls(n_groups, poses[0], side, _scaled(NOISE, poses[0]))
        # A mean over poses finds regions of each more surely than the first pose does.
        for _ in range(2):
            names = [np.arange(len(pose.segment)) if alike else atlas.named(pose) for pose in poses]
            mean = _mean(atlas.traits, poses, names)
            noise = _scaled(NOISE, mean)
            if len(poses) > 1:
                noise = np.maximum(_spread(mean, poses, names), _scaled(LEAST_NOISE, mean))
            atlas = cls(n_groups, mean, side, noise)
        return replace(atlas, side=sides(centers, poses[0].segment, atlas.mirrored()))

    def sides_of(self, names: IntArray) -> IntArray:
        """Side of each region that was learned, by its number; 0 of others."""
        return np.where(names < len(self.side), self.side[np.minimum(names, len(self.side) - 1)], 0)

    def mirrored(self) -> IntArray:
        """(r,) which region each is in the mirror image of the character; on from r for one that has none there."""
        return self.named(replace(self.traits, handedness=-self.traits.handedness))

    def arrays(self, kind: str) -> dict[str, FloatArray | IntArray]:
        """What a file keeps, each name beginning with the kind of region; see `of_arrays`."""
        of_traits = {f"{kind}_{name}": getattr(self.traits, name) for name in Traits.__dataclass_fields__}
        return {
            f"{kind}_groups": np.array(self.n_groups),
            f"{kind}_side": self.side,
            f"{kind}_noise": self.noise,
            **of_traits,
        }

    @classmethod
    def of_arrays(cls, arrays: Mapping[str, FloatArray], kind: str) -> RegionAtlas:
        """From what `arrays` gave."""
        segment, side = (arrays[f"{kind}_{name}"].astype(np.int64) for name in ("segment", "side"))
        area, signature, handedness, distance = (
            arrays[f"{kind}_{name}"] for name in ("area", "signature", "handedness", "distance")
        )
        traits = Traits(segment, area, signature, handedness, distance)
        return cls(int(arrays[f"{kind}_groups"]), traits, side, arrays[f"{kind}_noise"])

    def named(self, found: Traits) -> IntArray:
        """(r',) the atlas' region that each found one is; those that are none are numbered on from there.

        Within each segment as the differences are smallest in sum (Hungarian method): of area, mean signature,
        handedness, and of distance to the regions that have a name. The surest segment comes first.
        """
        known = self.traits
        alone = self._differences(found)
        name = np.full(len(found.segment), -1)
        open_segments = {int(s) for s in np.unique(found.segment) if (known.segment == s).any()}
        ours = {s: np.flatnonzero(known.segment == s) for s in open_segments}
        theirs = {s: np.flatnonzero(found.segment == s) for s in open_segments}

        def costs(s: int) -> FloatArray:
            return alone[np.ix_(ours[s], theirs[s])] + self._displacements(found, name, ours[s], theirs[s])

        def settle(s: int) -> None:
            rows, columns = linear_sum_assignment(costs(s))
            name[theirs[s]] = -1
            name[theirs[s][columns]] = ours[s][rows]

        every = sorted(open_segments)
        while open_segments:
            surest = max(sorted(open_segments), key=lambda s: _margin(costs(s)))
            settle(surest)
            open_segments.remove(surest)
        for _ in range(SWEEPS):
            before = name.copy()
            for s in every:
                settle(s)
            if (name == before).all():
                break
        new = name < 0
        name[new] = len(known.segment) + np.arange(np.count_nonzero(new))
        return name

    def _differences(self, found: Traits) -> FloatArray:
        """(r, r') how unlike each known and each found region are, by themselves."""
        area, signature, handedness, _ = self.noise
        known = self.traits
        areas = np.subtract.outer(np.log(known.area), np.log(found.area)) / area
        signatures = cdist(known.signature / signature, found.signature / signature)
        hands = cdist(known.handedness / handedness, found.handedness / handedness)
        return np.asarray(areas**2 + signatures**2 + hands**2)

    def _displacements(self, found: Traits, name: IntArray, ours: IntArray, theirs: IntArray) -> FloatArray:
        """(len(ours), len(theirs)) by how much distances to regions with a name differ, those of `theirs` apart."""
        placed = np.setdiff1d(np.flatnonzero(name >= 0), theirs)
        if not len(placed):
            return np.zeros((len(ours), len(theirs)))
        known = self.traits
        weights = known.area[name[placed]] / known.area[name[placed]].sum()
        expected, measured = known.distance[np.ix_(ours, name[placed])], found.distance[np.ix_(theirs, placed)]
        squared = ((expected[:, None] - measured) / self.noise[3]) ** 2 @ weights
        # Distances to several regions say more than one, but not as much as if each were told for itself.
        return np.asarray(np.sqrt(len(placed)) * squared)


def sides(centers: FloatArray, segment: IntArray, mirrored: IntArray) -> IntArray:
    """(r,) 1 for regions on the left, −1 for those on the right of which there is one of the same segment opposite.

    Opposite is what mirroring brings close to it; else, of what is bent or turned, what is it in the mirror image.

    Parameters
    ----------
    centers : (r, 3) array
        Of regions in units of the square root of the area, the mirror plane being x = 0.
    segment : (r,) int array
    mirrored : (r,) int array
        Which region each is in the mirror image, r or more for none of them.
    """
    distances = cdist(centers * (-1, 1, 1), centers)
    distances[segment[:, None] != segment] = np.inf
    nearest = distances.argmin(axis=1)
    across = centers[:, 0] * centers[nearest, 0] < 0
    side = _told_apart(centers[:, 0], nearest) * across
    opposite = np.where(mirrored < len(segment), mirrored, np.arange(len(segment)))
    neither = (side == 0) & (side[opposite] == 0)
    return np.where(neither, _told_apart(centers[:, 0], opposite, BENT), side)


def _told_apart(x: FloatArray, opposite: IntArray, least: float = MIDDLE) -> IntArray:
    """(r,) 1 or −1 where a region is that much further left or right than the opposite one, which is opposite to it."""
    apart = x - x[opposite]
    return np.where((opposite[opposite] == np.arange(len(x))) & (np.abs(apart) > least), np.sign(apart), 0).astype(int)


def side_field(pose: Workpiece, side: IntArray) -> FloatArray:
    """(m,) 1 on the left to −1 on the right, by what is near; given the side of each face's region: 1, −1 or 0.

    The share of heat from the left less that from the right, so that what is far from both, as a tail, is as clearly
    in the middle as what lies between them.
    """
    inside = _at_vertices(pose.surface, side % 3, 3)[:, 1:]
    left, right = np.maximum(pose.flows.over(SIDE_REACH).smooth(inside), 0).T
    return pose.surface.to_faces(((left - right) / np.maximum(left + right, LEAST_OVERLAP))[:, None])[:, 0]


def sides_of_parts(
    surface: Surface,
    field: FloatArray,
    polygon_of: IntArray,
    labels: IntArray,
    least_share: float,
    neighbors: FaceAdjacency,
) -> IntArray:
    """(p,) side of each polygon: 1 left, −1 right, 0 for those of parts without one of the same label opposite.

    Parameters
    ----------
    surface : Surface
    field : (m,) array
        What `side_field` gave.
    polygon_of : (m,) int array
        The polygon of each face, −1 for none.
    labels : (p,) int array
        Of the polygons.
    least_share : float
        Parts under this share of the area are on the side of what is next to them.
    neighbors : FaceAdjacency
        Of the polygons.
    """
    original = surface.original
    part = connected_regions(labels, neighbors)
    count = int(part.max()) + 1
    label_of = np.zeros(count, dtype=np.int64)
    label_of[part] = labels
    seen = polygon_of >= 0
    of_faces, weights, values = part[polygon_of[seen]], original.face_areas[seen], field[seen]
    area = np.bincount(of_faces, weights, count)
    total = np.maximum(area, np.finfo(float).tiny)
    mean = np.bincount(of_faces, weights * values, count) / total
    large = area >= least_share * original.area
    sided = np.flatnonzero(large & (np.abs(mean) > SURE))
    alike = np.minimum.outer(area[sided], area[sided]) >= ALIKE * np.maximum.outer(area[sided], area[sided])
    opposite = (label_of[sided][:, None] == label_of[sided]) & (np.outer(mean[sided], mean[sided]) < 0) & alike
    side = np.zeros(count, dtype=np.int64)
    side[sided] = np.sign(mean[sided]) * opposite.any(axis=1)
    centers = original.face_centers[seen]
    for label in np.unique(label_of[~large]):
        ground = np.flatnonzero(large[of_faces] & (label_of[of_faces] == label))
        crumbs = np.flatnonzero(~large[of_faces] & (label_of[of_faces] == label))
        if len(ground) and len(crumbs):
            side[of_faces[crumbs]] = side[of_faces[ground[cKDTree(centers[ground]).query(centers[crumbs])[1]]]]
    return np.asarray(side[part])


def mean_traits(poses: Sequence[Traits]) -> Traits:
    """Means over poses that have the same regions in the same order."""
    return _mean(poses[0], poses, [np.arange(len(poses[0].segment))] * len(poses))


def _mean(first: Traits, poses: Sequence[Traits], names: Sequence[IntArray]) -> Traits:
    """Means over poses of the traits of each of the first one's regions, given the names in each pose."""
    count = len(first.segment)
    area, signature, handedness = np.zeros(count), np.zeros((count, FIELDS)), np.zeros((count, PLANES))
    seen, distance, both = np.zeros(count), np.zeros((count, count)), np.zeros((count, count))
    for pose, name in zip(poses, names, strict=True):
        known = np.flatnonzero(name < count)
        at = name[known]
        seen[at] += 1
        area[at] += np.log(pose.area[known])
        signature[at] += pose.signature[known]
        handedness[at] += pose.handedness[known]
        distance[np.ix_(at, at)] += pose.distance[np.ix_(known, known)]
        both[np.ix_(at, at)] += 1
    some, times = seen > 0, np.maximum(seen, 1)
    return Traits(
        first.segment,
        np.where(some, np.exp(area / times), first.area),
        np.where(some[:, None], signature / times[:, None], first.signature),
        np.where(some[:, None], handedness / times[:, None], first.handedness),
        np.where(both > 0, distance / np.maximum(both, 1), first.distance),
    )


def _spread(mean: Traits, poses: Sequence[Traits], names: Sequence[IntArray]) -> FloatArray:
    """(4,) standard deviation from the mean, over regions and poses, of log area, signature, handedness, distance."""
    squares, count = np.zeros(4), len(mean.segment)
    seen = np.zeros(2)
    for pose, name in zip(poses, names, strict=True):
        known = np.flatnonzero(name < count)
        at = name[known]
        both = np.ix_(known, known), np.ix_(at, at)
        squares += (
            np.sum((np.log(pose.area[known]) - np.log(mean.area[at])) ** 2),
            np.sum((pose.signature[known] - mean.signature[at]) ** 2) / FIELDS,
            np.sum((pose.handedness[known] - mean.handedness[at]) ** 2) / PLANES,
            np.sum((pose.distance[both[0]] - mean.distance[both[1]]) ** 2),
        )
        seen += len(known), len(known) ** 2
    # The mean is of the same poses.
    lost = len(poses) / (len(poses) - 1)
    return np.asarray(np.sqrt(lost * squares / np.maximum(seen[[0, 0, 0, 1]], 1)))


def _scaled(noise: Mapping[str, float], traits: Traits) -> FloatArray:
    """(4,) with that of handedness in units of its root mean square."""
    hands = float(np.sqrt(np.mean(traits.handedness**2))) or 1.0
    return np.array([noise["area"], noise["signature"], noise["handedness"] * hands, noise["distance"]])


def _margin(costs: FloatArray) -> float:
    """By how much the best assignment is better than the next."""
    if min(costs.shape) == 0:
        return np.inf
    rows, columns = linear_sum_assignment(costs)
    best = costs[rows, columns].sum()
    others = []
    for i, j in zip(rows, columns, strict=True):
        without = costs.copy()
        without[i, j] = IMPOSSIBLE
        rows_, columns_ = linear_sum_assignment(without)
        others.append(without[rows_, columns_].sum())
    return float(min(others) - best)


def _at_vertices(surface: Surface, region: IntArray, count: int) -> FloatArray:
    """(n', count) share of the area around each vertex of the surface that belongs to each region."""
    mesh = surface.mesh
    seen = (surface.face_of >= 0) & (region[surface.face_of] >= 0)
    areas, faces, owner = mesh.face_areas[seen], mesh.faces[seen], region[surface.face_of[seen]]
    entries = np.repeat(areas, 3), (faces.ravel(), np.repeat(owner, 3))
    inside: FloatArray = coo_matrix(entries, shape=(mesh.n_vertices, count)).toarray()
    return inside / np.maximum(inside.sum(axis=1, keepdims=True), np.finfo(float).tiny)


def _signed_areas(pose: Workpiece, fields: FloatArray) -> FloatArray:
    """(m', PLANES) signed area that each face covers in the plane of each pair of (n', FIELDS) fields."""
    corners = fields[pose.surface.mesh.faces].astype(np.float64)
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    f, g = np.triu_indices(FIELDS, 1)
    return np.asarray((u[:, f] * v[:, g] - u[:, g] * v[:, f]) / 2 * pose.turned[:, None])
