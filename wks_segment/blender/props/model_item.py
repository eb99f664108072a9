"""Rows of the list of models and of the ranking."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import BoolProperty, FloatProperty, IntProperty, StringProperty

from .changes import listener


def _renamed(row: Any, context: bpy.types.Context) -> None:
    listener().model_renamed(row.id_data.wks_segment, row)


class WKSModelItem(bpy.types.PropertyGroup):
    """A learned model of this scene.

    The text of the model in use is kept in the settings; its row holds none.
    """

    uid: StringProperty(options={"HIDDEN"}, description="Identity of what was learned, as meshes know it")
    learned_from: StringProperty(options={"HIDDEN"}, description="Names of the objects it was learned from, as JSON")
    name: StringProperty(name="Name", description="Name of the model, unique in the list", update=_renamed)
    n_segments: IntProperty(name="Segments", description="Number of segments of the model", min=0)
    date: StringProperty(name="Date", description="Day on which the model was learned or imported")
    model: StringProperty(options={"HIDDEN"}, description="The model as JSON while another one is in use")
    summary: StringProperty(options={"HIDDEN"}, description="Lines on what the model was learned from")
    summary_messages: StringProperty(
        options={"HIDDEN"}, description="The same lines as JSON with templates and values, for other languages"
    )
    notes: StringProperty(
        options={"HIDDEN"}, description="Notes of a file of version 0.1.0 on the model's segments, as JSON"
    )

    def labels(self) -> str:
        """Key of the label set that the model gives: the same whatever other models there are."""
        return f"{self.uid}/{self.n_segments}"


class WKSRankItem(bpy.types.PropertyGroup):
    """A model of the ranking."""

    name: StringProperty(name="Name", description="Name of the model")
    path: StringProperty(
        options={"HIDDEN"}, description="File of the model in the model folder, empty for a model of this scene"
    )
    score: FloatProperty(
        name="Score", description="Log-likelihood of the character under the model, per energy of the signature"
    )
    probability: FloatProperty(
        name="Probability", description="Probability of the model among the ranked ones", min=0.0, max=1.0
    )
    fits: BoolProperty(
        name="Fits", description="Whether the character is like those that the model was learned from", default=True
    )
