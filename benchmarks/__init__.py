"""Measurements. Each command prints a table; `python -m benchmarks.NAME --help` says what it measures."""
