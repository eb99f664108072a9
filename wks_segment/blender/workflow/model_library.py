"""The models of a scene: the one in use, the others of the list, and those of the model folder.

The model in use, which *Apply to Selected* applies, is stored in the settings themselves (`model`, `model_summary`).
The row of any other model stores the same until it is used. The active row is the model in use. Names and colors are
kept by label set (`props.label_set`), which rows and labeled meshes know by its key.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence
from datetime import date
from hashlib import blake2b
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from ... import core
from ...core import PartNotes
from ...core.message import Message, message_of
from ..errors import UserError
from ..parts.part_style import SetNotes
from ..props.changes import unheard
from ..props.settings import WKSSegmentSettings
from ..scene.file_content import name_of
from .certainty import certainty_lines
from .stored_messages import as_json, as_text, from_json, restored

DEFAULT_MODEL_NAME = "Model"
"""Name of a model without a known origin."""
MAX_NAME_LETTERS = 60
"""Letters of a model's name; Blender's own names have at most 63 bytes."""
LEARNED_FROM = "learned_from"
"""Field of a model file for the lines on what the model was learned from."""
STARTER_FOLDER = Path(__file__).parents[2] / "models"
"""Folder of the models that come with the extension. They are only read: applying one adds a copy to the scene."""
STARTER_SPREADS = {"human": 0.42}
"""Spread of the usual scores of a model by its file. *Human* was learned from a few made-up bodies, and real ones
differ more: Princeton humans score up to 1.1 below the learned bodies, other classes 1.9 and more. With this spread,
what scores 1.8 below does not fit any more. *Quadruped* was learned from animals of artists, so its usual scores are
those of other bodies already."""
ROW_STORES = {
    "model": "model",
    "summary": "model_summary",
    "summary_messages": "model_summary_messages",
}
"""Property of a row by which it stores a property of the settings while its model is not in use."""


def active_row(settings: WKSSegmentSettings) -> Any | None:
    """The row of the model in use; None if there is none."""
    index = settings.used_model
    return settings.models[index] if 0 <= index < len(settings.models) else None


def row_of(settings: WKSSegmentSettings, uid: str) -> Any | None:
    """The row of the model with an identity; None if there is none."""
    return next((row for row in settings.models if uid and row.uid == uid), None)


def list_active(settings: WKSSegmentSettings) -> None:
    """Add a row for the model in use if it has none, because a script has set it in the settings only."""
    if not settings.model or active_row(settings) is not None:
        return
    first, *rest = settings.model_summary.splitlines() or [""]
    counted = re.search(r"(\d+) segments", " ".join(rest))
    try:
        n_segments = int(counted[1]) if counted else from_text(settings.model).n_segments_
    except UserError:
        n_segments = 0  # a damaged model is refused when it is used
    row = _add_row(settings, first.removeprefix("From ").removesuffix(" …"), n_segments, "")
    row.uid = identity(settings, settings.model)


def identity(settings: WKSSegmentSettings, text: str, learned_from: str = "", replaced: str = "") -> str:
    """Identity of a model with this JSON text, the same whenever the same is learned from the same objects.

    Another than those of the other models of the scene.
    """
    taken = {row.uid for row in settings.models} - {replaced}
    salts = (f"{learned_from}{number or ''}" for number in count())
    uids = (blake2b(f"{salt}\n{text}".encode(), digest_size=8).hexdigest() for salt in salts)
    return next(uid for uid in uids if uid not in taken)


def text_of(settings: WKSSegmentSettings, uid: str) -> str:
    """JSON text of the model with an identity; empty if there is none."""
    row = row_of(settings, uid)
    return "" if row is None else str(settings.model if row == active_row(settings) else row.model)


def learned(
    settings: WKSSegmentSettings, model: core.PoseSegmentation, summary: Sequence[str], names: Sequence[str],
    character: str, keeps_names: bool = False,
) -> str:  # fmt: skip
    """Keep a learned model and use it; return the key of its label set.

    It replaces the model that was learned from the same objects before, unless the user wants to keep both.

    Parameters
    ----------
    settings
    model : PoseSegmentation
    summary
        Lines on what it was learned from.
    names
        Names of the objects that it was learned from.
    character : str
        Name of a new row.
    keeps_names : bool
        Whether the model was taught: it brings names and its own number of segments.
    """
    list_active(settings)
    learned_from = json.dumps(sorted(names))
    own = next((row for row in settings.models if row.learned_from == learned_from), None)
    replaced = None if settings.keep_models else own
    notes, model.part_notes_ = model.part_notes_, PartNotes()
    text = model.to_json()
    uid = identity(settings, text, learned_from, "" if replaced is None else replaced.uid)
    store_active(settings)
    row = replaced or _add_row(settings, character, model.n_segments_, "")
    settings.used_model = settings.active_model = next(i for i, each in enumerate(settings.models) if each == row)
    row.uid, row.learned_from = uid, learned_from
    row.n_segments, row.date = model.n_segments_, date.today().isoformat()
    for name in ROW_STORES:
        setattr(row, name, "")
    settings.model = text
    lines = [*summary, *certainty_lines(model)]
    settings.model_summary, settings.model_summary_messages = as_text(lines), as_json(lines)
    if keeps_names:
        settings.keep_notes(SetNotes.of(notes))
        _show_number(settings, row)
    return str(row.labels())


def adjusted(settings: WKSSegmentSettings, uid: str, model: core.PoseSegmentation) -> str:
    """Keep a model of the scene, if it is there, as it was applied last; return the key of its labels.

    That is with another number of segments or smoothness: applied again, it gives the same labels.
    """
    row = row_of(settings, uid)
    if row is not None:
        model.part_notes_ = PartNotes()
        place: Any = settings if row == active_row(settings) else row
        names = list(ROW_STORES.values() if place is settings else ROW_STORES.keys())
        setattr(place, names[0], model.to_json())
        if row.n_segments != model.n_segments_:
            row.n_segments = model.n_segments_
            origin = (restored(*(getattr(place, name) for name in names[1:])) or [""])[0]
            lines = [origin, Message("{count} segments", count=model.n_segments_), *certainty_lines(model)]
            setattr(place, names[1], as_text(lines))
            setattr(place, names[2], as_json(lines))
    return f"{uid}/{model.n_segments_}"


def used_uid(settings: WKSSegmentSettings) -> str:
    """Identity of the model in use."""
    list_active(settings)
    row = active_row(settings)
    return "" if row is None else str(row.uid)


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


def add_model(settings: WKSSegmentSettings, model: core.PoseSegmentation, name: str, summary: Sequence[str]) -> str:
    """Add a model with its own names and colors to the list, and use it; return the key of its label set."""
    list_active(settings)
    notes, model.part_notes_ = model.part_notes_, PartNotes()
    text = model.to_json()
    uid = identity(settings, text)
    store_active(settings)
    row = _add_row(settings, name, model.n_segments_, date.today().isoformat())
    row.uid = uid
    lines = [*summary, *certainty_lines(model)]
    settings.model = text
    settings.model_summary, settings.model_summary_messages = as_text(lines), as_json(lines)
    settings.keep_notes(SetNotes.of(notes))
    _show_number(settings, row)
    return str(row.labels())


def add_once(settings: WKSSegmentSettings, model: core.PoseSegmentation, name: str, summary: Sequence[str]) -> str:
    """Add a model that comes with the extension, unless it is in the list, and use it; return its label set's key."""
    source = f"{name} {blake2b(model.to_json().encode(), digest_size=8).hexdigest()}"
    for i, row in enumerate(settings.models):
        if row.learned_from == source:
            use(settings, i)
            return str(row.labels())
    labels = add_model(settings, model, name, summary)
    settings.models[settings.used_model].learned_from = source
    return labels


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
    index, notes, uid = settings.used_model, settings.notes(), identity(settings, settings.model)
    copy = _add_row(settings, row.name, row.n_segments, row.date)
    copy.uid, copy.learned_from = uid, settings.models[index].learned_from
    settings.keep_notes(notes)


