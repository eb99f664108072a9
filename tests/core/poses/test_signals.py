"""Ctrl+C while threads describe poses: no lock stays locked, and nothing is lost."""

import signal

import pytest
from shapes import icosphere

from wks_segment.core import PoseSegmentation
from wks_segment.core.poses.signals import signals_held


@pytest.fixture(autouse=True)
def interrupts():
    """Ctrl+C raises, also in a shell that ignores it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_a_held_signal_comes_when_it_is_let_in():
    with pytest.raises(KeyboardInterrupt), signals_held() as let_in:  # noqa: PT012  # the call is what raises
        signal.raise_signal(signal.SIGINT)
        held = True
        let_in()
        held = False
    assert held
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_held_signal_comes_at_the_end():
    reached = False
    with pytest.raises(KeyboardInterrupt), signals_held():  # noqa: PT012  # the end of the block is what raises
        signal.raise_signal(signal.SIGINT)
        reached = True
    assert reached


def test_a_signal_ends_the_description_of_poses():
    """It comes while progress is reported, and its handler runs outside of that, where no lock is taken."""
    model, inside, seen = PoseSegmentation(2, n_eigenpairs=10, n_energies=10), [], []

    def report(stage, share):
        inside.append(True)
        signal.raise_signal(signal.SIGINT)
        inside.pop()

    def handler(number, frame):
        seen.append(list(inside))
        raise KeyboardInterrupt

    signal.signal(signal.SIGINT, handler)
    with pytest.raises(KeyboardInterrupt):
        model.describe_all([icosphere(2)] * 3, progress=report)
    assert seen == [[]]
    assert signal.getsignal(signal.SIGINT) is handler
