"""Caches of signatures, and of other results that take long, by the content of their inputs.

Nothing is cached unless a cache is passed to `describe_all` or `fit`: one in memory for one process, or one on disk for
several.
"""

from __future__ import annotations

import hashlib
import os
import struct
import threading
import time
import zipfile
import zlib
from collections import OrderedDict
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from stat import S_ISREG
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..files.whole_file import UNFINISHED_PREFIX, whole_file
from ..mesh.surface import Connection
from ..mesh.triangle_mesh import TriangleMesh
from .pose_signature import PoseSignature

SIGNATURE_VERSION = 3
"""To be raised whenever the same mesh and settings give another signature than before."""
MEMORY = 1_000_000_000
"""Default limit of a cache in memory, in bytes: about 100 poses of 10,000 vertices."""
DISK = 10_000_000_000
"""Default limit of a cache on disk, in bytes."""
CACHE_SUFFIX = ".npz"
DIGEST = "digest"
"""Array of a file with the digest of its key and of all other arrays."""
ABANDONED = 3600.0
"""An unfinished file that is older than this, in seconds, was left by a process that has died: writing one takes
seconds."""
DAMAGES = (
    OSError, ValueError, KeyError, EOFError, MemoryError, RuntimeError, TypeError, SyntaxError, zipfile.BadZipFile,
    zlib.error, struct.error,
)  # fmt: skip
"""What NumPy raises for a file that is damaged, in its archive or in the header of an array."""


class SignatureCache(Protocol):
    """A cache of signatures. Several threads may use it at once.

    Examples
    --------
    >>> from wks_segment.core import MemoryCache, SignatureCache
    >>> cache: SignatureCache = MemoryCache(limit=10**8)  # or a `DiskCache`, or one of your own with these methods
    """

    def get(self, key: str) -> PoseSignature | None:
        """The signature under a key; None if there is none, or no longer one."""
        ...

    def put(self, key: str, signature: PoseSignature) -> None:
        """Keep a signature under a key."""
        ...


