"""Taught parts by where they lie in the plan of a body, beside their signatures."""

from __future__ import annotations

import numpy as np

from ..learning.body_plan import BodyPlan
from ..mesh.triangle_mesh import FloatArray
from ..parts.body_places import BodyPlaces
from ..poses.pose_cache import Kind, ResultKey, Workpiece

FAINTEST = 1e-12
"""Least posterior whose logarithm counts."""


def with_plan(posteriors: FloatArray, pose: Workpiece, plan: BodyPlan) -> FloatArray:
    """(n', g) posteriors of groups by signatures and plan together.

    Parameters
    ----------
    posteriors : (n', g) array
        By signatures, at the vertices of the surface.
    pose : Workpiece
        A body that bends has no places in the plan, and keeps the posteriors as they are.
    plan : BodyPlan
        Of the g groups.
    """
    places = places_of(pose)
    if places is None:
        return posteriors
    by_plan = pose.surface.from_faces(plan.posteriors(places)[places.patch])
    logs = np.log(np.maximum(by_plan, FAINTEST))
    logs += plan.signature_weight * np.log(np.maximum(posteriors, FAINTEST))
    result = np.exp(logs - logs.max(axis=1, keepdims=True))
    return np.asarray(result / result.sum(axis=1, keepdims=True))


def places_of(pose: Workpiece) -> BodyPlaces | None:
    """Places of a described pose in the plan of a body; None if it is not symmetric."""
    return pose.results.get(ResultKey(Kind.BODY_PLACES), (), lambda: BodyPlaces.of(pose.surface, pose.flows))
