"""What all tests share. Helpers in a folder are imported by their file name, so that test folders need not be packages.

Without -v, a line is printed for each file that is done, and for each test that failed: with several processes
(`-n 2 --dist loadfile`) as with one.
"""

import importlib.util
import sys
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

sys.path.insert(0, str(Path(__file__).parent / "core"))
sys.path.insert(0, str(Path(__file__).parent / "batch"))

import tally
from full_disk import small_disk

__all__ = ["small_disk"]  # a fixture

EASY = {"deadline": None, "suppress_health_check": list(HealthCheck), "database": None}
settings.register_profile("default", max_examples=10, derandomize=True, **EASY)
settings.register_profile("fuzz", max_examples=1000, print_blob=True, **EASY)
settings.load_profile("default")

LONGEST = (
    "blender/cli/test_recipes.py", "blender/cli/test_command_batch.py", "batch/test_dask_cluster.py",
    "blender/workflow/test_sides.py", "core/test_segmentation.py", "core/poses/test_signature_cache.py",
    "core/poses/test_pose_cache.py", "core/labeling/test_region_atlas.py", "core/test_ranking.py",
    "blender/workflow/test_background_job.py", "blender/outputs/test_undo_and_clear.py",
)  # fmt: skip
"""Files that take 20 to 60 seconds of a processor. They come first, the longest one before all, so that at the end no
process waits for another one (with `--no-loadscope-reorder`: otherwise the files with most tests come first)."""


def pytest_collection_modifyitems(items):
    place = {Path(__file__).parent / name: i for i, name in enumerate(LONGEST)}
    items.sort(key=lambda item: place.get(item.path, len(LONGEST)))


class LinePerFile:
    """Prints how far the run is whenever all tests of a file have ended."""

    def __init__(self, terminal):
        self.terminal = terminal
        self.left = Counter()
        self.n_tests = self.n_ended = 0
        self.seconds = Counter()
        self.outcomes = {}
        self.reasons = {}

    def begin(self, ids):
        """All tests are known."""
        self.left = Counter(file_of(name) for name in ids)
        self.n_tests = len(ids)

    def pytest_collection_finish(self, session):
        if session.items:  # none in the process that hands out tests to others
            self.begin([item.nodeid for item in session.items])

    @pytest.hookimpl(optionalhook=True)
    def pytest_xdist_node_collection_finished(self, node, ids):
        if not self.n_tests:
            self.begin(ids)

    @pytest.hookimpl(tryfirst=True)
    def pytest_report_teststatus(self, report):
        """The outcome, if it is one, no letter, and the word for the summary."""
        outcome = outcome_of(report)
        return outcome, "", "" if outcome == "passed" else outcome.upper()

    def pytest_runtest_logreport(self, report):
        name, outcome = file_of(report.nodeid), outcome_of(report)
        self.seconds[name] += report.duration
        if outcome:
            self.outcomes.setdefault(name, Counter())[outcome] += 1
        if outcome == "skipped":
            self.reasons.setdefault(name, {})[report.longrepr[2].removeprefix("Skipped: ")] = None
        if report.failed:
            self.terminal.write_line(f"{outcome.upper()} {report.nodeid}", red=True)
        if report.when == "teardown":
            self.n_ended += 1
            self.left[name] -= 1
            if not self.left[name]:
                self.tell(name)

    def tell(self, name):
        counts = ", ".join(f"{count} {kind}" for kind, count in self.outcomes[name].items())
        share = self.n_ended / self.n_tests
        why = f" ({'; '.join(self.reasons[name])})" if name in self.reasons else ""
        self.terminal.write_line(f"[{share:4.0%}] {name}: {counts}{why} in {self.seconds[name]:.1f} s")


def outcome_of(report):
    """As pytest calls it; "" for the part of a test that went well and was not the test itself."""
    if hasattr(report, "wasxfail"):
        return "xfailed" if report.skipped else "xpassed"
    if report.failed:
        return "error" if report.when in ("collect", "setup", "teardown") else "failed"
    return report.outcome if report.when == "call" or report.skipped else ""


def file_of(nodeid):
    return nodeid.split("::")[0]


@pytest.hookimpl(tryfirst=True)
def pytest_sessionstart(session):
    plugins = session.config.pluginmanager
    terminal = plugins.get_plugin("terminalreporter")
    if terminal is not None and session.config.get_verbosity() <= 0:
        plugins.register(LinePerFile(terminal), "line per file")


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session):
    if hasattr(session.config, "workeroutput"):  # one of several processes: the first one prints the table
        session.config.workeroutput["tally"] = tally.counted()


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node):
    tally.add(getattr(node, "workeroutput", {}).get("tally", ()))


def pytest_terminal_summary(terminalreporter):
    for line in tally.table():
        terminalreporter.write_line(line)
    if importlib.util.find_spec("bpy") is None:
        terminalreporter.write_line("bpy is not installed: the tests of the Blender part were left out", yellow=True)
