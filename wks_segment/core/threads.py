"""One thread for BLAS and NumPy's usual rounding, so that results are the same wherever the code runs.

The matrices here are narrow (tens to hundreds of columns): with two BLAS threads on a busy machine they took up to
seven times as long as with one. Poses run side by side in threads of Python instead. The number of BLAS threads also
changes the order of sums, and so the last digits of a result.

Other code of the process may have told NumPy to raise an error where a number is rounded to zero (`numpy.seterr`).
Likelihoods far from a component are rounded to zero all the time, so this is set back meanwhile.

Both hold while a decorated function runs, the limit for the whole process. So they belong on public functions, which
cover all that they call; a generator's body runs outside the function that made it, and is covered by who reads it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec, TypeVar

import numpy as np
from threadpoolctl import threadpool_limits

Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")

USUAL_ERRORS: dict[str, Any] = {"divide": "warn", "over": "warn", "under": "ignore", "invalid": "warn"}
"""What NumPy does by default with results that are infinite, not a number, or rounded to zero."""


def one_blas_thread(function: Callable[Parameters, Result]) -> Callable[Parameters, Result]:
    """Decorate a public function: BLAS uses one thread while it runs."""
    return _limited(function, "blas")


def one_thread(function: Callable[Parameters, Result]) -> Callable[Parameters, Result]:
    """Decorate a public function: BLAS and OpenMP, which scikit-learn's k-means uses, have one thread while it runs."""
    return _limited(function, None)


def _limited(function: Callable[Parameters, Result], user_api: str | None) -> Callable[Parameters, Result]:
    @wraps(function)
    def limited(*args: Parameters.args, **kwargs: Parameters.kwargs) -> Result:
        # Libraries are looked up at each call: some are loaded only after this module.
        with threadpool_limits(1, user_api), np.errstate(**USUAL_ERRORS):
            return function(*args, **kwargs)

    return limited
