"""From how many starts mixtures are learned: few in most tests, all where the quality of what is learned is tested.

Two thirds of the time of learning from a small mesh go into the starts and the comparison of the mixtures that they
end in. What a test asks of a model is seldom how good it is: then a mixture of two starts will do.
"""

import contextlib
import importlib

LEARNING = "wks_segment.core.learning"
FEW = {f"{LEARNING}.gaussian_mixture": {"SEEDS": range(2)}, f"{LEARNING}.model_selection": {"CANDIDATES_PER_TYPE": 1}}
"""Constants by module: two starts, so that there is one to be chosen, and the better one of each covariance type."""


def used():
    """The constants as they are now."""
    return {
        module: {name: getattr(importlib.import_module(module), name) for name in values}
        for module, values in FEW.items()
    }


def use(constants):
    for module, values in constants.items():
        vars(importlib.import_module(module)).update(values)


@contextlib.contextmanager
def with_starts(constants):
    """Constants for a while; they are in use where `with` begins, and what was before where it ends."""
    before = used()
    use(constants)
    try:
        yield before
    finally:
        use(before)


ALL = {}
"""The constants of the package, once few of them are in use; none before."""


@contextlib.contextmanager
def few_starts():
    """For all tests of a process."""
    with with_starts(FEW) as before:
        ALL.update(before)
        yield


@contextlib.contextmanager
def all_starts():
    """As outside of tests: for what asks how good a model is."""
    with with_starts(ALL):
        yield
