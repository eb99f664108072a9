"""Input files of a batch, and the names of their results."""

from __future__ import annotations

import glob
import os
from collections import Counter
from collections.abc import Collection, Sequence
from pathlib import Path

from .errors import BatchError


def find_inputs(arguments: Sequence[str], suffixes: Collection[str], excluded: Path) -> list[tuple[Path, Path]]:
    """Input files that the arguments name, each once: absolute path, and the folder where the search for it began.

    Parameters
    ----------
    arguments
        Files; folders, which stand for all files of known formats in them, at any depth; patterns with `*`, `?`, `[…]`
        and, for any depth, `**`, which stand for the matching files of known formats.
    suffixes
        File name suffixes of known formats, in lower case, with the dot.
    excluded
        A folder that is not searched: that of the results.

    Raises
    ------
    BatchError
        If an argument names no file.
    """
    roots: dict[Path, Path] = {}
    for argument in arguments:
        path = Path(argument)
        if path.is_dir():
            root, paths = path, sorted(path.rglob("*"))
        elif path.exists():
            roots.setdefault(_absolute(path), _absolute(path).parent)
            continue
        elif glob.has_magic(argument):
            root, paths = _fixed_folders(path), sorted(map(Path, glob.glob(argument, recursive=True)))
        else:
            raise BatchError(f"{argument}: there is no such file or folder")
        files = [file for file in map(_absolute, paths) if file.suffix.lower() in suffixes and file.is_file()]
        files = [file for file in files if _absolute(excluded) not in file.parents]
        if not files:
            raise BatchError(f"{argument}: no file in it can be read; known formats are {', '.join(suffixes)}")
        for file in files:
            roots.setdefault(file, _absolute(root))
    return list(roots.items())


def result_names(inputs: Sequence[tuple[Path, Path]]) -> list[str]:
    """A name for the results of each input, with `/` between folders, unique on all systems.

    It is the path from the folder where the search began, without the suffix. Where two are equal, it is the path from
    the common folder of all inputs; if that does not help, with the suffix, and finally with a number.
    """
    if not inputs:
        return []
    common = Path(os.path.commonpath([path.parent for path, _ in inputs])) if _on_one_drive(inputs) else None
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
        names = [choice[i] for choice, i in zip(choices, level, strict=True)]
        # Names that differ only in case are one file on Windows and macOS.
        counts = Counter(name.casefold() for name in names)
        equal = [i for i, name in enumerate(names) if counts[name.casefold()] > 1 and level[i] < 2]
        if not equal:
            return _numbered(names)
        for i in equal:
            level[i] += 1


def _numbered(names: Sequence[str]) -> list[str]:
    """Names in which equal ones are `name`, `name 2`, …"""
    unique: list[str] = []
    taken: set[str] = set()
    for name in names:
        number, free = 1, name
        while free.casefold() in taken:
            number += 1
            free = f"{name} {number}"
        taken.add(free.casefold())
        unique.append(free)
    return unique


def _absolute(path: Path) -> Path:
    """Absolute path without `..`, in which links are kept, since names come from the path that the user gave."""
    return Path(os.path.abspath(path))


def _fixed_folders(pattern: Path) -> Path:
    """Folders of a pattern before the first one with a wildcard."""
    parts = []
    for part in pattern.parts:
        if glob.has_magic(part):
            break
        parts.append(part)
    return Path(*parts)


def _on_one_drive(inputs: Sequence[tuple[Path, Path]]) -> bool:
    return len({path.drive for path, _ in inputs}) == 1
