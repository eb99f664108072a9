"""Which files a batch takes, and what their results are called."""

from __future__ import annotations

import glob
import os
from collections import Counter
from collections.abc import Collection, Sequence
from pathlib import Path

from .errors import BatchError


def inputs_of(given: Sequence[str], suffixes: Collection[str], without: Path) -> list[tuple[Path, Path]]:
    """Files that arguments name, each once: its absolute path, and the folder that it was found from.

    Parameters
    ----------
    given
        Files as they are; folders, in which all files of known formats are meant, at any depth; patterns with `*`, `?`,
        `[…]` and `**` for any depth, of which files of known formats are meant.
    suffixes
        Of known formats, in lower case with their dot.
    without
        A folder that is left out: where results go.

    Raises
    ------
    BatchError
        If an argument names no file.
    """
    found: dict[Path, Path] = {}
    for argument in given:
        path = Path(argument)
        if path.is_dir():
            root, paths = path, sorted(path.rglob("*"))
        elif path.exists():
            found.setdefault(_absolute(path), _absolute(path).parent)
            continue
        elif glob.has_magic(argument):
            root, paths = _plain_part(path), sorted(map(Path, glob.glob(argument, recursive=True)))
        else:
            raise BatchError(f"{argument}: there is no such file or folder")
        known = [each for each in map(_absolute, paths) if each.suffix.lower() in suffixes and each.is_file()]
        known = [each for each in known if _absolute(without) not in each.parents]
        if not known:
            raise BatchError(f"{argument}: there is no file in it that can be read; known are {', '.join(suffixes)}")
        for each in known:
            found.setdefault(each, _absolute(root))
    return list(found.items())


def names_of(inputs: Sequence[tuple[Path, Path]]) -> list[str]:
    """A name for the results of each input, with `/` between folders; no two alike, on any system.

    The path from the folder in which it was found, without its suffix. Where two are alike: from the folder that all
    have in common; if that is not enough, with the suffix; and in the end with a number.
    """
    if not inputs:
        return []
    common = Path(os.path.commonpath([path.parent for path, _ in inputs])) if _one_drive(inputs) else None
    choices = [
        (
            path.relative_to(root).with_suffix("").as_posix(),
            (path.relative_to(common or root).with_suffix("")).as_posix(),
            path.relative_to(common or root).as_posix(),
        )
        for path, root in inputs
    ]
    level = [0] * len(inputs)
    while True:
        names = [of_input[at] for of_input, at in zip(choices, level, strict=True)]
        # Files of one name but for upper and lower case are one file on Windows and macOS.
        count = Counter(name.casefold() for name in names)
        alike = [i for i, name in enumerate(names) if count[name.casefold()] > 1 and level[i] < 2]
        if not alike:
            return _numbered(names)
        for i in alike:
            level[i] += 1


def _numbered(names: Sequence[str]) -> list[str]:
    """Those that are still alike as `name`, `name 2`, …"""
    found: list[str] = []
    taken: set[str] = set()
    for name in names:
        number, free = 1, name
        while free.casefold() in taken:
            number += 1
            free = f"{name} {number}"
        taken.add(free.casefold())
        found.append(free)
    return found


def _absolute(path: Path) -> Path:
    """Absolute and without `..`, but with links as they are: a name is what the user gave."""
    return Path(os.path.abspath(path))


def _plain_part(pattern: Path) -> Path:
    """The folders of a pattern before the first with a wildcard."""
    parts = []
    for part in pattern.parts:
        if glob.has_magic(part):
            break
        parts.append(part)
    return Path(*parts)


def _one_drive(inputs: Sequence[tuple[Path, Path]]) -> bool:
    return len({path.drive for path, _ in inputs}) == 1
