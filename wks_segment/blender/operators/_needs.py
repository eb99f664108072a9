"""What operators need before they can run.

Each function is named after what is needed, and returns a message that says what is missing, or None if it is there.
"""

from __future__ import annotations

from collections.abc import Callable

import bpy

from ...core.message import Message
from ..outputs.part_attributes import has_labels
from ..scene.characters import selected_meshes, why_no_mesh
from ..workflow import segment_list
from ..workflow.background_job import JOB_RUNNING, job_holder
from ..workflow.live_session import session_of

Need = Callable[[bpy.types.Context], Message | None]


def no_job(context: bpy.types.Context) -> Message | None:
    """A message if a job is running."""
    return None if job_holder(context).job is None else Message(JOB_RUNNING)


def object_mode(context: bpy.types.Context) -> Message | None:
    """A message outside of Object Mode."""
    return None if context.mode == "OBJECT" else Message("Switch to Object Mode first")


def edit_mode(context: bpy.types.Context) -> Message | None:
    """A message outside of Edit Mode of a mesh."""
    return None if context.mode == "EDIT_MESH" else Message("Switch to Edit Mode first")


def object_or_edit_mode(context: bpy.types.Context) -> Message | None:
    """A message outside of Object Mode and of Edit Mode of a mesh."""
    met = context.mode in ("OBJECT", "EDIT_MESH")
    return None if met else Message("Switch to Object Mode or Edit Mode first")


def selected_mesh(context: bpy.types.Context) -> Message | None:
    """A message if no mesh is selected."""
    return None if selected_meshes(context) else Message(why_no_mesh(context.selected_objects))


def labeled_mesh(context: bpy.types.Context) -> Message | None:
    """A message if no selected mesh has segments."""
    met = any(has_labels(obj.data) for obj in selected_meshes(context))
    return None if met else Message("Select an object that has segments")


def model(context: bpy.types.Context) -> Message | None:
    """A message if this scene has no model."""
    met = context.scene.wks_segment.model
    return None if met else Message("No model yet: use Learn and Segment, or import a model")


def active_segment(context: bpy.types.Context) -> Message | None:
    """A message if no segment is active in the list."""
    if segment_list.active_part(context.scene.wks_segment) is not None:
        return None
    return Message("No segments yet: use Learn and Segment or Apply to Selected, or refresh the list")


def preview(context: bpy.types.Context) -> Message | None:
    """A message if no segments are previewed: shown but not written."""
    if session_of(context).proposed is not None:
        return None
    return Message("There is no preview: switch Preview on and change a setting")
