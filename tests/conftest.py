"""Helpers in a folder are imported by their file name, so that test folders need not be packages."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "core"))
