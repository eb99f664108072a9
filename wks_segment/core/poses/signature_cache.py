"""Signatures, and what else takes time, that were computed before, by the content of what they were computed from.

A cache is given to `describe_all`; there is none unasked. In memory for one process, on disk for several.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
import threading
import time
import zipfile
import zlib
from collections import OrderedDict
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..mesh.surface import Connection
from ..mesh.triangle_mesh import TriangleMesh
from .pose_signature import PoseSignature

VERSION = 1
"""To be raised whenever the same mesh and settings give another signature than before."""
MEMORY = 1_000_000_000
"""Bytes that a cache in memory holds at most, if nothing else is said …"""
DISK = 10_000_000_000
"""… and one on disk."""
SUFFIX, UNFINISHED = ".npz", ".part"
ABANDONED = 3600.0
"""Seconds after which an unfinished file is of a process that is no more."""


class SignatureCache(Protocol):
    """Where signatures are kept. Several threads may ask at once."""

    def get(self, key: str) -> PoseSignature | None:
        """What was put there under a key; None if nothing, or nothing any more."""
        ...

    def put(self, key: str, signature: PoseSignature) -> None:
        """Keep a signature under a key."""
        ...


class Cache(SignatureCache, Protocol):
    """Where arrays of any kind are kept, signatures among them."""

    def arrays(self, key: str) -> Mapping[str, NDArray[Any]] | None:
        """What `keep` was given under a key; None if nothing, or nothing any more."""
        ...

    def keep(self, key: str, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Keep arrays under a key; they must not be changed any more."""
        ...


def signature_key(mesh: TriangleMesh, connection: Connection, settings: Mapping[str, str | int]) -> str:
    """A name for the signature of a mesh with settings: another one if anything that enters it differs.

    By content as it is: the same mesh elsewhere in space is another one.
    """
    digest = hashlib.blake2b(digest_size=20)
    digest.update(repr((VERSION, sorted(settings.items()))).encode())
    arrays = {**mesh.arrays(), "welded": connection.welded, "kept": connection.kept, "ties": connection.ties}
    for name, array in arrays.items():
        # Shapes keep apart what would be the same row of bytes.
        digest.update(repr((name, array.shape, array.dtype.str)).encode())
        digest.update(np.ascontiguousarray(array).data)
    return digest.hexdigest()


class MemoryCache:
    """Signatures in memory, of which the least recently used leave first.

    Parameters
    ----------
    limit : int
        Bytes at most. What is larger alone is not kept.
    """

    def __init__(self, limit: int = MEMORY) -> None:
        self.limit = limit
        self._kept: OrderedDict[str, tuple[Any, int]] = OrderedDict()
        self._lock = threading.Lock()

    @property
    def size(self) -> int:
        """Bytes that are held."""
        with self._lock:
            return sum(size for _, size in self._kept.values())

    def get(self, key: str) -> PoseSignature | None:
        """See `SignatureCache`."""
        found = self._found(key)
        return found if isinstance(found, PoseSignature) else None

    def put(self, key: str, signature: PoseSignature) -> None:
        """See `SignatureCache`."""
        signature.signature.setflags(write=False)  # all who ask get the same one
        self._keep(key, signature, signature.arrays())

    def arrays(self, key: str) -> Mapping[str, NDArray[Any]] | None:
        """See `Cache`."""
        found = self._found(key)
        return found if isinstance(found, dict) else None

    def keep(self, key: str, arrays: Mapping[str, NDArray[Any]]) -> None:
        """See `Cache`."""
        for array in arrays.values():
            array.setflags(write=False)
        self._keep(key, dict(arrays), arrays)

    def _found(self, key: str) -> object:
        with self._lock:
            if key not in self._kept:
                return None
            self._kept.move_to_end(key)
            return self._kept[key][0]

    def _keep(self, key: str, what: object, arrays: Mapping[str, NDArray[Any]]) -> None:
        with self._lock:
            self._kept.pop(key, None)
            self._kept[key] = what, sum(array.nbytes for array in arrays.values())
            held = sum(size for _, size in self._kept.values())
            while held > self.limit:
                held -= self._kept.popitem(last=False)[1][1]

    def clear(self) -> None:
        """Forget all."""
        with self._lock:
            self._kept.clear()


class DiskCache:
    """Signatures in the files of a folder, of which the least recently used are removed first.

    Several processes may use the folder at once: a file appears whole or not at all, and one that is damaged counts as
    none.

    Parameters
    ----------
    folder : path
        Made if it is not there. Nothing else should be in it.
    limit : int
        Bytes at most, but for what others are writing.
    """

    def __init__(self, folder: str | os.PathLike[str], limit: int = DISK) -> None:
        self.folder = Path(folder)
        self.limit = limit
        self.folder.mkdir(parents=True, exist_ok=True)

    def get(self, key: str) -> PoseSignature | None:
        """See `SignatureCache`."""
        try:
            arrays = self.arrays(key)
            return None if arrays is None else PoseSignature.of_arrays(arrays)
        except (ValueError, KeyError):
            return None

    def put(self, key: str, signature: PoseSignature) -> None:
        """See `SignatureCache`; OSError if the file cannot be written."""
        self.keep(key, signature.arrays())

    def arrays(self, key: str) -> Mapping[str, NDArray[Any]] | None:
        """See `Cache`."""
        path = self._path(key)
        try:
            with np.load(path, allow_pickle=False) as arrays:
                found = dict(arrays)
            os.utime(path)
        except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile, zlib.error):
            return None
        return found

    def keep(self, key: str, arrays: Mapping[str, NDArray[Any]]) -> None:
        """See `Cache`; OSError if the file cannot be written."""
        with tempfile.NamedTemporaryFile(dir=self.folder, suffix=UNFINISHED, delete=False) as file:
            unfinished = Path(file.name)
            try:
                np.savez(file, **arrays)
            except BaseException:
                file.close()
                unfinished.unlink()
                raise
        try:
            unfinished.replace(self._path(key))
        except PermissionError:  # Windows, while another process reads the same: it is there, then
            unfinished.unlink()
        self._tidy()

    def _path(self, key: str) -> Path:
        return self.folder / f"{key}{SUFFIX}"

    def _tidy(self) -> None:
        """Remove what is too much, and what was abandoned. Others may do so at the same time."""
        files = []
        for path in self.folder.iterdir():
            with suppress(FileNotFoundError):
                state = path.stat()
                if path.suffix == SUFFIX:
                    files.append((state.st_mtime_ns, state.st_size, path))
                elif path.suffix == UNFINISHED and state.st_mtime < time.time() - ABANDONED:
                    path.unlink()
        held = sum(size for _, size, _ in files)
        for _, size, path in sorted(files):
            if held <= self.limit:
                break
            with suppress(FileNotFoundError, PermissionError):
                path.unlink()
            held -= size
