"""Shares of nested work, reported as shares of the whole."""

import pytest

from wks_segment.core.progress import Progress


@pytest.fixture
def reports():
    return []


@pytest.fixture
def progress(reports):
    return Progress(lambda stage, share: reports.append((stage, share)))


def test_steps_follow_each_other_and_end_at_one(progress, reports):
    with progress.step(0.3, "first") as step:
        step(0.5)
    for _, step in progress.each(["a", "b", "c"], "second"):
        step(0.5)
    assert [stage for stage, _ in reports] == ["first"] * 3 + ["second"] * 9
    shares = [share for _, share in reports]
    assert shares == sorted(shares)
    assert shares[:4] == [0.0, 0.15, 0.3, 0.3]
    assert shares[-1] == 1.0


def test_parts_of_parts_end_exactly_where_the_next_begins(progress, reports):
    inner = progress.part(0.1, 0.7).part(0.2, 1.0)
    inner(1.0)
    progress.part(0.7, 1.0)(0.0)
    assert reports[0][1] == reports[1][1]


def test_function_of_the_share_alone_and_nothing_at_all(reports):
    Progress.of_share(reports.append).part(0.5, 1.0)(0.5)
    assert reports == [0.75]
    Progress.of_share(None)(0.5)
    Progress.of(None)(0.5)


def test_progress_is_passed_on_as_it_is(progress):
    assert Progress.of(progress) is progress
    assert Progress.of_share(progress) is progress


def test_error_of_the_function_ends_the_work():
    def cancel(stage, share):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), Progress(cancel).step(0.5):
        pass


def test_title_contains_the_stage(progress, reports):
    progress.titled("{name}: {stage}", name="horse").part(0.0, 0.5, "mixture")(1.0)
    assert reports == [("horse: mixture", 0.5)]


def test_share_never_falls(progress, reports):
    rising = progress.never_falling()
    for share in (0.2, 0.6, 0.1):
        rising(share)
    assert [share for _, share in reports] == [0.2, 0.6, 0.6]
