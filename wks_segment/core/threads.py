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

import os
import re
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import numpy as np
from threadpoolctl import ThreadpoolController

Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")

USUAL_ERRORS: dict[str, Any] = {"divide": "warn", "over": "warn", "under": "ignore", "invalid": "warn"}
"""What NumPy does by default with results that are infinite, not a number, or rounded to zero."""


LOADED_LIBRARIES = Path("/proc/self/maps")
"""Where Linux lists the files that a process has in its memory, libraries among them; other systems have no list."""


class _LoadedLibraries(ThreadpoolController):  # type: ignore[misc]  # which has no types
    """The libraries of this process whose number of threads can be set, found without calls from C.

    On Linux, threadpoolctl has the loader of libraries call a function of Python for each library. The loader is locked
    meanwhile, and the call waits for Python's lock: for ever, if another thread has that and loads a library, as with
    the first import of a package. Blender would stand still (`test_threads.py`). And a signal during such a call, such
    as Ctrl+C, would be lost.
    """

    def _find_libraries_with_dl_iterate_phdr(self) -> None:
        try:
            text = LOADED_LIBRARIES.read_bytes()
        except OSError:
            super()._find_libraries_with_dl_iterate_phdr()
            return
        for path in dict.fromkeys(re.findall(rb"/.*\.so.*", text)):
            self._make_controller_from_path(os.fsdecode(path))


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
        with _LoadedLibraries().limit(limits=1, user_api=user_api), np.errstate(**USUAL_ERRORS):
            return function(*args, **kwargs)

    return limited
