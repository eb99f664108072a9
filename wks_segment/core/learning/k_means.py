"""k-means from given centers, with weights.

scikit-learn has it as well, but takes 1.6 s of a processor to import, longer than to learn a small character.
"""

import numpy as np

from ..mesh.triangle_mesh import FloatArray, IntArray

LEAST_SHIFT = 1e-4
"""Sum of the squared shifts of the centers below which k-means ends, relative to the mean variance of the places."""


def k_means(places: FloatArray, shares: FloatArray, centers: FloatArray, rounds: int) -> IntArray:
    """Index of the center that is nearest to each place, after centers have moved to the mean of their places.

    Parameters
    ----------
    places : (n, d) array
    shares : (n,) array
        Weights of the places.
    centers : (k, d) array
        A center without places stays where it is.
    rounds : int
        Most times that the centers move.
    """
    middle = places.mean(axis=0)  # distances keep their digits near the origin
    places, centers = places - middle, centers - middle
    least = LEAST_SHIFT * float(places.var(axis=0).mean())
    nearest = _nearest(places, centers)
    for _ in range(rounds):
        masses = np.bincount(nearest, shares, len(centers))
        sums = np.stack([np.bincount(nearest, shares * of_axis, len(centers)) for of_axis in places.T], axis=1)
        moved = np.where(masses[:, None] > 0, sums / np.where(masses > 0, masses, 1.0)[:, None], centers)
        shift = float(((moved - centers) ** 2).sum())
        before, centers = nearest, moved
        nearest = _nearest(places, centers)
        if shift <= least or np.array_equal(nearest, before):
            break
    return nearest


def _nearest(places: FloatArray, centers: FloatArray) -> IntArray:
    return np.asarray(((centers**2).sum(axis=1) - 2 * places @ centers.T).argmin(axis=1))
