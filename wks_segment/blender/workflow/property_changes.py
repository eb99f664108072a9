"""What follows from changed properties: labels, the model in use, and names and colors on meshes."""

from __future__ import annotations

from typing import Any

import bpy

from ...core.message import Message, message_of
from ..errors import UserError
from . import bone_list, model_library, pipeline, segment_list
from .all_or_nothing import all_or_nothing
from .live_session import session_of


class PropertyChanges:
    """The `PropertyListener` of the extension."""

    def labels_outdated(self, settings: Any) -> None:
        """Let labels follow the settings."""
        # From now on the fields are about this object, though the user may have clicked it this moment.
        subject = segment_list.shown_object(settings)
        settings.shown = "" if subject is None else subject.data.name
        session_of(bpy.context).schedule(settings.id_data)

    def outputs_changed(self, settings: Any) -> None:
        """Let outputs follow the settings; at once where no model is needed for it."""
        self.labels_outdated(settings)
        session = session_of(bpy.context)
        others = [obj for obj in segment_list.chosen(settings) if not session.leads(obj)]
        if others and bpy.context.mode == "OBJECT":
            warnings: list[str] = []
            try:
                with all_or_nothing(bpy.context):
                    for mesh in segment_list.meshes_of(others):
                        pipeline.rewrite_outputs(settings, mesh, warnings)
            except UserError as error:
                warnings = [message_of(error)]
            if warnings:
                session.tell(Message.joined(" ", dict.fromkeys(warnings)))

    def palette_chosen(self, settings: Any) -> None:
        """Give the selected objects, and those that share their labels, the colors of the palette."""
        with all_or_nothing(bpy.context):
            segment_list.choose_palette(settings)

    def model_chosen(self, settings: Any) -> None:
        """Use the model of the active row."""
        model_library.use(settings, settings.active_model)

    def model_renamed(self, settings: Any, row: Any) -> None:
        """Keep the names of models unique."""
        model_library.make_unique(settings, row)

    def rename_part(self, settings: Any, labels: str, part: int, name: str) -> None:
        """Rename a part wherever its name is written."""
        with all_or_nothing(bpy.context):
            segment_list.rename(settings, labels, part, name)

    def recolor_part(self, settings: Any, labels: str, part: int, color: tuple[float, float, float]) -> None:
        """Recolor a part wherever its color is written."""
        with segment_list.leaving_edit_mode(bpy.context), all_or_nothing(bpy.context):
            segment_list.recolor(settings, labels, part, color)

    def bone_number_changed(self, settings: Any) -> None:
        """Choose as many bones of the tree as parts."""
        bone_list.choose(settings)

    def bones_chosen(self, settings: Any) -> None:
        """Show how many parts are chosen."""
        bone_list.count_chosen(settings)
