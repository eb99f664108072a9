"""Where each place of a body lies in its plan: near which tip of a limb, how far out, and where in its mirror symmetry.

Signatures know the shape around a place, and a figure of boxes and clothes has signatures of its own. But a head is in
the mirror plane, a hand at the tip of a limb that begins far from the middle, in any style. All coordinates are for a
body that is symmetric, at rest or nearly so: a body that bends has no such plane.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from ..geometry.creases import FINE, Normals, curvature_across, log_thickness
from ..geometry.heat_flow import Flows
from ..mesh.adjacency import FaceAdjacency
from ..mesh.canonical import order_of_faces
from ..mesh.surface import Surface, prepare_surface
from ..mesh.triangle_mesh import FloatArray, IntArray, TriangleMesh
from .evidence import TIE_CURVATURE, tied_faces
from .patches import patches_of

COORDINATES = 9
"""Number of coordinates of a place; see `BodyPlaces.turned`."""
TURNS = 64
"""Number of directions in the mirror plane that may be the first axis, 32 for each of two mirror images of the plane: a
quarter as many give the same means on thirteen figures and animals."""
MOST_ASYMMETRIC = 0.01
"""Largest mean distance of faces from the mirror images of their counterparts, in units of the square root of the area,
of a body that is symmetric: figures and animals at rest have 0 to 0.008 (a cat 0.019), in poses 0.011 and more."""
LIMB = 0.15
"""Least length of a limb, as a share of the greatest distance from the middle: shorter ones are fingers and ears."""
REST_VERTICES = 4500
"""Least number of vertices of a surface of which only the places count: thickness is then the same as where signatures
were computed as well."""
SMALLEST = 1e-6
"""Least distance and area, against a division by zero."""


@dataclass(frozen=True)
class BodyPlaces:
    """The p patches of a symmetric body, and where they lie in its plan.

    Attributes
    ----------
    patch : (m,) int array
        Patch of each face.
    areas : (p,) array
        Shares of the area.
    beside : (p,) array
        Distance from the mirror plane, in units of its root mean square.
    in_plane : (p, 2) array
        Position in the mirror plane along the body's own axes there, in units of the root mean square distance from the
        middle: a body with its arms down is narrower than one with its arms out, but as tall.
    limbs : (p, 6) array
        What does not depend on directions: mean distance over the surface from all other places, relative to the
        least one; distances from the middle, to the tip of the limb, and from the middle to the beginning of the limb,
        relative to the mean distance from the middle; distance to the tip in units of the limb's length; logarithm of
        the thickness, relative to its mean.
    """

    patch: IntArray
    areas: FloatArray
    beside: FloatArray
    in_plane: FloatArray
    limbs: FloatArray

    @classmethod
    def of(cls, surface: Surface, flows: Flows) -> BodyPlaces | None:
        """Places of a surface; None if it is not symmetric as it stands."""
        original = surface.original
        centers, areas = original.unit_face_centers, original.face_areas / original.area
        normal = _mirror_normal(surface, centers, areas)
        if normal is None:
            return None
        own = FaceAdjacency.of(surface.welded_faces, original.vertices / np.sqrt(original.area))
        ties = tied_faces(surface)[0]
        normals = Normals(surface, flows)
        curvature = np.append(curvature_across(surface, normals.over(FINE), own), np.full(len(ties), TIE_CURVATURE))
        pairs, curvature = _mirrored_too(np.concatenate([own.pairs, ties]), curvature, surface)
        patch = _patches(surface, centers, areas, pairs, curvature)
        count = int(patch.max()) + 1
        of_patches = np.maximum(np.bincount(patch, areas, count), SMALLEST)

        def mean(values: FloatArray) -> FloatArray:
            return np.stack([np.bincount(patch, areas * one, count) for one in values.T], axis=1) / of_patches[:, None]

        shares = of_patches / of_patches.sum()
        points = mean(centers)
        thickness = log_thickness(surface, normals.over(FINE), flows)
        log_thick = mean(surface.to_faces(thickness[:, None]))[:, 0]
        limbs = np.column_stack([_along_limbs(points, shares, patch[pairs]), log_thick - shares @ log_thick])
        offset = points - shares @ points
        beside, in_plane = np.abs(offset @ normal)[:, None], _in_plane(offset, shares, normal)
        return cls(patch, shares, _unit(beside, shares)[:, 0], _unit(in_plane, shares), limbs)

    def turned(self, turn: int) -> FloatArray:
        """(p, COORDINATES) coordinates with one of `TURNS` directions in the mirror plane as the first axis.

        Nothing tells which way is up or to the front: whoever compares bodies tries all turns.
        """
        angle = 2 * np.pi * (turn // 2) / (TURNS // 2)
        first = self.in_plane @ [np.cos(angle), -np.sin(angle)]
        second = self.in_plane @ [np.sin(angle), np.cos(angle)]
        return np.column_stack([self.beside, first, second * (1 - 2 * (turn % 2)), self.limbs])

    def areas_of(self, labels: IntArray, areas: FloatArray, count: int) -> FloatArray:
        """(p, count) share of the whole area of each label in each patch, given (m,) labels, −1 for none, and areas."""
        table = np.zeros((len(self.areas), count))
        said = labels >= 0
        np.add.at(table, (self.patch[said], labels[said]), areas[said] / areas.sum())
        return table


def surface_at_rest(mesh: TriangleMesh) -> Surface:
    """Surface of a mesh of which only the places count, not the signature."""
    return prepare_surface(mesh, REST_VERTICES)


def _mirror_normal(surface: Surface, centers: FloatArray, areas: FloatArray) -> FloatArray | None:
    """(3,) normal of the plane that mirrors a body as it stands; None if none does."""
    if surface.mirror is None:
        return None
    one = np.flatnonzero(surface.mirror.image >= 0)
    other = surface.mirror.image[one]
    between, weights = centers[one] - centers[other], areas[one]
    normal = np.linalg.eigh((between * weights[:, None]).T @ between)[1][:, -1]
    heights = (centers[one] + centers[other]) @ normal
    middle = float(np.average(heights, weights=weights))
    along = between @ normal
    beside = np.linalg.norm(between - along[:, None] * normal, axis=1) + np.abs(heights - middle)
    return normal if float(np.average(beside, weights=weights)) < MOST_ASYMMETRIC else None


def _mirrored_too(pairs: IntArray, curvature: FloatArray, surface: Surface) -> tuple[IntArray, FloatArray]:
    """Pairs of neighbors and curvatures, with their mirror images: of two legs only one may be tied to the hips."""
    assert surface.mirror is not None
    images = surface.mirror.image[pairs]
    has = (images >= 0).all(axis=1)
    return np.concatenate([pairs, images[has]]), np.append(curvature, curvature[has])


def _patches(
    surface: Surface, centers: FloatArray, areas: FloatArray, pairs: IntArray, curvature: FloatArray
) -> IntArray:
    """(m,) patch of each face, found with the faces in an order that depends on the shape alone."""
    assert surface.mirror is not None
    order = order_of_faces(surface.original)
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    image = surface.mirror.image[order]
    image = np.where(image >= 0, place[image], -1)
    neighbors = FaceAdjacency(place[pairs], np.ones(len(pairs)))
    patch = np.empty(len(order), dtype=np.int64)
    patch[order] = patches_of(centers[order], areas[order], neighbors, curvature, image)
    return patch


def _in_plane(offset: FloatArray, shares: FloatArray, normal: FloatArray) -> FloatArray:
    """(p, 2) coordinates in the mirror plane, along the axes in which the body extends most and least there."""
    flat = offset - np.outer(offset @ normal, normal)
    axes = np.linalg.eigh((flat * shares[:, None]).T @ flat)[1][:, :0:-1]
    along = flat @ axes
    # A direction that does not depend on the library's choice of sign.
    return np.asarray(along * np.where(shares @ along**3 < 0, -1.0, 1.0))


def _unit(offset: FloatArray, shares: FloatArray) -> FloatArray:
    """(p, k) offsets whose root mean square length is 1."""
    return np.asarray(offset / max(float(np.sqrt(shares @ np.einsum("ij,ij->i", offset, offset))), SMALLEST))


def _along_limbs(points: FloatArray, shares: FloatArray, pairs: IntArray) -> FloatArray:
    """(p, 5) distances over the surface, from all places and along the limbs; see `BodyPlaces.limbs`."""
    count = len(points)
    touching = np.unique(np.sort(pairs[pairs[:, 0] != pairs[:, 1]], axis=1), axis=0).reshape(-1, 2)
    steps = np.linalg.norm(points[touching[:, 0]] - points[touching[:, 1]], axis=1) + SMALLEST
    distances = dijkstra(coo_matrix((steps, touching.T), shape=(count, count)).tocsr(), directed=False)
    reached = np.isfinite(distances)
    distances[~reached] = distances[reached].max()
    mean = distances @ shares
    outward = distances[int(mean.argmin())]
    tip, base = _limbs(outward, touching)
    unit = max(float(shares @ outward), SMALLEST)
    to_tip = tip - outward
    return np.column_stack([
        mean / max(float(mean.min()), SMALLEST), outward / unit, to_tip / unit, base / unit,
        to_tip / np.maximum(tip - base, SMALLEST),
    ])  # fmt: skip


def _limbs(outward: FloatArray, touching: IntArray) -> tuple[FloatArray, FloatArray]:
    """(p,) distance from the middle of the tip of each place's limb, and of the beginning of the limb.

    Places are added from the outermost inward. Where two groups of them meet that are both as long as a limb, each
    group is a limb that begins here; a place of the trunk has the whole body as its limb, which begins in the middle.
    """
    count, least = len(outward), LIMB * float(outward.max())
    tip, base, whole = outward.copy(), np.full(count, -1.0), np.full(count, float(outward.max()))
    neighbors: list[list[int]] = [[] for _ in range(count)]
    for one, other in touching.tolist():
        neighbors[one].append(other)
        neighbors[other].append(one)
    group_of = np.full(count, -1)
    members: dict[int, list[int]] = {}
    for place in np.argsort(-outward, kind="stable").tolist():
        met = {int(group_of[other]) for other in neighbors[place] if group_of[other] >= 0}
        tops = {group: float(outward[members[group][0]]) for group in met}
        long = [group for group in sorted(met) if tops[group] - outward[place] > least]
        if len(long) > 1:
            for group in long:
                trunk = [one for one in members[group] if base[one] < 0]
                base[trunk], whole[trunk] = outward[place], tops[group]
        tip[place] = max([float(outward[place]), *tops.values()])
        # The outermost place of a group comes first.
        merged = [one for group in sorted(met, key=lambda one: -tops[one]) for one in members.pop(group)] + [place]
        members[place] = merged
        group_of[merged] = place
    return np.where(base >= 0, np.minimum(tip, whole), tip), np.maximum(base, 0.0)
