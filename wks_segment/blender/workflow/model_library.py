"""The models of a scene: the one in use, the others of the list, and those of the model folder.

The model in use is stored in the settings themselves (`model`, `model_summary`, `part_notes`), where its names and
colors are read and written. The row of any other model stores the same until it is used. The active row is the model
in use.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from datetime import date
from pathlib import Path
from typing import Any

from ...core import ModelFileError, PoseSegmentation
from ...core.message import message_of
from ..errors import UserError
from ..props.settings import WKSSegmentSettings
from ..scene.file_content import name_of
from .certainty import certainty_lines
from .stored_messages import as_json, as_text, restored

DEFAULT_MODEL_NAME = "Model"
"""Name of a model without a known origin."""
MAX_NAME_LETTERS = 60
"""Letters of a model's name; Blender's own names have at most 63 bytes."""
ROW_STORES = {
    "model": "model",
    "summary": "model_summary",
    "summary_messages": "model_summary_messages",
    "notes": "part_notes",
}
"""Property of a row by which it stores a property of the settings while its model is not in use."""


def active_row(settings: WKSSegmentSettings) -> Any | None:
    """The row of the model in use; None if there is none."""
    index = settings.used_model
    return settings.models[index] if 0 <= index < len(settings.models) else None


def list_active(settings: WKSSegmentSettings) -> None:
    """Add a row for the model in use if it has none, because a script has set it in the settings only."""
    if not settings.model or active_row(settings) is not None:
        return
    first, *rest = settings.model_summary.splitlines() or [""]
    counted = re.search(r"(\d+) segments", " ".join(rest))
    _add_row(settings, first.removeprefix("From ").removesuffix(" …"), int(counted[1]) if counted else 0, "")


def keep(
    settings: WKSSegmentSettings, model: PoseSegmentation, summary: Sequence[str], name: str = "", add: bool = False
) -> None:
    """Make a fitted model the one in use, with the names and colors that are in the settings.

    Parameters
    ----------
    settings
    model : PoseSegmentation
    summary
        Lines on what it was learned from.
    name : str
        Name of a new row. Without one the model is the one in use with other settings, and keeps its date.
    add : bool
        Add a row instead of replacing the model in use. Call `store_active` before the names and colors in the
        settings become those of the new model.
    """
    list_active(settings)
    row, today = active_row(settings), date.today().isoformat()
    if add or row is None:
        _add_row(settings, name, model.n_segments_, today)
    else:
        row.n_segments, row.date = model.n_segments_, today if name else row.date
    settings.applied = ""
    settings.model = model.to_json()
    lines = [*summary, *certainty_lines(model)]
    settings.model_summary, settings.model_summary_messages = as_text(lines), as_json(lines)


def summary_of(settings: WKSSegmentSettings) -> list[str]:
    """Lines on what the model in use was learned from, the first its origin; one empty line if nothing is known."""
    return restored(settings.model_summary, settings.model_summary_messages) or [""]


def store_active(settings: WKSSegmentSettings) -> None:
    """Copy the model in use into its row, so that it can be used again. The settings keep it, too."""
    list_active(settings)
    row = active_row(settings)
    if row is not None:
        for name, place in ROW_STORES.items():
            setattr(row, name, getattr(settings, place))


def add_model(settings: WKSSegmentSettings, model: PoseSegmentation, name: str, summary: Sequence[str]) -> None:
    """Add a model with its own names and colors to the list, and use it."""
    store_active(settings)
    settings.keep_notes(model.part_notes_)
    keep(settings, model, summary, name, add=True)


def use(settings: WKSSegmentSettings, index: int) -> None:
    """Use the model of a row, with its names and colors. Labels on meshes stay until it is applied."""
    list_active(settings)
    if index == settings.used_model or not 0 <= index < len(settings.models):
        return
    if not settings.models[index].model:  # a damaged row must not replace the model in use
        settings.active_model = settings.used_model
        return
    store_active(settings)
    _take(settings, index)


def duplicate(settings: WKSSegmentSettings) -> None:
    """Copy the model in use, with its names and colors, and use the copy; UserError if there is none."""
    row = _stored_active_row(settings)
    _add_row(settings, row.name, row.n_segments, row.date)


def remove(settings: WKSSegmentSettings) -> None:
    """Remove the model in use, and use the next one; UserError if there is none.

    The names and colors of the last model stay, because labels on meshes use them.
    """
    _stored_active_row(settings)
    index = settings.used_model
    settings.models.remove(index)
    settings.used_model = -1
    settings.applied = settings.model = settings.model_summary = settings.model_summary_messages = ""
    if len(settings.models):
        _take(settings, min(index, len(settings.models) - 1))


def loaded(path: Path) -> PoseSegmentation:
    """The model in a file; UserError, which names the file, if it cannot be read or used."""
    try:
        return PoseSegmentation.load(path)
    except FileNotFoundError:
        raise UserError("{path}: there is no such file", path=path) from None
    except (ModelFileError, OSError) as error:
        reason = getattr(error, "strerror", None) or message_of(error)
        raise UserError("{path}: {reason}", path=path, reason=reason) from error


def from_text(text: str) -> PoseSegmentation:
    """The model in JSON text; UserError if it cannot be used."""
    try:
        return PoseSegmentation.from_json(text)
    except ValueError as error:
        raise UserError("The model in this file cannot be used: {reason}", reason=message_of(error)) from error


def in_folder(folder: str | Path) -> dict[str, Path]:
    """Files of a model folder by name without suffix; none if there is no such folder."""
    path = Path(folder)
    if not str(folder) or not path.is_dir():
        return {}
    return {name_of(file): file for file in sorted(path.glob("*.json"))}


def all_of(settings: WKSSegmentSettings) -> Iterator[tuple[str, str]]:
    """(name, JSON text) of each model of the scene, including the one in use."""
    used = settings.used_model
    for i, row in enumerate(settings.models):
        yield row.name, settings.model if i == used else row.model
    if settings.model and active_row(settings) is None:
        yield DEFAULT_MODEL_NAME, settings.model


def make_unique(settings: WKSSegmentSettings, row: Any) -> None:
    """Add a number to a row's name if another row has the same."""
    taken = {other.name for other in settings.models if other != row}
    name = _unique(row.name, taken)
    if name != row.name:
        row.name = name


