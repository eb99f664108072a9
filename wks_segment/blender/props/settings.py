"""The settings, described once: panel, operators and command line all use this property group."""

from __future__ import annotations

from typing import Any, Literal

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)  # fmt: skip

from ... import core
from ..errors import UserError
from ..parts.palette import DEFAULT_PALETTE, MAX_COLORS, RECIPES
from ..parts.part_style import SetNotes, Style
from . import label_set
from .changes import listener
from .label_set import WKSLabelSet
from .model_item import WKSModelItem, WKSRankItem
from .segment_item import WKSSegmentItem
from .teach_settings import TeachSettings

LABEL_SETTINGS: dict[str, dict[str, Any]] = {
    "n_segments": {
        "name": "Segments",
        "description": "Number of segments; parts of one kind, such as both hands, are one segment",
        "default": 8, "min": 2, "max": MAX_COLORS, "soft_max": 20,
    },
    "auto_segments": {
        "name": "Automatic",
        "description": "As many segments as there are distinct parts by shape and motion, up to 16",
        "default": False,
    },
    "sides": {
        "name": "Sides",
        "description": "Whether left and right parts of a segment are told apart; left is as bones are named, or where "
        "X points at rest",
        "items": [
            ("one", "One Part for Both", "Both sides have the same number, name and color"),
            (
                "two",
                "Left and Right",
                "Left is lighter and ends in .L, right in .R; numbers are 1000 and 2000 higher; not with the method of "
                "the paper",
            ),
        ],
        "default": "one",
    },
    "smoothness": {
        "name": "Smoothness",
        "description": "Smoothness of the borders; at zero every vertex keeps the segment of its own signature",
        "default": 1.0, "min": 0.0, "max": 10.0, "soft_max": 3.0, "precision": 2,
    },
    "min_share": {
        "name": "Smallest Part",
        "description": "A connected region below this share of the surface joins its neighbor",
        "default": 0.5, "min": 0.0, "max": 20.0, "precision": 1, "subtype": "PERCENTAGE",
    },
}  # fmt: skip
"""Settings that labels follow and that operators show as well, in Adjust Last Operation."""
MODEL_PARAMETERS = (
    "n_segments", "n_eigenpairs", "n_energies", "covariance_type", "scaling", "random_state", "pieces",
    "laplacian", "smoothness", "preset",
)  # fmt: skip
"""Settings that are parameters of `PoseSegmentation` by the same name."""


def _labels_outdated(settings: WKSSegmentSettings, context: bpy.types.Context) -> None:
    """Called by Blender when a setting that labels follow gets another value."""
    listener().labels_outdated(settings)


def _outputs_changed(settings: WKSSegmentSettings, context: bpy.types.Context) -> None:
    """Called by Blender when something else is to be written of segments."""
    listener().outputs_changed(settings)


def _palette_chosen(settings: WKSSegmentSettings, context: bpy.types.Context) -> None:
    """Called by Blender when another palette is chosen."""
    listener().palette_chosen(settings)


def _model_chosen(settings: WKSSegmentSettings, context: bpy.types.Context) -> None:
    """Called by Blender when another row of the list of models becomes active."""
    listener().model_chosen(settings)


