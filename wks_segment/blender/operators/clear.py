"""Clear."""

from __future__ import annotations

import bpy

from ...core.message import Message
from ..errors import UserError
from ..outputs.labels import clear_labels
from ..outputs.overrides import faces_by_hand
from ..outputs.part_attributes import has_labels
from ..outputs.separate import is_as_made, original_of, separated_from, unite
from ..scene.characters import check_not_edited, quoted, selected_meshes
from ..ui.messages import in_panel
from ..workflow import segment_list
from . import _needs, _report
from ._base import BaseOperator


class WKS_SEGMENT_OT_clear(BaseOperator, bpy.types.Operator):
    """Clear."""

    bl_idname = "wks_segment.clear"
    bl_label = "Clear"
    bl_description = (
        "Remove everything that was written to the selected objects, and nothing else. Asks first if that takes faces "
        "assigned by hand or separated objects"
    )
    bl_options = {"REGISTER", "UNDO"}

    needs = (_needs.no_job, _needs.object_mode, _needs.labeled_mesh)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        message = Message.joined(". ", _losses(selected_meshes(context)))
        if not message or not _report.has_window(context):
            return self.execute(context)
        return context.window_manager.invoke_confirm(
            self, event, title=in_panel("Clear"), message=in_panel(message), confirm_text=in_panel("Clear")
        )

    def run(self, context: bpy.types.Context) -> set[str]:
        selected = selected_meshes(context)
        for obj in selected:
            check_not_edited(obj)
        linked = [obj.name for obj in selected if has_labels(obj.data) and obj.data.library is not None]
        if linked and len(linked) == sum(has_labels(obj.data) for obj in selected):
            raise UserError(
                "There is nothing to clear: the segments of {names} are in another file: clear them there, or make it "
                "local first (Object > Relations)",
                names=quoted(linked),
            )
        names, warnings = {obj.name for obj in selected}, list[str]()
        originals = {original for obj in selected if (original := original_of(obj)) is not None}
        kept = [obj.name for original in originals for obj in unite(context, original)]
        # Separated objects are out of the scene by now, unless the user has changed them.
        remaining = originals | {obj for obj in context.scene.objects if obj.name in names}
        meshes = {obj.data for obj in remaining if obj.data.library is None}
        n_cleared = sum(clear_labels(mesh, warnings) for mesh in meshes)
        segment_list.fill(context.scene.wks_segment)
        if not any(obj.type == "MESH" and has_labels(obj.data) for obj in context.scene.objects):
            _report.hide_colors(context)
        if n_cleared == 1:
            _report.tell(self, {"INFO"}, "Cleared the segments of 1 mesh")
        else:
            _report.tell(self, {"INFO"}, Message("Cleared the segments of {count} meshes", count=n_cleared))
        if kept:
            template = "You have changed these separated objects, they stay: {names}"
            _report.tell(self, {"WARNING"}, Message(template, names=quoted(kept)))
        _report.tell_warnings(self, warnings)
        return {"FINISHED"}


def _losses(selected: list[bpy.types.Object]) -> list[Message]:
    """What Clear takes from the user that does not come back with Apply."""
    losses = []
    count = sum(faces_by_hand(mesh) for mesh in {obj.data for obj in selected})
    if count:
        losses.append(Message("{count:,} faces that were assigned by hand are cleared as well", count=count))
    originals = [original for obj in selected if (original := original_of(obj)) is not None]
    for original in dict.fromkeys(originals):
        separated = separated_from(original)
        removed = [obj for obj in separated if is_as_made(obj)]
        kept = [obj.name for obj in separated if obj not in removed]
        if separated:
            template = 'All {count} objects that were separated from "{object}" are removed, and it is shown again'
            if kept:
                template = (
                    '{count} objects that were separated from "{object}" are removed, and it is shown again; those '
                    "that you have changed stay: {names}"
                )
            losses.append(Message(template, count=len(removed), object=original.name, names=quoted(kept)))
    return losses
