"""The models of a scene: one in use, others kept beside it, and those of the model folder.

What is in use lies in the settings themselves (`model`, `model_summary`, `part_notes`): there labels, names and colors
are read and written. The row of another one holds the same three until it is used. A row is used by being active.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Any

import bpy

from ...core import ModelFileError, PoseSegmentation
from ..errors import UserError
from .certainty import certainty_lines

if TYPE_CHECKING:
    from ..props.settings import WKSSegmentSettings

FIRST = "Model"
"""Name of a model that nothing is known of."""
LONGEST = 60
"""Letters of a name: what Blender keeps."""
HELD = {"model": "model", "summary": "model_summary", "notes": "part_notes"}
"""Of a row, what lies in the settings while it is in use."""


def in_use(settings: WKSSegmentSettings) -> Any | None:
    """The row of the model that is in use; None if there is none."""
    index = settings.used_model
    return settings.models[index] if 0 <= index < len(settings.models) else None


def adopt(settings: WKSSegmentSettings) -> None:
    """List the model that is in use if it is in no row: a script may have put it into the settings only."""
    if not settings.model or in_use(settings) is not None:
        return
    first, *rest = settings.model_summary.splitlines() or [""]
    counted = re.search(r"(\d+) segments", " ".join(rest))
    _add_row(settings, first.removeprefix("From ").removesuffix(" …"), int(counted[1]) if counted else 0, "")


def keep(
    settings: WKSSegmentSettings, model: PoseSegmentation, summary: list[str], name: str = "", add: bool = False
) -> None:
    """Let a fitted model be the one in use: in the place of the one that is, or beside it; its notes are those of now.

    To be added, it comes after `aside`, so that the other one has the notes that were its own. Without a name it is
    the one in use with other settings.
    """
    adopt(settings)
    row, today = in_use(settings), date.today().isoformat()
    if add or row is None:
        _add_row(settings, name, model.n_segments_, today)
    else:
        row.n_segments, row.date = model.n_segments_, today if name else row.date
    settings.applied = ""
    settings.model = model.to_json()
    settings.model_summary = "\n".join([*summary, *certainty_lines(model)])


def aside(settings: WKSSegmentSettings) -> None:
    """Put what is in use into its row, from where it can be used again. The settings still have it."""
    adopt(settings)
    row = in_use(settings)
    if row is not None:
        for name, place in HELD.items():
            setattr(row, name, getattr(settings, place))


def add(settings: WKSSegmentSettings, model: PoseSegmentation, name: str, summary: list[str]) -> None:
    """List a model with its own notes, and use it."""
    aside(settings)
    settings.keep_notes(model.part_notes_)
    keep(settings, model, summary, name, add=True)


def use(settings: WKSSegmentSettings, index: int) -> None:
    """Use the model of a row, with its names and colors. Labels on meshes stay until it is applied."""
    adopt(settings)
    if index == settings.used_model or not 0 <= index < len(settings.models):
        return
    if not settings.models[index].model:  # damaged, and what is in use is not
        settings.active_model = settings.used_model
        return
    aside(settings)
    _take(settings, index)


def followed(settings: WKSSegmentSettings, context: bpy.types.Context) -> None:
    """Called by Blender when another row becomes active."""
    use(settings, settings.active_model)


def duplicate(settings: WKSSegmentSettings) -> None:
    """Copy the model in use, with its names and colors, and use the copy; UserError if there is none."""
    row = _used(settings)
    _add_row(settings, row.name, row.n_segments, row.date)


def remove(settings: WKSSegmentSettings) -> None:
    """Remove the model in use, and use the one next to it; UserError if there is none.

    With the last one the names and colors stay: labels on meshes have them.
    """
    _used(settings)
    index = settings.used_model
    settings.models.remove(index)
    settings.used_model = -1
    settings.applied = settings.model = settings.model_summary = ""
    if len(settings.models):
        _take(settings, min(index, len(settings.models) - 1))


def loaded(path: Path) -> PoseSegmentation:
    """The model in a file; UserError, which names it, if it cannot be read or used."""
    try:
        return PoseSegmentation.load(path)
    except FileNotFoundError:
        raise UserError(f"{path}: there is no such file") from None
    except (ModelFileError, OSError) as error:
        raise UserError(f"{path}: {getattr(error, 'strerror', None) or error}") from error


def from_text(text: str) -> PoseSegmentation:
    """The model in JSON text; UserError if it cannot be used."""
    try:
        return PoseSegmentation.from_json(text)
    except ValueError as error:
        raise UserError(f"The model in this file cannot be used: {error}") from error


def in_folder(folder: str | Path) -> dict[str, Path]:
    """Files of a model folder by what they are called; none if there is no such folder."""
    place = Path(folder)
    if not str(folder) or not place.is_dir():
        return {}
    return {path.stem: path for path in sorted(place.glob("*.json"))}


def all_of(settings: WKSSegmentSettings) -> Iterator[tuple[str, str]]:
    """(name, JSON text) of each model that is listed, the one in use among them."""
    used = settings.used_model
    for i, row in enumerate(settings.models):
        yield row.name, settings.model if i == used else row.model
    if settings.model and in_use(settings) is None:
        yield FIRST, settings.model


def make_unique(settings: WKSSegmentSettings, row: Any) -> None:
    """Give a row's name a number if another row has it."""
    others = {other.name for other in settings.models if other != row}
    name = _unique(row.name, others)
    if name != row.name:
        row.name = name


def _used(settings: WKSSegmentSettings) -> Any:
    adopt(settings)
    row = in_use(settings)
    if row is None:
        raise UserError("No model yet: use Learn and Segment, or import a model")
    aside(settings)
    return row


def _take(settings: WKSSegmentSettings, index: int) -> None:
    """Put what a row holds into the settings; all that is in these must lie in a row."""
    row = settings.models[index]
    settings.used_model, settings.active_model = index, index
    settings.applied = ""
    for name, place in HELD.items():
        setattr(settings, place, getattr(row, name))
        setattr(row, name, "")  # a model can be large


def _add_row(settings: WKSSegmentSettings, name: str, n_segments: int, day: str) -> None:
    """A new row, the last one, for what is in the settings."""
    names = {row.name for row in settings.models}
    row = settings.models.add()
    row.name, row.n_segments, row.date = _unique(name, names), n_segments, day
    # First what is used: then that it is active changes nothing.
    settings.used_model = len(settings.models) - 1
    settings.active_model = settings.used_model


def _unique(name: str, others: set[str]) -> str:
    base = "".join(letter for letter in name if letter.isprintable()).strip()[: LONGEST - 4] or FIRST
    found, number = base, 1
    while found in others:
        number += 1
        found = f"{base} {number}"
    return found