class WKSSegmentSettings(TeachSettings, bpy.types.PropertyGroup):
    """Settings and the learned model, stored with the scene."""

    source: EnumProperty(
        name="Poses",
        description="Where the poses to learn from are",
        items=[
            (
                "OBJECTS",
                "Selected Objects",
                "Each selected mesh object is a pose, and all objects on one armature together are one",
            ),
            (
                "FRAMES",
                "Animation Frames",
                "Frames of the active character's animation; changes without a keyframe are lost, as in playback",
            ),
            ("SHAPE_KEYS", "Shape Keys", "Shape keys of the active character, each at its full value"),
            ("MARKERS", "Timeline Markers", "Frames of the active character's animation that have a marker"),
            (
                "ACTIONS",
                "Pose Library",
                "Pose assets in this file that move bones of the active character, each from rest; if there are none, "
                "the middle frame of each action that moves them",
            ),
        ],
        default="FRAMES",
    )
    one_character: BoolProperty(
        name="One Character",
        description="Take the selected objects together as one character in one pose, not each as a pose",
        default=False,
    )
    pose_count: IntProperty(
        name="Count",
        description="Number of poses to take, evenly spaced; three to five are enough for most characters",
        default=5, min=1, max=100, soft_max=12,
    )  # fmt: skip
    use_frame_range: BoolProperty(
        name="Frame Range",
        description="Take the poses from a range of frames instead of the whole action or scene",
    )
    frame_first: IntProperty(name="First", description="First frame to take a pose from", default=1)
    frame_last: IntProperty(name="Last", description="Last frame to take a pose from", default=50)

    n_segments: IntProperty(**LABEL_SETTINGS["n_segments"], update=_labels_outdated)
    auto_segments: BoolProperty(**LABEL_SETTINGS["auto_segments"], update=_labels_outdated)
    sides: EnumProperty(**LABEL_SETTINGS["sides"], update=_labels_outdated)
    live: BoolProperty(
        name="Live",
        description="Update the segments of the selected objects at once when a setting changes, unless that takes "
        "long",
        default=True,
        update=_labels_outdated,
    )
    random_state: IntProperty(
        name="Seed",
        description="Seed of the random start in the method of the paper; the robust method uses none",
        default=0, min=0,
    )  # fmt: skip
    preview: BoolProperty(
        name="Preview",
        description="Show changed segments in the viewport and write them only when you accept them. Needs Live",
        default=False,
        update=_labels_outdated,
    )
    n_eigenpairs: IntProperty(
        name="Eigenpairs",
        description="Level of detail that the signature sees; fewer are faster and coarser",
        default=300, min=20, max=1000, soft_min=50, soft_max=500,
    )  # fmt: skip
    n_energies: IntProperty(
        name="Energies", description="Length of the signature of each vertex", default=100, min=10, max=200
    )
    # All covariance types and both scalings stay, though "auto" and "log" measure best: models, presets and scripts
    # name them, and the method of the paper needs "diag" and "raw".
    covariance_type: EnumProperty(
        name="Covariance",
        description="Shape that the mixture gives to each of its components",
        items=[
            ("auto", "Automatic", "Tied for poses of one mesh, Diagonal for several bodies"),
            ("shared", "Shared", "One diagonal covariance for all components, as the paper proposes"),
            ("diag", "Diagonal", "A diagonal covariance for each component, which recognizes other bodies best"),
            ("spherical", "Spherical", "One variance for each component"),
            ("tied", "Tied", "One full covariance for all components, which overfits on several bodies"),
            ("full", "Full", "A full covariance for each kind of part, which overfits with few poses"),
        ],
        default="auto",
    )
    scaling: EnumProperty(
        name="Scaling",
        description="Form of the signature that the mixture is fitted to",
        items=[
            ("log", "Logarithm", "Limbs and torso count as much as fingers and toes"),
            ("raw", "Plain", "The signature itself; the finest parts dominate"),
        ],
        default="log",
    )
    pieces: EnumProperty(
        name="Loose Parts",
        description="How loose parts such as eyes, clothes and armor are treated",
        items=[
            ("joined", "By the Whole Character", "Attach each loose part to the nearest surface"),
            ("separate", "Each on Its Own", "Loose parts of one shape get one segment wherever they are"),
        ],
        default="joined",
    )
    laplacian: EnumProperty(
        name="Triangles",
        description="Triangles on which the spectrum is computed",
        items=[
            ("auto", "Automatic", "The mesh's own triangles, unless they are full of slivers"),
            ("cotangent", "As They Are", "The mesh's own triangles, as in the paper"),
            (
                "delaunay",
                "Intrinsic Delaunay",
                "The best triangles between the same vertices, for meshes full of slivers",
            ),
        ],
        default="auto",
    )
    preset: EnumProperty(
        name="Method",
        description="How the segments are learned",
        items=[
            ("default", "Robust", "The method that measures best on unseen poses and bodies"),
            ("paper", "As in the Paper", "A mixture of the signatures themselves, with its components as segments"),
        ],
        default="default",
    )
    smoothness: FloatProperty(**LABEL_SETTINGS["smoothness"], update=_labels_outdated)
    min_share: FloatProperty(**LABEL_SETTINGS["min_share"], update=_labels_outdated)
    snap_to: EnumProperty(
        name="Snap Borders To",
        description="Snap borders to nearby edges of this kind. Needs Smoothness above 0",
        items=[
            ("sharp", "Sharp Edges", "Edges that are marked sharp"),
            ("seams", "Seams", "Edges that are marked as a seam"),
            ("materials", "Material Borders", "Edges where the material changes, not counting materials of segments"),
        ],
        options={"ANIMATABLE", "ENUM_FLAG"},
        default=set(),
        update=_labels_outdated,
    )

    limit_minutes: FloatProperty(
        name="Ask Above",
        description="Ask before a job that is estimated to take longer than this many minutes, or refuse it without a "
        "window",
        default=5.0, min=0.1, max=10_000.0, soft_max=120.0, precision=1,
    )  # fmt: skip
    limit_memory: FloatProperty(
        name="or Above GB",
        description="The same for memory in gigabytes; zero stands for all free memory",
        default=0.0, min=0.0, max=10_000.0, soft_max=128.0, precision=1,
    )  # fmt: skip

    write_colors: BoolProperty(
        name="Colors", description="Write a color attribute with one flat color for each face, and show it",
        default=True, update=_outputs_changed,
    )  # fmt: skip
    write_ucupaint: BoolProperty(
        name="Ucupaint", description="Write the color attribute that the Color ID masks of the add-on Ucupaint read",
        default=False, update=_outputs_changed,
    )  # fmt: skip
    write_materials: BoolProperty(
        name="Materials",
        description="Add a material slot for each segment. Clear restores the object's own materials",
        default=False,
        update=_outputs_changed,
    )
    material_template: PointerProperty(
        name="Template",
        description="Material to copy for each segment, with the color in its Base Color or in the RGB node before it",
        type=bpy.types.Material,
        update=_outputs_changed,
    )
    write_face_sets: BoolProperty(
        name="Face Sets",
        description="Write a sculpting face set for each segment. Clear restores the object's own face sets",
        default=False,
        update=_outputs_changed,
    )
    write_seams: BoolProperty(
        name="Seams",
        description="Mark the borders of segments as UV seams, in addition to the object's own seams",
        default=False,
        update=_outputs_changed,
    )
    palette: EnumProperty(
        name="Palette",
        description="Colors of the segments",
        items=[(name, recipe.title, recipe.description, recipe.number) for name, recipe in RECIPES.items()],
        default=DEFAULT_PALETTE,
        update=_palette_chosen,
    )

    vertex_groups: EnumProperty(
        name="Vertex Groups",
        description="Write a vertex group for each segment, in addition to the object's own groups",
        items=[
            ("none", "None", "No vertex groups"),
            (
                "hard",
                "Hard",
                "Weight 1 on each vertex of the segment's faces; on a border, in the groups of both sides",
            ),
            ("soft", "Soft", "Probability of the segment at each vertex; the weights of a vertex sum to 1"),
        ],
        default="none",
        update=_outputs_changed,
    )

    bake_size: IntProperty(
        name="Size",
        description="Width and height of the ID map",
        default=2048, min=16, max=8192, soft_min=256, subtype="PIXEL",
    )  # fmt: skip
    bake_margin: IntProperty(
        name="Margin",
        description="Width of the colored margin around UV islands, so that no gap shows",
        default=16, min=0, max=1024, soft_max=64, subtype="PIXEL",
    )  # fmt: skip
    bake_unwrap: BoolProperty(
        name="Unwrap if Needed",
        description="Give an object without a UV map one as Unwrap Segments does. Clear removes it",
        default=False,
    )

    models: CollectionProperty(type=WKSModelItem, name="Models", description="Models of this scene")
    active_model: IntProperty(
        name="Active Model", description="Model in use, with its own segments, names and colors", min=0, max=9999,
        update=_model_chosen,
    )  # fmt: skip
    used_model: IntProperty(
        options={"HIDDEN"}, description="Row of the model in use, -1 for none", default=-1, min=-1, max=9999
    )
    keep_models: BoolProperty(
        name="Keep Both",
        description="Keep the model that was learned from a character before when it is learned again",
        default=False,
    )
    ranking: CollectionProperty(type=WKSRankItem, name="Ranking", description="Ranked models, best first")
    ranked: StringProperty(options={"HIDDEN"}, description="Names of the objects that were ranked last, as JSON")
    verdict: StringProperty(options={"HIDDEN"}, description="How certain the first model of the ranking is")
    verdict_messages: StringProperty(
        options={"HIDDEN"}, description="The verdict as JSON with templates and values, for other languages"
    )

    model: StringProperty(options={"HIDDEN"}, description="The model in use as JSON")
    model_summary: StringProperty(options={"HIDDEN"}, description="Lines on what the model in use was learned from")
    model_summary_messages: StringProperty(
        options={"HIDDEN"}, description="The same lines as JSON with templates and values, for other languages"
    )

    label_sets: CollectionProperty(
        type=WKSLabelSet, options={"HIDDEN"}, description="Names, colors and merges of the labels of each model"
    )
    shown: StringProperty(
        options={"HIDDEN"}, description="Mesh whose settings the fields show and whose segments are listed"
    )

    segments: CollectionProperty(type=WKSSegmentItem, name="Segments", description="Segments of the active object")
    active_segment: IntProperty(
        name="Active Segment", description="Segment that the buttons below apply to", min=0, max=3000
    )
    faces_by_hand: IntProperty(
        options={"HIDDEN"}, description="Number of faces whose segment was assigned by hand", min=0, max=999_999
    )
    part_notes: StringProperty(
        options={"HIDDEN"}, description="Notes of a file of version 0.1.0 on the parts of its model, as JSON"
    )

    def number(self) -> int | Literal["auto"]:
        """The number of segments in the form that a model takes."""
        return "auto" if self.auto_segments else self.n_segments

    def new_model(self) -> core.PoseSegmentation:
        """An unfitted model with these settings; UserError if they exclude each other."""
        parameters: dict[str, Any] = {name: getattr(self, name) for name in MODEL_PARAMETERS}
        if self.auto_segments:
            if self.preset == "paper":
                raise UserError(
                    "The method of the paper needs a fixed number of segments: switch Automatic off, or choose the "
                    "robust method"
                )
            parameters["n_segments"] = "auto"
        return core.PoseSegmentation(**parameters)

    def labels(self) -> str:
        """Key of the label set of the model in use; empty if there is none."""
        index = self.used_model
        return self.models[index].labels() if 0 <= index < len(self.models) else ""

    def notes(self, labels: str | None = None) -> SetNotes:
        """The user's names, colors and merges of the parts of a label set, by default that of the model in use."""
        return label_set.notes_of(self.labels() if labels is None else labels)

    def keep_notes(self, notes: SetNotes, labels: str | None = None) -> None:
        """Store the user's names, colors and merges of the parts of a label set."""
        label_set.keep_notes(self, self.labels() if labels is None else labels, notes)

    def style(self, labels: str | None = None) -> Style:
        """Names and colors of the parts of a label set as the user has them."""
        labels = self.labels() if labels is None else labels
        return Style.of(label_set.notes_of(labels), self.palette, labels)
