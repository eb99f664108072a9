"""The settings, described once: panel, operators and command line all use this property group."""

from __future__ import annotations

import json
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

from ...core import PartNotes, PoseSegmentation
from ..errors import UserError
from ..parts.palette import DEFAULT_PALETTE, MAX_COLORS, RECIPES
from ..parts.part_style import Style
from ..workflow.live_session import session_of
from ..workflow.model_library import followed
from .model_item import WKSModelItem, WKSRankItem
from .segment_item import WKSSegmentItem

TUNED: dict[str, dict[str, Any]] = {
    "n_segments": {
        "name": "Segments",
        "description": "Number of kinds of parts. Parts that look alike, as both hands, are one kind",
        "default": 8, "min": 2, "max": MAX_COLORS, "soft_max": 20,
    },
    "auto_segments": {
        "name": "Automatic",
        "description": "As many segments as the poses show surely, up to 16",
        "default": False,
    },
    "sides": {
        "name": "Sides",
        "description": "Whether a part that is there on both sides, as a hand, is one part or two. Left is where X "
        "points to when the character is at rest",
        "items": [
            ("one", "One Part for Both", "Both sides have the same number, name and color"),
            (
                "two",
                "Left and Right",
                "Names end in .L and .R, left is the lighter color. The number is 1000 more on the left and 2000 more "
                "on the right. Not with the method of the paper",
            ),
        ],
        "default": "one",
    },
    "smoothness": {
        "name": "Smoothness",
        "description": "How smooth the borders are. Zero leaves every vertex the label of its own signature",
        "default": 1.0, "min": 0.0, "max": 10.0, "soft_max": 3.0, "precision": 2,
    },
    "min_share": {
        "name": "Smallest Part",
        "description": "A connected part below this share of the surface joins its neighbor",
        "default": 0.5, "min": 0.0, "max": 20.0, "precision": 1, "subtype": "PERCENTAGE",
    },
}  # fmt: skip
"""Settings that labels follow at once, in the sidebar and where an operator is adjusted."""
MODEL_PARAMETERS = (
    "n_segments", "n_eigenpairs", "n_energies", "covariance_type", "scaling", "random_state", "pieces",
    "laplacian", "smoothness", "preset",
)  # fmt: skip


def changed(settings: WKSSegmentSettings, context: bpy.types.Context) -> None:
    """Called by Blender when one of the settings that labels follow gets another value."""
    session_of(context).mark(settings.id_data)


