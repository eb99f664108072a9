"""Helpers in a folder are imported by their file name, so that test folders need not be packages."""

import sys
from pathlib import Path

from hypothesis import HealthCheck, settings

sys.path.insert(0, str(Path(__file__).parent / "core"))

import tally

EASY = {"deadline": None, "suppress_health_check": list(HealthCheck), "database": None}
settings.register_profile("default", max_examples=40, derandomize=True, **EASY)
settings.register_profile("fuzz", max_examples=1000, print_blob=True, **EASY)
settings.load_profile("default")


def pytest_terminal_summary(terminalreporter):
    for line in tally.table():
        terminalreporter.write_line(line)