class Cache(SignatureCache, Protocol):
    """A cache of arrays of any kind, including signatures.

    Examples
    --------
    >>> from wks_segment.core import Cache, MemoryCache
    >>> cache: Cache = MemoryCache(limit=10**8)  # or a `DiskCache`, or one of your own with these methods
    """

    def arrays(self, key: str) -> Mapping[str, NDArray[Any]] | None:
        """The arrays that `keep` stored under a key; None if there are none, or no longer any."""
        ...

    def keep(self, key: str, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Keep arrays under a key; the caller must not change them afterward."""
        ...


def signature_key(mesh: TriangleMesh, connection: Connection, settings: Mapping[str, str | int]) -> str:
    """Cache key of a signature: another key if the mesh, its connection or a setting differs in any bit.

    The same mesh at another place in space has another key.
    """
    return content_key((SIGNATURE_VERSION, sorted(settings.items())), mesh.arrays(), connection.arrays())


def content_key(description: object, *groups: Mapping[str, NDArray[Any]]) -> str:
    """Hash of a description, by its `repr`, and of all bytes of named arrays."""
    digest = hashlib.blake2b(digest_size=20)
    digest.update(repr(description).encode())
    for arrays in groups:
        for name, array in arrays.items():
            # Arrays of other shapes can have the same bytes.
            digest.update(repr((name, array.shape, array.dtype.str)).encode())
            digest.update(np.ascontiguousarray(array).data)
    return digest.hexdigest()


class MemoryCache:
    """Cache in memory; the least recently used entries are dropped first.

        cache = MemoryCache()
        six, four = (PoseSegmentation(n).fit(meshes, cache=cache) for n in (6, 4))  # the second takes a fraction

    Parameters
    ----------
    limit : int
        Maximum size in bytes. A larger single entry is not kept.

    Examples
    --------
    >>> from examples.tube import tube
    >>> from wks_segment.core import MemoryCache, PoseSegmentation
    >>> cache, model = MemoryCache(), PoseSegmentation(n_segments=2, n_eigenpairs=40)
    >>> first = model.describe_all([tube(0.5)], cache=cache)
    >>> again = model.describe_all([tube(0.5)], cache=cache)  # takes no time
    >>> bool((first[0].signature == again[0].signature).all())
    True
    """

    def __init__(self, limit: int = MEMORY) -> None:
        self.limit = limit
        self._entries: OrderedDict[str, tuple[Any, int]] = OrderedDict()
        self._lock = threading.Lock()

    @property
    def size(self) -> int:
        """Size of all entries in bytes."""
        with self._lock:
            return self._size()

    def get(self, key: str) -> PoseSignature | None:
        """See `SignatureCache`."""
        entry = self._entry(key)
        return entry if isinstance(entry, PoseSignature) else None

    def put(self, key: str, signature: PoseSignature) -> None:
        """See `SignatureCache`."""
        signature.signature.setflags(write=False)  # every caller of `get` receives the same array
        self._add(key, signature, signature.arrays())

    def arrays(self, key: str) -> Mapping[str, NDArray[Any]] | None:
        """See `Cache`."""
        entry = self._entry(key)
        return entry if isinstance(entry, dict) else None

    def keep(self, key: str, arrays: Mapping[str, NDArray[Any]]) -> None:
        """See `Cache`."""
        for array in arrays.values():
            array.setflags(write=False)
        self._add(key, dict(arrays), arrays)

    def clear(self) -> None:
        """Drop all entries."""
        with self._lock:
            self._entries.clear()

    def _entry(self, key: str) -> object:
        with self._lock:
            if key not in self._entries:
                return None
            self._entries.move_to_end(key)
            return self._entries[key][0]

    def _add(self, key: str, entry: object, arrays: Mapping[str, NDArray[Any]]) -> None:
        with self._lock:
            self._entries.pop(key, None)
            self._entries[key] = entry, sum(array.nbytes for array in arrays.values())
            size = self._size()
            while size > self.limit:
                size -= self._entries.popitem(last=False)[1][1]

    def _size(self) -> int:
        return sum(size for _, size in self._entries.values())


class DiskCache:
    """Cache in the files of a folder; the least recently used files are removed first.

    Several processes and users may use the folder at once: a file appears as a whole or not at all, and can be read by
    all who can read other new files of its user (`umask`). A file is used only if it has the digest of its key and its
    arrays: one that is damaged, altered or renamed counts as missing and is replaced.

    Parameters
    ----------
    folder : path
        Created if it does not exist. It should contain nothing else.
    limit : int
        Maximum size in bytes, not counting files that other processes are writing.

    Examples
    --------
    >>> import tempfile
    >>> from examples.tube import tube
    >>> from wks_segment.core import DiskCache, PoseSegmentation
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     cache = DiskCache(folder, limit=10**8)
    ...     model = PoseSegmentation(n_segments=2, n_eigenpairs=40)
    ...     _ = model.describe_all([tube(0.5)], cache=cache)
    """

    def __init__(self, folder: str | os.PathLike[str], limit: int = DISK) -> None:
        self.folder = Path(folder)
        self.limit = limit
        self.folder.mkdir(parents=True, exist_ok=True)

    def get(self, key: str) -> PoseSignature | None:
        """See `SignatureCache`."""
        arrays = self.arrays(key)
        return None if arrays is None else PoseSignature.of_arrays(arrays)

    def put(self, key: str, signature: PoseSignature) -> None:
        """See `SignatureCache`; OSError if the file cannot be written."""
        self.keep(key, signature.arrays())

    def arrays(self, key: str) -> Mapping[str, NDArray[Any]] | None:
        """See `Cache`."""
        path = self._path(key)
        if not path.is_file():  # a pipe would be read forever
            return None
        try:
            with np.load(path, allow_pickle=False) as file:
                arrays = dict(file)
            digest = str(arrays.pop(DIGEST))
        except DAMAGES:
            return None
        if digest != content_key(key, arrays):
            return None
        with suppress(OSError):  # the file of another user can be read, but not marked as used
            os.utime(path)
        return arrays

    def keep(self, key: str, arrays: Mapping[str, NDArray[Any]]) -> None:
        """See `Cache`; OSError if the file cannot be written."""
        path = self._path(key)
        try:
            with whole_file(path) as unfinished:
                np.savez(unfinished, **arrays, **{DIGEST: np.array(content_key(key, arrays))})
        except (PermissionError, IsADirectoryError):
            # Something is there that is another user's, or a folder, or on Windows read by another process.
            if not path.exists():
                raise
        self._remove_old_files()

    def _path(self, key: str) -> Path:
        return self.folder / f"{key}{CACHE_SUFFIX}"

    def _remove_old_files(self) -> None:
        """Remove files above the limit, and abandoned ones. Other processes may do so at the same time."""
        files = []
        for path in self.folder.iterdir():
            with suppress(FileNotFoundError, PermissionError):
                state = path.stat()
                if path.name.startswith(UNFINISHED_PREFIX):
                    if state.st_mtime < time.time() - ABANDONED:
                        path.unlink()
                elif path.suffix == CACHE_SUFFIX and S_ISREG(state.st_mode):
                    files.append((state.st_mtime_ns, state.st_size, path))
        total = sum(size for _, size, _ in files)
        for _, size, path in sorted(files):
            if total <= self.limit:
                break
            with suppress(FileNotFoundError, PermissionError):
                path.unlink()
            total -= size
