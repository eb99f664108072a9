"""One thread for BLAS, so that results have the same digits on every machine and blocks do not wait for each other.

The matrices here are narrow (tens to hundreds of columns): with two BLAS threads on a busy machine they took up to
seven times as long as with one. Poses run side by side in threads of Python instead. The number of BLAS threads also
changes the order of sums, and so the last digits of a result.

The limit holds for the whole process while a decorated function runs. So it belongs on public functions, which cover
all that they call; a generator's body runs outside the function that made it, and is covered by who reads it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

from threadpoolctl import threadpool_limits

Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")


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
        with threadpool_limits(1, user_api):
            return function(*args, **kwargs)

    return limited
