"""Taught parts by where they lie in the plan of a body, on a mesh whose signatures are unlike all that was learned."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..learning.body_plan import BodyPlan
from ..learning.gaussian_mixture import GaussianMixture
from ..learning.likelihood import comparable_score
from ..learning.standardizer import Standardizer
from ..learning.taught_parts import TaughtParts
from ..mesh.triangle_mesh import FloatArray, IntArray
from ..parts.body_places import BodyPlaces
from ..poses.pose_cache import Kind, ResultKey, Workpiece
from ..spectral.laplacian import unit_area_masses

SIGNATURE_WEIGHT, LEAST_POSTERIOR = 0.1, 1e-12
"""Weight of the logarithm of the posteriors by signatures beside those by the plan, and the least of these: signatures
are much surer than they are right where they are unlike all that was learned."""


def with_plan(
    posteriors: FloatArray, pose: Workpiece, plan: BodyPlan, mixture: GaussianMixture, standardizer: Standardizer
) -> FloatArray:
    """(n', g) posteriors of groups, by the plan as well if signatures are far from the learned ones.

    Parameters
    ----------
    posteriors : (n', g) array
        By signatures, at the vertices of the surface.
    pose : Workpiece
        A body that bends has no places in the plan, and keeps the posteriors as they are.
    plan : BodyPlan
        Of the g groups.
    mixture, standardizer
        Of the model.
    """
    likelihoods = mixture.without_correlations().log_likelihoods(standardizer.transform(pose.signature))
    masses = unit_area_masses(pose.surface.mesh)
    if comparable_score(standardizer, likelihoods, pose.signature, masses / masses.sum()) >= plan.least_score:
        return posteriors
    places = places_of(pose)
    if places is None:
        return posteriors
    by_plan = pose.surface.from_faces(plan.posteriors(places)[places.patch])
    logs = np.log(np.maximum(by_plan, LEAST_POSTERIOR))
    logs += SIGNATURE_WEIGHT * np.log(np.maximum(posteriors, LEAST_POSTERIOR))
    result = np.exp(logs - logs.max(axis=1, keepdims=True))
    return np.asarray(result / result.sum(axis=1, keepdims=True))


def places_of(pose: Workpiece) -> BodyPlaces | None:
    """Places of a described pose in the plan of a body; None if it is not symmetric."""
    return pose.results.get(ResultKey(Kind.BODY_PLACES), (), lambda: BodyPlaces.of(pose.surface, pose.flows))
