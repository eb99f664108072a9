"""One file of a batch: what is to be done with it, and what came of it."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal


@dataclass(frozen=True)
class Job:
    """One call of the command line.

    Attributes
    ----------
    input : str
        The file, by its absolute path.
    name : str
        Of its results, see `names_of`.
    command : str
    arguments : tuple of str
        Behind the command and the file.
    outputs : dict
        Option of the command to the file that it writes, relative to the folder of the batch.
    key : str
        Another one if the file or anything that enters its results differs; see `key_of`.
    """

    input: str
    name: str
    command: str
    arguments: tuple[str, ...]
    outputs: Mapping[str, str]
    key: str

    def call(self, folder: Path) -> list[str]:
        """The arguments of the command line that writes to a folder."""
        outputs = [f"{option}={folder / path}" for option, path in self.outputs.items()]
        return [self.command, self.input, *self.arguments, *outputs]


@dataclass(frozen=True)
class Outcome:
    """What came of a job: one line of the list.

    Attributes
    ----------
    input, name, key
        As in the job.
    status : "done" or "failed"
    reason : str
        Why it failed; empty if it did not.
    seconds : float
    outputs : dict
        Option to file, relative to the folder of the batch.
    place : str
        Folder in which the results are written first; empty if there are none.
    machine : str
        Where it was done.
    result : dict
        What the command printed.
    """

    input: str
    name: str
    key: str
    status: Literal["done", "failed"]
    reason: str = ""
    seconds: float = 0.0
    outputs: Mapping[str, str] = field(default_factory=dict)
    place: str = ""
    machine: str = ""
    result: Mapping[str, Any] = field(default_factory=dict)

    @property
    def done(self) -> bool:
        """Whether there are results."""
        return self.status == "done"

    def line(self) -> str:
        """As JSON, in one line."""
        return json.dumps(_plain(asdict(self)), ensure_ascii=False, allow_nan=False)

    @classmethod
    def of_line(cls, line: str) -> Outcome | None:
        """What `line` gave; None for what is none, as a line that was not written to its end."""
        try:
            values = json.loads(line)
            outcome = cls(**values)
        except (ValueError, TypeError):
            return None
        texts = (outcome.input, outcome.name, outcome.key, outcome.place, *outcome.outputs.values())
        return outcome if all(isinstance(text, str) for text in texts) else None


def key_of(path: Path, settings: Sequence[str]) -> str:
    """A name for what comes of a file with settings: by its path, size and time of change, and all that they say."""
    state = path.stat()
    told = json.dumps([path.as_posix(), state.st_size, state.st_mtime_ns, *settings])
    return hashlib.blake2b(told.encode(), digest_size=12).hexdigest()


def content_of(path: Path) -> str:
    """A name for the content of a model's file, or of all models of a folder."""
    digest = hashlib.blake2b(digest_size=12)
    for each in sorted(path.glob("*.json")) if path.is_dir() else [path]:
        if each.is_file():
            digest.update(each.name.encode() + b"\0" + each.read_bytes())
    return digest.hexdigest()


def _plain(value: Any) -> Any:
    """Without numbers that JSON does not know."""
    if isinstance(value, Mapping):
        return {str(name): _plain(each) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
