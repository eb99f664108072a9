"""Label sets: what a user said about the parts of one model with one number of segments."""

from __future__ import annotations

import json
from typing import Any

import bpy
from bpy.props import StringProperty

from ..parts.part_style import SetNotes, Style


class WKSLabelSet(bpy.types.PropertyGroup):
    """The names, colors and merges of a label set; meshes and models know it by its key."""

    name: StringProperty(name="Key", description="Model and number of segments, as meshes know it")
    notes: StringProperty(options={"HIDDEN"}, description="Names, colors and merges of parts by the user, as JSON")


def notes_of(labels: str) -> SetNotes:
    """The notes on a label set, given its key; none if nobody made any, or if they are damaged."""
    row = next((row for settings in _all_settings() if (row := settings.label_sets.get(labels)) is not None), None)
    try:
        return SetNotes() if row is None else SetNotes.of_json(json.loads(row.notes or "{}"))
    except ValueError:
        return SetNotes()


def is_known(labels: str) -> bool:
    """Whether there are notes on a label set, though they may be empty."""
    return any(labels in settings.label_sets for settings in _all_settings())


def known_sets() -> list[str]:
    """Keys of all label sets with notes."""
    return [row.name for settings in _all_settings() for row in settings.label_sets]


def keep_notes(settings: Any, labels: str, notes: SetNotes) -> None:
    """Store the notes on a label set: in the settings of all scenes that know it, or else in these."""
    known = [other for other in _all_settings() if labels in other.label_sets]
    for each in known or [settings]:
        row = each.label_sets.get(labels)
        if row is None:
            row = each.label_sets.add()
            row.name = labels
        row.notes = json.dumps(notes.as_json())


def style_of(labels: str) -> Style:
    """Names and colors of the parts of a label set."""
    all_settings = _all_settings()
    known = next((settings for settings in all_settings if labels in settings.label_sets), all_settings[0])
    return Style.of(notes_of(labels), known.palette, labels)


def _all_settings() -> list[Any]:
    """The settings of all scenes, those of the current scene first."""
    current = bpy.context.scene
    return [scene.wks_segment for scene in sorted(bpy.data.scenes, key=lambda scene: scene != current)]
