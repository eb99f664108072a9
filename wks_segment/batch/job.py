"""One job of a batch and its outcome."""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

from ..core.files.whole_file import UNFINISHED_PREFIX

SCENE = "--output"
"""Option of the file of a scene."""


@dataclass(frozen=True)
class Job:
    """One call of the command line for one file.

    Attributes
    ----------
    input : str
        Absolute path of the file.
    name : str
        Name of its results; see `result_names`.
    command : str
    arguments : tuple of str
        Arguments after the command and the file.
    outputs : dict
        Option of the command to the file that it writes, relative to the folder of the batch.
    key : str
        Hash of the file's state and of everything else that its results depend on; see `job_key`.
    """

    input: str
    name: str
    command: str
    arguments: tuple[str, ...]
    outputs: Mapping[str, str]
    key: str

    def arguments_for(self, folder: Path, place: Path | None) -> list[str]:
        """Arguments of the command line that make it write its outputs to a folder.

        Parameters
        ----------
        folder : path
            Its name begins with the job's key.
        place : path or None
            Result of `place_of_scene`.
        """
        outputs = [f"{option}={folder / path}" for option, path in self.outputs.items()]
        if place is not None:
            outputs.append(f"--unfinished={place / UNFINISHED_PREFIX}{folder.name}")
        return [self.command, self.input, *self.arguments, *outputs]

    def place_of_scene(self, batch_folder: Path) -> Path | None:
        """Folder for the file of the scene; None if the job writes none.

        It is written there, then moved to the folder of unfinished results, then moved back: Blender stores where
        images and libraries are relative to the folder in which it writes.
        """
        return (batch_folder / self.outputs[SCENE]).parent if SCENE in self.outputs else None


@dataclass(frozen=True)
class Outcome:
    """Outcome of a job: one line of the log.

    Attributes
    ----------
    input, name, key
        As in the job.
    status : "done" or "failed"
    reason : str
        Why the job failed; empty if it is done.
    seconds : float
        Duration of the job.
    outputs : dict
        Option to file, relative to the folder of the batch.
    place : str
        Name of the folder in which the results were written first; empty if there are none.
    machine : str
        Host name of the machine that ran the job.
    result : dict
        Fields of the command's result.
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
        """Whether the job has results."""
        return self.status == "done"

    def to_line(self) -> str:
        """The outcome as one line of JSON."""
        values = _finite(asdict(self))
        line = json.dumps(values, ensure_ascii=False, allow_nan=False)
        # A file name that is not UTF-8 has letters that only JSON of ASCII can hold.
        return line if _is_utf8(line) else json.dumps(values, allow_nan=False)

    @classmethod
    def from_line(cls, line: str) -> Outcome | None:
        """Outcome from a line of the log; None if the line is none, for example incomplete."""
        try:
            values = json.loads(line)
            outcome = cls(**values)
        except (ValueError, TypeError):
            return None
        texts = (outcome.input, outcome.name, outcome.key, outcome.place, *outcome.outputs.values())
        return outcome if all(isinstance(text, str) for text in texts) else None


def job_key(path: Path, settings: Sequence[str]) -> str:
    """Hash of a file's path, size and modification time, and of settings; the same key means the same results."""
    state = path.stat()
    text = json.dumps([path.as_posix(), state.st_size, state.st_mtime_ns, *settings])
    return hashlib.blake2b(text.encode(), digest_size=12).hexdigest()


def hash_models(path: Path) -> str:
    """Hash of the content of a model file, or of all model files in a folder."""
    digest = hashlib.blake2b(digest_size=12)
    for file in sorted(path.glob("*.json")) if path.is_dir() else [path]:
        if file.is_file():
            digest.update(os.fsencode(file.name) + b"\0" + file.read_bytes())
    return digest.hexdigest()


def _is_utf8(text: str) -> bool:
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


def _finite(value: Any) -> Any:
    """A value in which numbers that JSON does not have (NaN, infinity) are None."""
    if isinstance(value, Mapping):
        return {str(name): _finite(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