def _stored_active_row(settings: WKSSegmentSettings) -> Any:
    """The row of the model in use with a copy of it; UserError if there is none."""
    list_active(settings)
    row = active_row(settings)
    if row is None:
        raise UserError("No model yet: use Learn and Segment, or import a model")
    store_active(settings)
    return row


def _take(settings: WKSSegmentSettings, index: int) -> None:
    """Move the model of a row into the settings, whose own model must be stored in its row."""
    row = settings.models[index]
    settings.used_model, settings.active_model = index, index
    settings.applied = ""
    for name, place in ROW_STORES.items():
        setattr(settings, place, getattr(row, name))
        setattr(row, name, "")  # a model can be large, and is not stored twice


def _add_row(settings: WKSSegmentSettings, name: str, n_segments: int, day: str) -> None:
    """Add a row at the end for the model in the settings."""
    names = {row.name for row in settings.models}
    row = settings.models.add()
    row.name, row.n_segments, row.date = _unique(name, names), n_segments, day
    # In this order, so that the change of the active row uses no other model.
    settings.used_model = len(settings.models) - 1
    settings.active_model = settings.used_model


def _unique(name: str, taken: set[str]) -> str:
    base = "".join(letter for letter in name if letter.isprintable()).strip()[: MAX_NAME_LETTERS - 4]
    base = base or DEFAULT_MODEL_NAME
    unique, number = base, 1
    while unique in taken:
        number += 1
        unique = f"{base} {number}"
    return unique
