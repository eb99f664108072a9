"""Registers and unregisters all classes, handlers and commands of the extension."""

from __future__ import annotations

from typing import Any

import bpy

from .operators.accept import WKS_SEGMENT_OT_accept
from .operators.apply import WKS_SEGMENT_OT_apply
from .operators.apply_ranked import WKS_SEGMENT_OT_apply_ranked
from .operators.assign_faces import WKS_SEGMENT_OT_assign_faces, WKS_SEGMENT_OT_forget_faces, WKS_SEGMENT_OT_new_segment
from .operators.bake import WKS_SEGMENT_OT_bake
from .operators.cancel import WKS_SEGMENT_OT_cancel
from .operators.clear import WKS_SEGMENT_OT_clear
from .operators.discard import WKS_SEGMENT_OT_discard
from .operators.learn import WKS_SEGMENT_OT_learn
from .operators.load_model import WKS_SEGMENT_OT_load_model
from .operators.merge_segments import WKS_SEGMENT_OT_merge_segments
from .operators.model_list import WKS_SEGMENT_OT_duplicate_model, WKS_SEGMENT_OT_remove_model, WKS_SEGMENT_OT_use_model
from .operators.name_parts import WKS_SEGMENT_OT_name_parts
from .operators.name_segment import WKS_SEGMENT_OT_name_segment
from .operators.rank import WKS_SEGMENT_OT_rank
from .operators.restore_segments import WKS_SEGMENT_OT_refresh_segments, WKS_SEGMENT_OT_restore_segments
from .operators.save_model import WKS_SEGMENT_OT_save_model
from .operators.segments_from import WKS_SEGMENT_OT_segments_from
from .operators.select_segment import WKS_SEGMENT_OT_select_segment
from .operators.separate import WKS_SEGMENT_OT_separate
from .operators.show_id_map import WKS_SEGMENT_OT_show_id_map
from .operators.show_segments import (
    WKS_SEGMENT_OT_hide_segment,
    WKS_SEGMENT_OT_isolate_segment,
    WKS_SEGMENT_OT_show_segments,
)
from .operators.split_segment import WKS_SEGMENT_OT_split_segment
from .operators.teach import WKS_SEGMENT_OT_list_bones, WKS_SEGMENT_OT_teach
from .operators.transfer import WKS_SEGMENT_OT_transfer
from .operators.unwrap import WKS_SEGMENT_OT_unwrap
from .operators.update import WKS_SEGMENT_OT_update
from .props import changes, preferences, presets
from .props.bone_item import WKSBoneItem
from .props.label_set import WKSLabelSet
from .props.model_item import WKSModelItem, WKSRankItem
from .props.segment_item import WKSSegmentItem
from .props.settings import WKSSegmentSettings
from .ui import main_panel, menu, models_panel, segments_panel, teach_panel
from .ui.color_icons import COLOR_ICONS, ColorIcons
from .ui.preview import ViewportPreview
from .ui.translations import TRANSLATIONS
from .ui.viewport_colors import VIEWPORT_COLORS, ViewportColors
from .workflow.active_object import ACTIVE_OBJECT, ActiveObject
from .workflow.background_job import JOB_HOLDER, JobHolder
from .workflow.first_colors import FIRST_COLORS, FirstColors
from .workflow.live_session import SESSION, Session
from .workflow.property_changes import PropertyChanges

