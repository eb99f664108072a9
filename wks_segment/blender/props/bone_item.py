"""Row of the tree of bones, in which an artist chooses which bones are parts."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty, FloatProperty, IntProperty, StringProperty

from .changes import listener


def _own_changed(item: WKSBoneItem, context: bpy.types.Context) -> None:
    """Called by Blender when a bone becomes a part, or joins another."""
    listener().bones_chosen(context.scene.wks_segment)


class WKSBoneItem(bpy.types.PropertyGroup):
    """A bone, or a pair of bones on both sides."""

    name: StringProperty(name="Name", description="Plain name of the bone")
    bones: StringProperty(options={"HIDDEN"}, description="Names of the bones in the rig, as JSON")
    parent: IntProperty(options={"HIDDEN"}, description="Row that the bone hangs on, -1 for none", default=-1, min=-1)
    depth: IntProperty(options={"HIDDEN"}, description="Number of rows above it in the tree", min=0)
    area: FloatProperty(
        name="Share", description="Share of the surface area that the bone moves most", min=0.0, max=1.0
    )
    known: BoolProperty(options={"HIDDEN"}, description="Whether the dictionary of bones has the name")
    pair: BoolProperty(options={"HIDDEN"}, description="Whether there is one on each side")
    own: BoolProperty(
        name="Part",
        description="Whether the bone is a part; otherwise it belongs to the part above it in the tree",
        update=_own_changed,
    )
    open: BoolProperty(name="Open", description="Show the bones below this one in the tree")