class WKSSegmentSettings(bpy.types.PropertyGroup):
    """Settings and the learned model, kept with the scene."""

    source: EnumProperty(
        name="Poses",
        description="Where the poses to learn from are",
        items=[
            (
                "OBJECTS",
                "Selected Objects",
                "Each selected mesh object is a pose. Objects on one armature are one pose",
            ),
            (
                "FRAMES",
                "Animation Frames",
                "Frames of the active character's animation. What is not keyed is lost, as in playback",
            ),
            ("SHAPE_KEYS", "Shape Keys", "Shape keys of the active character, each at its full value"),
            ("MARKERS", "Timeline Markers", "Frames of the active character's animation that have a marker"),
            (
                "ACTIONS",
                "Pose Library",
                "Pose assets in this file that move bones of the active character, each from rest; if there are none, "
                "all actions that do, each at its middle",
            ),
        ],
        default="FRAMES",
    )
    pose_count: IntProperty(
        name="Count",
        description="How many frames, keys, markers or poses to take, in equal steps. Three to five will do for most",
        default=5, min=1, max=100, soft_max=12,
    )  # fmt: skip
    use_frame_range: BoolProperty(
        name="Frame Range",
        description="Take the poses from a range of frames instead of the whole action or scene",
    )
    frame_first: IntProperty(name="First", description="First frame to take a pose from", default=1)
    frame_last: IntProperty(name="Last", description="Last frame to take a pose from", default=50)

    n_segments: IntProperty(**TUNED["n_segments"], update=changed)
    auto_segments: BoolProperty(**TUNED["auto_segments"], update=changed)
    sides: EnumProperty(**TUNED["sides"], update=changed)
    live: BoolProperty(
        name="Live",
        description="Let labels follow a change of the number of segments, sides, smoothness, smallest part or "
        "snapping at once, on what was learned or applied last. Not where that takes long",
        default=True,
    )
    random_state: IntProperty(
        name="Seed",
        description="Where the paper's setting begins its search. Otherwise nothing depends on luck, nor on this",
        default=0, min=0,
    )  # fmt: skip
    preview: BoolProperty(
        name="Preview",
        description="Show in the viewport what segments would be, and write them only when they are accepted. "
        "Needs Live",
        default=False,
        update=changed,
    )
    n_eigenpairs: IntProperty(
        name="Eigenpairs",
        description="How much detail the signature sees. Fewer are faster and coarser",
        default=300, min=20, max=1000, soft_min=50, soft_max=500,
    )  # fmt: skip
    n_energies: IntProperty(
        name="Energies", description="Length of the signature of a vertex", default=100, min=10, max=200
    )
    covariance_type: EnumProperty(
        name="Covariance",
        description="What shape the mixture gives to a kind of part",
        items=[
            ("auto", "Automatic", "What generalizes best to unseen poses"),
            ("shared", "Shared", "One diagonal covariance for all segments, the most robust"),
            ("diag", "Diagonal", "A diagonal covariance for each segment"),
            ("spherical", "Spherical", "One variance for each segment"),
            ("tied", "Tied", "One full covariance for all segments"),
            ("full", "Full", "A full covariance for each segment, learns by heart with few poses"),
        ],
        default="auto",
    )
    scaling: EnumProperty(
        name="Scaling",
        description="What enters the mixture",
        items=[
            ("log", "Logarithm", "Limbs and torso count as much as fingers and toes"),
            ("raw", "Plain", "The signature itself; the finest parts dominate"),
        ],
        default="log",
    )
    pieces: EnumProperty(
        name="Loose Parts",
        description="How parts that are not connected belong together, as eyes, clothes and armor",
        items=[
            ("joined", "By the Whole Character", "Each loose part counts as grown to what it is nearest to"),
            ("separate", "Each on Its Own", "Loose parts of one shape get one segment wherever they are"),
        ],
        default="joined",
    )
    laplacian: EnumProperty(
        name="Triangles",
        description="The triangles on which the spectrum is computed",
        items=[
            ("auto", "Automatic", "The mesh's own, unless they are full of slivers"),
            ("cotangent", "As They Are", "The mesh's own, as in the paper"),
            ("delaunay", "Intrinsic Delaunay", "The best ones between the same vertices, for meshes full of slivers"),
        ],
        default="auto",
    )
    preset: EnumProperty(
        name="Method",
        description="How the parts are learned",
        items=[
            ("default", "Robust", "What measures best on poses and bodies that were not learned from"),
            ("paper", "As in the Paper", "A mixture of the signatures themselves, its components as labels"),
        ],
        default="default",
    )
    smoothness: FloatProperty(**TUNED["smoothness"], update=changed)
    min_share: FloatProperty(**TUNED["min_share"], update=changed)
    snap_to: EnumProperty(
        name="Snap Borders To",
        description="Edges that draw a border nearby to them. Needs some smoothness",
        items=[
            ("sharp", "Sharp Edges", "Edges that are marked sharp"),
            ("seams", "Seams", "Edges that are marked as a seam"),
            ("materials", "Material Borders", "Edges where the material changes, not counting materials of segments"),
        ],
        options={"ANIMATABLE", "ENUM_FLAG"},
        default=set(),
        update=changed,
    )

    limit_minutes: FloatProperty(
        name="Ask Above",
        description="A job that takes longer than this many minutes, by estimate, is asked about first; without a "
        "window it is refused",
        default=5.0, min=0.1, max=10_000.0, soft_max=120.0, precision=1,
    )  # fmt: skip
    limit_memory: FloatProperty(
        name="or Above GB",
        description="The same for memory, in gigabytes. Zero is all that is free",
        default=0.0, min=0.0, max=10_000.0, soft_max=128.0, precision=1,
    )  # fmt: skip

    write_colors: BoolProperty(
        name="Colors", description="Write a color attribute, one flat color a face, and show it", default=True
    )
    write_materials: BoolProperty(
        name="Materials",
        description="Add a material slot for each segment. The object's own materials come back with Clear",
        default=False,
    )
    material_template: PointerProperty(
        name="Template",
        description="Material to copy for each segment. The color goes to its Base Color, or to the RGB node before it",
        type=bpy.types.Material,
    )
    write_face_sets: BoolProperty(
        name="Face Sets",
        description="Put each segment into a face set of sculpt mode. The object's own face sets come back with Clear",
        default=False,
    )
    write_seams: BoolProperty(
        name="Seams",
        description="Mark the borders of segments as UV seams, beside the object's own",
        default=False,
    )
    palette: EnumProperty(
        name="Palette",
        description="Which colors the segments have",
        items=[(name, recipe.title, recipe.description) for name, recipe in RECIPES.items()],
        default=DEFAULT_PALETTE,
    )

    vertex_groups: EnumProperty(
        name="Vertex Groups",
        description="Write a vertex group for each segment, beside the object's own",
        items=[
            ("none", "None", "No vertex groups"),
            (
                "hard",
                "Hard",
                "Weight 1 on each vertex of the segment's faces; on a border, in the groups of both sides",
            ),
            ("soft", "Soft", "How probable the segment is at each vertex. The weights of a vertex sum to 1"),
        ],
        default="none",
    )

    bake_size: IntProperty(
        name="Size",
        description="Width and height of the ID map",
        default=2048, min=16, max=8192, soft_min=256, subtype="PIXEL",
    )  # fmt: skip
    bake_margin: IntProperty(
        name="Margin",
        description="How far the colors go beyond the UV islands, so that no gap shows",
        default=16, min=0, max=1024, soft_max=64, subtype="PIXEL",
    )  # fmt: skip
    bake_unwrap: BoolProperty(
        name="Unwrap if Needed",
        description="Give an object without a UV map one of its own by Smart UV Project. Clear removes it",
        default=False,
    )

    models: CollectionProperty(type=WKSModelItem, name="Models", description="The models of this scene")
    active_model: IntProperty(
        name="Active Model", description="The model in use: labels, names and colors are its own", min=0, max=9999,
        update=followed,
    )  # fmt: skip
    used_model: IntProperty(
        options={"HIDDEN"}, description="Row of the model whose text is below", default=-1, min=-1, max=9999
    )
    replace_model: BoolProperty(
        name="Replace",
        description="Learn and Segment puts what it learns in the place of the active model. Otherwise it adds one",
        default=False,
    )
    ranking: CollectionProperty(type=WKSRankItem, name="Ranking", description="Models that may fit, best first")
    ranked: StringProperty(options={"HIDDEN"}, description="Names of the objects that were ranked, as JSON")
    verdict: StringProperty(options={"HIDDEN"}, description="How sure the first of the ranking is")

    model: StringProperty(options={"HIDDEN"}, description="The model in use, as JSON")
    model_summary: StringProperty(options={"HIDDEN"}, description="Lines on what the model was learned from")

    applied: StringProperty(options={"HIDDEN"}, description="What the labels in this scene are from, see `Session`")

    def number(self) -> int | Literal["auto"]:
        """Segments, as a model takes them."""
        return "auto" if self.auto_segments else self.n_segments

    segments: CollectionProperty(
        type=WKSSegmentItem, name="Segments", description="The segments of the selected objects, or else of all"
    )
    active_segment: IntProperty(
        name="Active Segment", description="The segment that the buttons below are about", min=0, max=3000
    )
    faces_by_hand: IntProperty(
        options={"HIDDEN"}, description="How many faces of these objects have a segment by hand", min=0, max=999_999
    )
    part_notes: StringProperty(
        options={"HIDDEN"}, description="Names and colors of segments, and which are merged, as JSON"
    )

    def new_model(self) -> PoseSegmentation:
        """An unfitted model with these settings; UserError if they exclude each other."""
        parameters: dict[str, Any] = {name: getattr(self, name) for name in MODEL_PARAMETERS}
        if self.auto_segments:
            if self.preset == "paper":
                raise UserError(
                    "The number of segments cannot be automatic with the method of the paper: give a number, or take "
                    "the robust method"
                )
            parameters["n_segments"] = "auto"
        return PoseSegmentation(**parameters)

    def notes(self) -> PartNotes:
        """What the user has noted on the parts of the model; nothing if somebody damaged it."""
        try:
            return PartNotes.of_json(json.loads(self.part_notes or "{}"))
        except ValueError:
            return PartNotes()

    def keep_notes(self, notes: PartNotes) -> None:
        """Store what the user notes on parts in the scene."""
        fields = notes.as_json()
        self.part_notes = json.dumps(fields) if fields else ""

    def style(self) -> Style:
        """Names and colors of parts as the user has them."""
        return Style.of(self.notes(), self.palette)
