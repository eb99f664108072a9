"""The Object menu and presets: where people look for what they do not find in the sidebar."""

from pathlib import Path
from types import SimpleNamespace
from unittest.mock import MagicMock

import bpy
import pytest

from wks_segment.blender import registration
from wks_segment.blender.props import presets
from wks_segment.blender.ui import menu

pytestmark = pytest.mark.usefixtures("scene")


def drawn(cls):
    """The layout that a menu was drawn on."""
    layout = MagicMock()
    cls.draw(SimpleNamespace(layout=layout), bpy.context)
    return layout


def test_menu_has_the_operators_for_objects():
    layout = drawn(menu.WKS_SEGMENT_MT_object)
    assert layout.operator_context == "INVOKE_DEFAULT"
    named = {call.args[0] for call in layout.operator.call_args_list + layout.operator_menu_enum.call_args_list}
    assert named <= {cls.bl_idname for cls in registration.OPERATORS}
    assert {"wks_segment.learn", "wks_segment.apply", "wks_segment.bake", "wks_segment.segments_from"} <= named


def test_menu_is_in_the_object_menu_while_enabled(extension):
    functions = bpy.types.VIEW3D_MT_object.draw._draw_funcs
    assert functions.count(menu.draw_in_object_menu) == 1
    extension.unregister()
    try:
        assert menu.draw_in_object_menu not in functions
    finally:
        extension.register()
    layout = MagicMock()
    menu.draw_in_object_menu(SimpleNamespace(layout=layout), bpy.context)
    layout.menu.assert_called_once_with("WKS_SEGMENT_MT_object")


@pytest.fixture
def user_folder(tmp_path, monkeypatch):
    """A folder of scripts of the user's own, so that no preset outlives the test."""
    monkeypatch.setattr(bpy.utils, "user_resource", lambda kind, path="", create=False: made(tmp_path / path))
    monkeypatch.setattr(bpy.utils, "preset_paths", lambda subdir: [str(tmp_path / "presets" / subdir)])
    label = presets.WKS_SEGMENT_MT_presets.bl_label
    yield tmp_path
    presets.WKS_SEGMENT_MT_presets.bl_label = label  # Blender puts the name of the preset there


def made(path):
    Path(path).mkdir(parents=True, exist_ok=True)
    return str(path)


def test_preset_restores_settings(settings, user_folder):
    settings.n_segments, settings.sides, settings.snap_to, settings.smoothness = 11, "two", {"seams"}, 2.5
    settings.model_summary = "of this file"
    assert bpy.ops.wks_segment.add_preset(name="Hero") == {"FINISHED"}
    (file,) = user_folder.rglob("*.py")
    for name in presets.PRESET_SETTINGS:
        settings.property_unset(name)
    settings.model_summary = "of another file"
    bpy.ops.script.execute_preset(filepath=str(file), menu_idname="WKS_SEGMENT_MT_presets")
    assert (settings.n_segments, settings.sides, settings.snap_to, settings.smoothness) == (11, "two", {"seams"}, 2.5)
    assert settings.model_summary == "of another file"


def test_preset_settings_exist(settings):
    assert set(presets.PRESET_SETTINGS) <= set(settings.bl_rna.properties.keys())
