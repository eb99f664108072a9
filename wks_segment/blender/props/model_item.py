"""A row in the list of models."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import IntProperty, StringProperty

from ..workflow import model_library


def _renamed(item: Any, context: bpy.types.Context) -> None:
    model_library.make_unique(item.id_data.wks_segment, item)


class WKSModelItem(bpy.types.PropertyGroup):
    """A learned model of this scene.

    The one in use lies in the scene's settings, where labels and notes are read and written; its row has no text.
    """

    name: StringProperty(name="Name", description="Name of the model, no two the same", update=_renamed)
    n_segments: IntProperty(name="Segments", description="Number of kinds of parts that the model has", min=0)
    date: StringProperty(name="Date", description="Day on which the model was learned or imported")
    model: StringProperty(options={"HIDDEN"}, description="The model, as JSON, while another one is in use")
    summary: StringProperty(options={"HIDDEN"}, description="Lines on what it was learned from")
    notes: StringProperty(options={"HIDDEN"}, description="Names and colors of its segments, as JSON")


class WKSRankItem(bpy.types.PropertyGroup):
    """A model in the list of those that may fit."""

    name: StringProperty(name="Name", description="Name of the model")
    path: StringProperty(options={"HIDDEN"}, description="Its file in the model folder; empty: it is in this scene")
    score: bpy.props.FloatProperty(name="Score", description="How well it explains the character, per energy")
    probability: bpy.props.FloatProperty(
        name="Probability", description="How probable it is among these models", min=0.0, max=1.0
    )
