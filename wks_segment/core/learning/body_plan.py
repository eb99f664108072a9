"""Where the taught parts lie in the plan of a body: a Gaussian of the coordinates of each part.

A taught part is one place in a body plan, in any style. Where signatures are far from all that was learned, as those of
a figure of boxes and clothes are, this tells the parts of a body that is symmetric.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from ..files.checked_json import DamagedError
from ..mesh.triangle_mesh import FloatArray
from ..parts.body_places import COORDINATES, TURNS, BodyPlaces

SHARED = 0.3
"""Share of the common variances in the covariance of each part, which few bodies show badly: with 0.2 and 0.5, animals
are 0.780 and 0.783 right instead of 0.782, figures 0.607 and 0.610 instead of 0.618 (docs/dev/experiments.md)."""
SIGNATURE_WEIGHT = 0.4
"""Usual weight of signatures, which are surer than they are right on other bodies. With 0.1 animals are best (0.79
instead of 0.78, signatures alone 0.61), with 0.8 realistic people (0.854 instead of 0.850, alone 0.854)."""
LEAST_PLACE_VARIANCE = 1e-3
"""Least variance of a coordinate, whose values are about 1: bodies that are alike may have none."""
LEAST_BODIES = 3
"""Least number of symmetric bodies to learn a plan from: one says nothing of how bodies differ, and others were then
labeled a little worse (Princeton humans, adjusted Rand index 0.756 instead of 0.758)."""


@dataclass(frozen=True)
class BodyPlan:
    """Gaussians of the coordinates of g groups of taught parts.

    Attributes
    ----------
    means : (g, COORDINATES) array
    covariances : (g, COORDINATES, COORDINATES) array
    shares : (g,) array
        Of the area; their sum is 1.
    signature_weight : float
        Weight of the logarithm of posteriors by signatures beside those by the plan.
    """

    means: FloatArray
    covariances: FloatArray
    shares: FloatArray
    signature_weight: float = SIGNATURE_WEIGHT

    @classmethod
    def learned(cls, bodies: Sequence[tuple[BodyPlaces, FloatArray]]) -> BodyPlan | None:
        """The plan of some bodies, each given by its places and the (p, g) area of each group in each patch.

        Bodies may stand in any direction: each one is turned as the others before it. None if there are fewer than
        `LEAST_BODIES`, or a group is on none.
        """
        if len(bodies) < LEAST_BODIES or not np.sum([table.sum(axis=0) for _, table in bodies], axis=0).all():
            return None
        places, tables = [bodies[0][0].turned(0)], [bodies[0][1]]
        for body, table in bodies[1:]:
            plan, some = cls._fitted(np.concatenate(places), np.concatenate(tables)), table.sum(axis=1) > 0
            turns = [body.turned(turn) for turn in range(TURNS)]
            fits = [float((table[some] * plan.log_densities(one[some])).sum()) for one in turns]
            places.append(turns[int(np.argmax(fits))])
            tables.append(table)
        return cls._fitted(np.concatenate(places), np.concatenate(tables))

    @classmethod
    def _fitted(cls, places: FloatArray, weights: FloatArray) -> BodyPlan:
        """Gaussians of places with (n, g) weights; a group without weight is anywhere."""
        total = weights.sum(axis=0)
        everywhere = np.average(places, axis=0, weights=weights.sum(axis=1))
        means, squares = np.empty((len(total), COORDINATES)), np.empty((len(total), COORDINATES, COORDINATES))
        for group, weight in enumerate(total):
            of_group = weights[:, group] if weight > 0 else weights.sum(axis=1)
            means[group] = np.average(places, axis=0, weights=of_group) if weight > 0 else everywhere
            offset = places - means[group]
            squares[group] = (offset * of_group[:, None]).T @ offset / of_group.sum()
        shares = total / total.sum()
        common = np.einsum("g,gii->i", shares, squares)
        covariances = (1 - SHARED) * squares + np.diag(SHARED * common + LEAST_PLACE_VARIANCE)
        return cls(means, covariances, shares)

    def log_densities(self, places: FloatArray) -> FloatArray:
        """(p, g) logarithm of the density of each group at places, up to a constant."""
        offset = places[:, None] - self.means
        precisions = np.linalg.inv(self.covariances)
        squares = np.einsum("pgi,gij,pgj->pg", offset, precisions, offset, optimize=True)
        return np.asarray(-(squares + np.linalg.slogdet(self.covariances)[1]) / 2)

    def posteriors(self, body: BodyPlaces) -> FloatArray:
        """(p, g) posteriors of the groups on the patches of a body, turned as the plan fits best; rows sum to 1."""
        shares = np.log(np.maximum(self.shares, np.finfo(float).tiny))
        best, best_fit = np.zeros((0, 0)), -np.inf
        for turn in range(TURNS):
            joint = self.log_densities(body.turned(turn)) + shares
            total = logsumexp(joint, axis=1)
            fit = float(body.areas @ total)
            if fit > best_fit:
                best, best_fit = np.exp(joint - total[:, None]), fit
        return best

    def arrays(self) -> dict[str, FloatArray]:
        """Arrays for a model file; `of_arrays` reads them."""
        return {f"plan_{name}": np.asarray(value) for name, value in vars(self).items()}

    @classmethod
    def of_arrays(cls, arrays: Mapping[str, FloatArray]) -> BodyPlan | None:
        """The plan in arrays of a model file, if any; DamagedError if a covariance is none."""
        if "plan_means" not in arrays:
            return None
        plan = cls(
            arrays["plan_means"],
            arrays["plan_covariances"],
            arrays["plan_shares"],
            float(arrays["plan_signature_weight"]),
        )
        symmetric = np.allclose(plan.covariances, plan.covariances.swapaxes(1, 2))
        if not symmetric or np.linalg.eigvalsh(plan.covariances).min() <= 0:
            raise DamagedError("plan_covariances are no covariances")
        return plan
