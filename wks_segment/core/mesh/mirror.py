"""Mirror symmetry of a mesh at rest: the face that is the mirror image of each face."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.spatial import cKDTree

from .canonical import Frame
from .triangle_mesh import FloatArray, IntArray, TriangleMesh

TOLERANCE, FACE_TOLERANCE, HALF_TOLERANCE = 0.003, 0.3, 0.35
"""A face is the mirror image of another if its center is off by less than `TOLERANCE` of the size of the mesh plus
`FACE_TOLERANCE` times the root of its area; if it has no mutually nearest one, plus `HALF_TOLERANCE` times its longest
edge: a square may be cut along the other diagonal, which moves the centers of its halves by a third of a side."""
NEAR_FACES = 6
"""Number of nearest faces among which such a face looks for its mirror image."""
SAMPLED_FACES = 4_000
"""Number of faces by which a plane is ruled out: if less than half of `LEAST_SHARE` of them have an image there."""
LEAST_SHARE = 0.5
"""Least share of the area that must have a mirror image: below, likeness is a coincidence."""
EXACT_SHARE = 0.999
"""Share of the area with a mirror image above which a mesh is symmetric as a whole."""
FIT_REACH, FIT_ROUNDS = 0.05, 4
"""How far from the image of a face another one is looked for when a mirror plane is fitted, in units of the extent of
the mesh, halved in each of so many rounds."""
ON_PLANE = 1e-9
"""Distance from the mirror plane, in the same unit, below which a face lies on it."""
OUTSIDE_PLANE = 0.03
"""Least mean distance of the faces from the mirror plane, in units of the square root of the area: a sheet is its own
mirror image in its plane, which says nothing."""


@dataclass(frozen=True)
class Mirror:
    """The mirror images of m faces or polygons.

    Attributes
    ----------
    image : (m,) int array
        Mirror image of each, −1 for none.
    side : (m,) int array
        1 and −1 on the two sides of the mirror plane, 0 on it.
    """

    image: IntArray
    side: IntArray

    def is_exact(self, areas: FloatArray) -> bool:
        """Whether all is its own mirror image as a whole, given the (m,) areas."""
        return bool(areas[self.image >= 0].sum() >= EXACT_SHARE * areas.sum())

    def mean(self, values: FloatArray) -> FloatArray:
        """(m, …) values, averaged with those of the mirror images."""
        has = self.image >= 0
        result = values.copy()
        result[has] = (values[has] + values[self.image[has]]) / 2
        return result

    def copied(self, labels: IntArray) -> IntArray:
        """(m,) labels with those of one side copied to the other one."""
        second = (self.image >= 0) & (self.side < 0)
        return np.where(second, labels[self.image], labels)

    def of_polygons(self, polygon_of: IntArray, areas: FloatArray, n_polygons: int) -> Mirror:
        """The mirror images of polygons, by those of most of their faces.

        Given the polygon of each face, −1 for none, and the areas of the faces.
        """
        image = np.where(self.image >= 0, polygon_of[self.image], -1)
        seen = np.flatnonzero((polygon_of >= 0) & (image >= 0))
        pairs = coo_matrix((areas[seen], (polygon_of[seen], image[seen])), shape=(n_polygons, n_polygons)).tocsr()
        pairs.sum_duplicates()
        row = np.repeat(np.arange(n_polygons), np.diff(pairs.indptr))
        order = np.lexsort((pairs.indices, -pairs.data, row))
        first = order[np.unique(row[order], return_index=True)[1]]
        found = np.full(n_polygons, -1)
        found[row[first]] = pairs.indices[first]
        mutual = (found >= 0) & (found[found] == np.arange(n_polygons))
        inside = polygon_of >= 0
        side = np.bincount(polygon_of[inside], (areas * self.side)[inside], n_polygons)
        return Mirror(np.where(mutual, found, -1), np.sign(side).astype(np.int64))


def mirror_of(meshes: Sequence[TriangleMesh]) -> Mirror | None:
    """The mirror images of the faces of a mesh in the pose that is most symmetric; None if none is.

    Given the mesh in some poses.
    """
    best, best_share = None, 0.0
    for mesh in meshes:
        found = _mirror(mesh)
        if found is not None:
            share = float(mesh.face_areas[found.image >= 0].sum() / mesh.area)
            if share > best_share + 1e-6:
                best, best_share = found, share
    return best


def mirrored_faces(mesh: TriangleMesh) -> IntArray | None:
    """(m,) mirror image of each face, −1 for a face without one; None for a mesh that is not symmetric."""
    found = _mirror(mesh)
    return None if found is None else found.image


def _mirror(mesh: TriangleMesh) -> Mirror | None:
    """Mirror images of the faces of a mesh; None if it is not symmetric.

    It is the first of `_planes` that mirrors the mesh as a whole, otherwise the one that mirrors most of its area.
    """
    centers, areas = mesh.face_centers, mesh.face_areas
    size = float(np.ptp(mesh.vertices[np.unique(mesh.faces)], axis=0).max())
    tolerance = TOLERANCE * size + FACE_TOLERANCE * np.sqrt(areas)
    points = mesh.vertices[mesh.faces]
    longest = np.linalg.norm(points - np.roll(points, 1, axis=1), axis=2).max(axis=1)
    of_halves = TOLERANCE * size + HALF_TOLERANCE * longest
    # A face and its mirror image are of one size, so that a large one is not taken for small ones beside its image.
    places = np.column_stack([centers, np.sqrt(areas)])
    tree = cKDTree(places)
    best, best_share = None, LEAST_SHARE
    some = slice(None, None, max(1, len(places) // SAMPLED_FACES))
    frame = Frame.of(mesh)
    for plane in _planes(mesh, frame, places, tree):
        if np.average(np.abs(plane.distances(centers)), weights=areas) < OUTSIDE_PLANE * np.sqrt(mesh.area):
            continue
        near = _nearest(tree, plane.images(places[some]), tolerance)[0] < tolerance[some]
        if areas[some][near].sum() < LEAST_SHARE / 2 * areas[some].sum():
            continue
        images = plane.images(places)
        image = _mutual(tree, images, tolerance)
        share = float(areas[image >= 0].sum() / areas.sum())
        if share > best_share + 1e-6:
            best, best_share = (image, images, plane), share
        if best_share >= EXACT_SHARE:
            break
    if best is None:
        return None
    image, images, plane = best
    # Which side is the first one depends on the shape alone, too.
    along = plane.normal @ frame.axes
    distances = plane.distances(centers) * np.sign(along[np.abs(along).argmax()])
    side = np.where(np.abs(distances) < ON_PLANE * size, 0, np.sign(distances)).astype(np.int64)
    return Mirror(_with_halves(image, tree, images, of_halves), side)


@dataclass(frozen=True)
class _Plane:
    """Points x with normal · x = offset, given the (3,) unit normal and the offset."""

    normal: FloatArray
    offset: float

    def distances(self, points: FloatArray) -> FloatArray:
        """(k,) signed distances of points from the plane."""
        return np.asarray(points @ self.normal - self.offset)

    def images(self, places: FloatArray) -> FloatArray:
        """(k, 4) mirror images of places, which are points and a number that stays."""
        images = places.copy()
        images[:, :3] -= 2 * self.distances(places[:, :3])[:, None] * self.normal
        return images


def _planes(mesh: TriangleMesh, frame: Frame, places: FloatArray, tree: cKDTree) -> Iterator[_Plane]:
    """Planes that may be mirror planes of a mesh: across its coordinate axes, and across its own axes.

    The first lie in the middle of its extent. A mirror plane is perpendicular to one of the principal axes; where a
    sword or a ponytail turns these away a little, the plane is moved to where most faces have an image near it.
    """
    corners = mesh.vertices[np.unique(mesh.faces)]
    middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
    yield from (_Plane(axis, float(axis @ middle)) for axis in np.eye(3))
    for axis in frame.axes.T:
        yield _fitted(_Plane(axis, float(axis @ frame.middle)), places, tree)


def _fitted(plane: _Plane, places: FloatArray, tree: cKDTree) -> _Plane:
    """The plane, moved to the middle between faces and those nearest to their images, a few times."""
    some = places[:: max(1, len(places) // SAMPLED_FACES)]
    reach = FIT_REACH * float(np.ptp(places[:, :3], axis=0).max())
    for _ in range(FIT_ROUNDS):
        distance, nearest = tree.query(plane.images(some), distance_upper_bound=reach)
        found = np.isfinite(distance)
        if not found.any():
            break
        one, other = some[found, :3], places[nearest[found], :3]
        between, areas = one - other, some[found, 3] ** 2
        normal = np.linalg.eigh((between * areas[:, None]).T @ between)[1][:, -1]
        middles = (one + other) / 2 @ normal
        plane = _Plane(normal, float(np.median(middles)))
        reach /= 2
    return plane


def is_exact(image: IntArray | None, areas: FloatArray) -> bool:
    """Whether a mesh is its own mirror image as a whole."""
    return image is not None and bool(areas[image >= 0].sum() >= EXACT_SHARE * areas.sum())


def _nearest(tree: cKDTree, images: FloatArray, tolerance: FloatArray) -> tuple[FloatArray, IntArray]:
    """(k,) distance of the face nearest to each image, and the face; infinite and 0 if it is too far to matter."""
    # Without a bound, a search far from all faces looks at most of them.
    distance, nearest = tree.query(images, distance_upper_bound=float(tolerance.max()))
    return distance, np.where(np.isfinite(distance), nearest, 0)


def _mutual(tree: cKDTree, images: FloatArray, tolerance: FloatArray) -> IntArray:
    """(m,) face at the place of each image that in turn has this face as its image; −1 for none."""
    distance, nearest = _nearest(tree, images, tolerance)
    own = np.arange(len(images))
    near = distance < tolerance
    mutual = near & near[nearest] & (nearest[nearest] == own)
    return np.where(mutual, nearest, -1)


def _with_halves(image: IntArray, tree: cKDTree, images: FloatArray, tolerance: FloatArray) -> IntArray:
    """(m,) images with those of faces that have none yet, nearest pairs first.

    The two halves of a square that is cut along the other diagonal are equally near: each takes what the other has
    left.
    """
    result, left = image.copy(), np.flatnonzero(image < 0)
    if not len(left):
        return result
    distances, candidates = tree.query(
        images[left], k=range(1, min(NEAR_FACES, len(images)) + 1), distance_upper_bound=float(tolerance.max())
    )
    first, column = np.nonzero(distances < tolerance[left, None])
    for i in np.argsort(distances[first, column], kind="stable"):
        one, other = int(left[first[i]]), int(candidates[first[i], column[i]])
        if result[one] < 0 and result[other] < 0:
            result[one], result[other] = other, one
    return result