def remove(settings: WKSSegmentSettings) -> None:
    """Remove the model in use, and use the next one; UserError if there is none.

    Names and colors stay, because labels on meshes use them.
    """
    _stored_active_row(settings)
    index = settings.used_model
    settings.models.remove(index)
    settings.used_model = -1
    settings.model = settings.model_summary = settings.model_summary_messages = ""
    if len(settings.models):
        _take(settings, min(index, len(settings.models) - 1))


def loaded(path: Path) -> core.PoseSegmentation:
    """The model in a file; UserError, which names the file, if it cannot be read or used."""
    try:
        model = core.PoseSegmentation.load(path)
    except FileNotFoundError:
        raise UserError("{path}: there is no such file", path=path) from None
    except (core.ModelFileError, OSError) as error:
        reason = getattr(error, "strerror", None) or message_of(error)
        raise UserError("{path}: {reason}", path=path, reason=reason) from error
    if path.parent == STARTER_FOLDER and path.stem in STARTER_SPREADS:
        model.usual_scores_ = model.usual_scores_.mean() + STARTER_SPREADS[path.stem] * np.array([-1.0, 1.0])
    return model


def from_text(text: str) -> core.PoseSegmentation:
    """The model in JSON text; UserError if it cannot be used."""
    try:
        return core.PoseSegmentation.from_json(text)
    except ValueError as error:
        raise UserError("The model in this file cannot be used: {reason}", reason=message_of(error)) from error


