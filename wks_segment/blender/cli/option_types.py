"""Types of options: functions that parse the text of an argument, or raise an error that argparse reports."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any


def named_path(text: str) -> Path:
    """A path; no text would stand for the current folder, and is mostly a variable that was never set."""
    return Path(named(text))


def named(text: str) -> str:
    """A text that is not empty."""
    if not text:
        raise argparse.ArgumentTypeError("the name is empty: is a variable not set?")
    return text


def number_within(number: type[int] | type[float], least: float, most: float) -> Any:
    """Type of a number between two bounds, both included."""

    def parse(text: str) -> float:
        value = number(text)
        if not least <= value <= most:
            raise argparse.ArgumentTypeError(f"must be from {least} to {most}, not {text}")
        return value

    parse.__name__ = "whole number" if number is int else "number"  # argparse has it in its message
    return parse


def number_or_auto(number: Callable[[str], float]) -> Callable[[str], float | str]:
    """Type of a number that can also be the word "auto"."""

    def parse(text: str) -> float | str:
        try:
            return text if text == "auto" else number(text)
        except ValueError:
            raise argparse.ArgumentTypeError(f'must be a whole number or "auto", not {text!r}') from None

    return parse


def several_of(choices: Sequence[str]) -> Callable[[str], set[str]]:
    """Type of one or several choices, separated by commas."""

    def parse(text: str) -> set[str]:
        chosen = text.split(",")
        if not set(chosen) <= set(choices):
            raise argparse.ArgumentTypeError(f"must be one or several of {','.join(choices)}, not {text!r}")
        return set(chosen)

    return parse


def frame_range(text: str) -> tuple[int | None, int | None, int]:
    """Parse FIRST:LAST:COUNT, or COUNT alone, for which first and last are None."""
    parts = text.split(":")
    if len(parts) not in (1, 3) or not all(part.lstrip("-").isdigit() for part in parts) or int(parts[-1]) < 1:
        raise argparse.ArgumentTypeError(f"must be FIRST:LAST:COUNT or COUNT, whole numbers, not {text!r}")
    if len(parts) == 1:
        return None, None, int(text)
    first, last, count = (int(part) for part in parts)
    if last < first:
        raise argparse.ArgumentTypeError(f"the last frame ({last}) is before the first ({first})")
    return first, last, count


def batch_part(text: str) -> tuple[int, int]:
    """Parse I/N, the I-th of N parts of a batch."""
    i, _, n = text.partition("/")
    if not (i.isdecimal() and n.isdecimal() and 1 <= int(i) <= int(n)):
        raise argparse.ArgumentTypeError(f"must be I/N, whole numbers with 1 ≤ I ≤ N, not {text!r}")
    return int(i), int(n)
