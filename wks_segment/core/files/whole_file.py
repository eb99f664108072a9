"""Files that appear whole or not at all: written beside their place, checked, synced to the disk, and then moved there.

The one way in which this program writes files. A full disk does not always raise an error: some of Blender's writers
ignore it.
"""

from __future__ import annotations

import errno
import os
import shutil
import uuid
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from ..message import Message

UNFINISHED_PREFIX = ".wks_segment-"
"""Beginning of the name of a file that is being written. It has none of the letters of the final name, since Blender
replaces some, such as braces."""
DISK_FULL = {errno.ENOSPC, errno.EDQUOT} if hasattr(errno, "EDQUOT") else {errno.ENOSPC}
"""Numbers of the errors that say that there is no space left, on the disk or for this user."""
NO_SPACE = 2**16
"""Bytes of free space below which a disk counts as full: what is left while an incomplete file still takes its part."""

INCOMPLETE = "it was written incompletely: is the disk full, or its quota used up?"


@contextmanager
def whole_file(
    path: str | os.PathLike[str], check: Callable[[Path], None] | None = None, beside: Sequence[str] = (),
    first: Path | None = None,
) -> Iterator[Path]:  # fmt: skip
    """Path of a new file, to be written by the block, which then takes the place of `path`.

    If the block or the check raises an error, what was there stays as it was, and nothing else is left behind.

    Parameters
    ----------
    path : path
    check : callable, optional
        Called with the new file; raises an error if it is not complete.
    beside
        Suffixes of further files that the block may write beside the new one under the same name; they are moved, too.
    first : path, optional
        Path of the new file, without its suffix, on the same disk; by default in the folder of `path`.

    Raises
    ------
    OSError
        If the file cannot be written. It names `path`.
    """
    target = Path(path).resolve()
    if target.exists() and not os.access(target, os.W_OK):
        raise PermissionError(Message("{path} is write-protected", path=target))
    first = target.with_name(f"{UNFINISHED_PREFIX}{uuid.uuid4().hex[:12]}") if first is None else first.resolve()
    unfinished = first.with_name(f"{first.name}{target.suffix}")
    try:
        yield unfinished
        if check is not None:
            check(unfinished)
        # The file itself comes last: once it is there, everything is.
        written = [suffix for suffix in beside if unfinished.with_suffix(suffix).exists()]
        for suffix in [*written, target.suffix]:
            _sync(unfinished.with_suffix(suffix))
        for suffix in [*written, target.suffix]:
            os.replace(unfinished.with_suffix(suffix), target.with_suffix(suffix))
        _sync_folder(target.parent)
    except BaseException as error:
        if isinstance(error, OSError):
            _name_target(error, unfinished, target)
        for left in first.parent.glob(f"{first.name}*"):
            with suppress(OSError):
                left.unlink()
        raise


def write_whole(path: str | os.PathLike[str], content: str | bytes) -> None:
    """Write text, in UTF-8, or bytes to a file that appears whole; OSError, which names it, if that fails."""
    data = content.encode() if isinstance(content, str) else content

    def check(written: Path) -> None:
        if written.stat().st_size != len(data):
            raise incomplete(written)

    with whole_file(path, check) as unfinished:
        unfinished.write_bytes(data)


def incomplete(path: Path, reason: str = INCOMPLETE) -> OSError:
    """The error of a file that is not complete, though no error said so: that the disk is full, or another reason."""
    return no_space(path) if has_no_space(path.parent) else OSError(errno.EIO, reason, str(path))


def no_space(path: Path) -> OSError:
    """The error of a file for which there is no space on the disk."""
    return OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))


def has_no_space(folder: Path) -> bool:
    """Whether the disk of a folder is full."""
    return folder.is_dir() and shutil.disk_usage(folder).free < NO_SPACE


def is_disk_full(error: BaseException | None) -> bool:
    """Whether an error, or one that led to it, says that a disk is full."""
    while error is not None:
        if isinstance(error, OSError) and error.errno in DISK_FULL:
            return True
        error = error.__cause__
    return False


def _sync(path: Path) -> None:
    """Have a file written to the disk. Some network drives report only now that they are full."""
    with path.open("rb+") as file:
        try:
            os.fsync(file.fileno())
        except OSError as error:
            if error.errno in DISK_FULL | {errno.EIO}:
                raise
            # Otherwise the file system cannot do it.


def _sync_folder(folder: Path) -> None:
    """Have the new name of a file written to the disk, where the system can do it."""
    with suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _name_target(error: OSError, unfinished: Path, target: Path) -> None:
    """Have an error name the file that was to be written, and not the one beside it."""
    is_ours = error.filename is None or str(error.filename).startswith(str(unfinished.with_suffix("")))
    if error.errno is not None and is_ours:
        error.filename, error.filename2 = str(target), None
        error.strerror = str(error.strerror).replace(str(unfinished), str(target))