def save(model: core.PoseSegmentation, path: Path, summary: Sequence[str]) -> None:
    """Write a model to a file, with the lines on what it was learned from; errors as of `PoseSegmentation.save`."""
    core.model_file.write(path, json.dumps(json.loads(model.to_json()) | {LEARNED_FROM: as_json(summary)}))


def summary_in(path: Path) -> list[str]:
    """Lines on what the model in a file was learned from; none if the file has none."""
    return from_json(json.loads(core.model_file.read(path)).get(LEARNED_FROM))


def in_folder(folder: str | Path) -> dict[str, Path]:
    """Files of a model folder by name without suffix; none if there is no such folder."""
    path = Path(folder)
    if not str(folder) or not path.is_dir():
        return {}
    return {name_of(file): file for file in sorted(path.glob("*.json"))}


def starters() -> dict[str, Path]:
    """Files of the models that come with the extension, by name."""
    return {name.capitalize(): path for name, path in in_folder(STARTER_FOLDER).items()}


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
    for name, place in ROW_STORES.items():
        setattr(settings, place, getattr(row, name))
        setattr(row, name, "")  # a model can be large, and is not stored twice
    _show_number(settings, row)


def _show_number(settings: WKSSegmentSettings, row: Any) -> None:
    """Show the number of segments of a model in the field, since that is the number that it is applied with.

    Labels do not follow: the field is not about the active object now.
    """
    if not settings.auto_segments and row.n_segments:
        with unheard():
            settings.n_segments = row.n_segments
        settings.shown = ""


def _add_row(settings: WKSSegmentSettings, name: str, n_segments: int, day: str) -> Any:
    """Add a row at the end for the model in the settings."""
    names = {row.name for row in settings.models}
    row = settings.models.add()
    row.name, row.n_segments, row.date = _unique(name, names), n_segments, day
    # In this order, so that the change of the active row uses no other model.
    settings.used_model = len(settings.models) - 1
    settings.active_model = settings.used_model
    return row


def _unique(name: str, taken: set[str]) -> str:
    base = "".join(letter for letter in name if letter.isprintable()).strip()[: MAX_NAME_LETTERS - 4]
    base = base or DEFAULT_MODEL_NAME
    unique, number = base, 1
    while unique in taken:
        number += 1
        unique = f"{base} {number}"
    return unique
