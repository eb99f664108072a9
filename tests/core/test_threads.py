"""One thread for BLAS: neither threads that load libraries nor signals get in its way."""

import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_info

from wks_segment.core.threads import one_blas_thread, one_thread

ROOT = Path(__file__).resolve().parents[2]


def threads_of(api):
    return [library["num_threads"] for library in threadpool_info() if library["user_api"] == api]


def test_blas_has_one_thread_while_a_function_runs():
    import scipy.linalg  # noqa: F401  # which has a BLAS of its own

    before = threads_of("blas")
    assert before
    assert one_blas_thread(threads_of)("blas") == [1] * len(before)
    assert one_thread(threads_of)("blas") == [1] * len(before)
    assert threads_of("blas") == before


def test_rounding_is_as_usual_while_a_function_runs():
    with np.errstate(under="raise"):
        assert one_blas_thread(lambda: np.exp(np.array([-800.0])))()[0] == 0.0


LOADING = """
import _ctypes, sys, threading, time
import numpy, scipy
from pathlib import Path
from wks_segment.core.threads import one_blas_thread

libraries = [str(path) for path in sorted(Path(scipy.__file__).parent.rglob("*.so"))[:40]]
counts = [0, 0]

def limit():
    while True:
        one_blas_thread(lambda: None)()
        counts[0] += 1

def load():
    while True:
        for path in libraries:
            _ctypes.dlclose(_ctypes.dlopen(path, 2))
            counts[1] += 1

for target in (limit, load):
    threading.Thread(target=target, daemon=True).start()
time.sleep(3)
print(*counts, flush=True)
import os
os._exit(0)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="other systems are asked for libraries in another way")
def test_a_thread_that_loads_libraries_does_not_stop_all():
    """As a first import does, while a job runs in a thread."""
    done = subprocess.run(
        [sys.executable, "-c", LOADING], cwd=ROOT, capture_output=True, text=True, timeout=60, check=True
    )
    assert all(int(count) > 10 for count in done.stdout.split()), done.stdout


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no timers that send signals")
def test_no_signal_is_lost_while_libraries_are_looked_up(request):
    class CameError(Exception):
        pass

    def handler(number, frame):
        raise CameError

    before = signal.signal(signal.SIGALRM, handler)
    request.addfinalizer(lambda: signal.signal(signal.SIGALRM, before))
    turn, nothing = random.Random(0), one_blas_thread(lambda: None)
    for _ in range(200):
        deadline = time.monotonic() + 1.0
        with pytest.raises(CameError):  # noqa: PT012  # it comes at any place of the loop
            signal.setitimer(signal.ITIMER_REAL, turn.uniform(0.0005, 0.005))
            while time.monotonic() < deadline:
                nothing()
