"""What an operator tells the user while it works and when it ends."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy

from ...core.poses.describe import Progress
from ..outputs.labels import has_labels
from ..scene.characters import selected_meshes, why_no_mesh
from ..ui.messages import in_panel, in_report, in_tooltip
from ..workflow import segment_list
from ..workflow.background_job import BUSY, desk_of
from ..workflow.live_session import session_of
from ..workflow.report import Report

LOOK = "VERTEX"
"""Color mode of solid shading that shows the color attribute."""

MODES = {"OBJECT": "Object Mode", "EDIT_MESH": "Edit Mode", "OBJECT EDIT_MESH": "Object Mode or Edit Mode"}
"""What artists call modes."""


def tell(operator: bpy.types.Operator, kind: set[str], text: str) -> None:
    """Report: in the status bar and the Info editor."""
    operator.report(kind, in_report(text))


def explain(cls: type[bpy.types.Operator], text: str) -> None:
    """Say in the tooltip of a gray button why it is."""
    cls.poll_message_set(in_tooltip(text))


@contextmanager
def cursor_progress(context: bpy.types.Context) -> Iterator[Progress]:
    """Show progress at the mouse pointer and in the status bar while the block lasts."""
    manager, workspace = context.window_manager, context.workspace

    def progress(stage: str, fraction: float) -> None:
        manager.progress_update(round(100 * fraction))
        if workspace is not None:
            workspace.status_text_set(f"WKS Segment: {in_panel(stage)}")

    manager.progress_begin(0, 100)
    try:
        yield progress
    finally:
        manager.progress_end()
        if workspace is not None:
            workspace.status_text_set(None)


def finish(operator: bpy.types.Operator, verb: str, report: Report) -> set[str]:
    """Report what was done, warnings last so that they stay in the status bar."""
    for note in report.notes:
        tell(operator, {"INFO"}, note)
    tell(operator, {"INFO"}, f"{verb}: {', '.join(report.facts)}")
    for warning in report.warnings:
        tell(operator, {"WARNING"}, warning)
    return {"FINISHED"}


def show_colors(context: bpy.types.Context) -> None:
    """Let the 3D viewport that the user works in show the colors, if it is solid."""
    space = context.space_data
    if space is not None and space.type == "VIEW_3D" and space.shading.type == "SOLID":
        space.shading.color_type = LOOK


def hide_colors(context: bpy.types.Context) -> None:
    """Let that viewport show materials again."""
    space = context.space_data
    if space is not None and space.type == "VIEW_3D" and space.shading.color_type == LOOK:
        space.shading.color_type = "MATERIAL"


def has_window(context: bpy.types.Context) -> bool:
    """Whether there is a window that lives on while a job runs."""
    return not bpy.app.background and context.window is not None


def in_object_mode(cls: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    """For `poll`: whether the mode is right; sets the message if not."""
    if context.mode != "OBJECT":
        explain(cls, "Switch to Object Mode first")
        return False
    return True


def has_selected_mesh(cls: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    """For `poll`: whether a mesh is selected; sets the message if not."""
    if not selected_meshes(context):
        explain(cls, why_no_mesh(context.selected_objects))
        return False
    return True


def has_labeled_mesh(cls: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    """For `poll`: whether a selected mesh has segments; sets the message if not."""
    if not any(has_labels(obj.data) for obj in selected_meshes(context)):
        explain(cls, "Select an object that has segments")
        return False
    return True


def has_model(cls: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    """For `poll`: whether this scene has a model; sets the message if not."""
    if not context.scene.wks_segment.model:
        explain(cls, "No model yet: use Learn and Segment, or import a model")
        return False
    return True


def no_job_runs(cls: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    """For `poll`: whether no job is running; sets the message if one is."""
    if desk_of(context).job is not None:
        explain(cls, BUSY)
        return False
    return True


def has_segments(cls: type[bpy.types.Operator], context: bpy.types.Context, modes: str = "OBJECT EDIT_MESH") -> bool:
    """For `poll`: whether there is a segment in the list and the mode is one of these; sets the message if not."""
    if context.mode not in modes.split():
        explain(cls, f"Switch to {MODES[modes]} first")
        return False
    if segment_list.active_part(context.scene.wks_segment) is None:
        explain(cls, "No segments yet: use Learn and Segment or Apply to Selected, or refresh the list")
        return False
    return True


def shows_preview(cls: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    """For `poll`: whether segments are shown that are not written; sets the message if not."""
    if session_of(context).proposed is None:
        explain(cls, "Nothing is shown that could be written: switch Preview on and change a setting")
        return False
    return True