OPERATORS = (
    WKS_SEGMENT_OT_learn,
    WKS_SEGMENT_OT_name_parts,
    WKS_SEGMENT_OT_teach,
    WKS_SEGMENT_OT_list_bones,
    WKS_SEGMENT_OT_apply,
    WKS_SEGMENT_OT_cancel,
    WKS_SEGMENT_OT_update,
    WKS_SEGMENT_OT_accept,
    WKS_SEGMENT_OT_discard,
    WKS_SEGMENT_OT_clear,
    WKS_SEGMENT_OT_bake,
    WKS_SEGMENT_OT_show_id_map,
    WKS_SEGMENT_OT_unwrap,
    WKS_SEGMENT_OT_separate,
    WKS_SEGMENT_OT_transfer,
    WKS_SEGMENT_OT_segments_from,
    WKS_SEGMENT_OT_save_model,
    WKS_SEGMENT_OT_load_model,
    WKS_SEGMENT_OT_use_model,
    WKS_SEGMENT_OT_duplicate_model,
    WKS_SEGMENT_OT_remove_model,
    WKS_SEGMENT_OT_rank,
    WKS_SEGMENT_OT_apply_ranked,
    WKS_SEGMENT_OT_select_segment,
    WKS_SEGMENT_OT_hide_segment,
    WKS_SEGMENT_OT_isolate_segment,
    WKS_SEGMENT_OT_show_segments,
    WKS_SEGMENT_OT_name_segment,
    WKS_SEGMENT_OT_merge_segments,
    WKS_SEGMENT_OT_split_segment,
    WKS_SEGMENT_OT_restore_segments,
    WKS_SEGMENT_OT_refresh_segments,
    WKS_SEGMENT_OT_assign_faces,
    WKS_SEGMENT_OT_new_segment,
    WKS_SEGMENT_OT_forget_faces,
)
CLASSES = (
    preferences.WKSSegmentPreferences,
    WKSSegmentItem,
    WKSModelItem,
    WKSLabelSet,
    WKSRankItem,
    WKSBoneItem,
    WKSSegmentSettings,
    *OPERATORS,
    *menu.CLASSES,
    *presets.CLASSES,
    # Blender shows sub-panels in the order of their registration.
    main_panel.CLASSES[0],
    *segments_panel.CLASSES,
    *teach_panel.CLASSES,
    *models_panel.CLASSES,
    *main_panel.CLASSES[1:],
)
COMMAND_NAME = "wks_segment"
"""Name of the command: `blender --command wks_segment`."""

_commands: list[Any] = []
"""Handles of the registered command, which Blender needs to unregister it."""


def _run_command(arguments: list[str]) -> int:
    """The command line, which is imported only when it is used."""
    from .cli.main import run

    return run(arguments)


def register() -> None:
    """Called by Blender when the extension is enabled."""
    changes.set_listener(PropertyChanges())
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Scene.wks_segment = bpy.props.PointerProperty(type=WKSSegmentSettings)
    setattr(bpy.types.WindowManager, JOB_HOLDER, JobHolder())
    session = Session(ViewportPreview())
    setattr(bpy.types.WindowManager, SESSION, session)
    setattr(bpy.types.WindowManager, FIRST_COLORS, FirstColors(ViewportPreview()))
    setattr(bpy.types.WindowManager, ACTIVE_OBJECT, ActiveObject(lambda: session.follow(bpy.context.scene)))
    setattr(bpy.types.WindowManager, VIEWPORT_COLORS, ViewportColors())
    setattr(bpy.types.WindowManager, COLOR_ICONS, ColorIcons())
    bpy.app.translations.register(__name__, TRANSLATIONS)
    bpy.types.VIEW3D_MT_object.append(menu.draw_in_object_menu)
    _commands.append(bpy.utils.register_cli_command(COMMAND_NAME, _run_command))


def unregister() -> None:
    """Called by Blender when the extension is disabled."""
    bpy.utils.unregister_cli_command(_commands.pop())
    bpy.types.VIEW3D_MT_object.remove(menu.draw_in_object_menu)
    bpy.app.translations.unregister(__name__)
    for name in (COLOR_ICONS, VIEWPORT_COLORS, ACTIVE_OBJECT, FIRST_COLORS, SESSION, JOB_HOLDER):
        getattr(bpy.types.WindowManager, name).close()
        delattr(bpy.types.WindowManager, name)
    del bpy.types.Scene.wks_segment
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
    changes.remove_listener()
