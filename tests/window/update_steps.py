"""Runs in Blender, before and after an update: `blender --background --python update_steps.py -- use|check VERSION`.

`use` leaves everything that a user can have: a labeled file with a model, names and settings, a model in the model
folder, preferences and a preset. `check` finds all of it again, and works with it.
"""

import importlib
import sys
import tomllib
from pathlib import Path

import bpy
import numpy as np

MODULE = "bl_ext.wks_repository.wks_segment"
FILE, MODELS = "/window/kept.blend", "/window/models"
PRESET = Path(bpy.utils.user_resource("SCRIPTS", path="presets/wks_segment", create=True)) / "Of_Mine.py"


def preferences():
    return bpy.context.preferences.addons[MODULE].preferences


def labels():
    mesh = bpy.data.objects["Creature"].data
    return np.array([value.value for value in mesh.attributes["wks_segment"].data])


def use():
    bpy.ops.wm.read_homefile(use_empty=True, app_template="")
    scene = bpy.context.scene
    builder = importlib.import_module(f"{MODULE}.wks_segment.blender.cli.creature")
    scene.frame_start, scene.frame_end = builder.FIRST_FRAME, builder.LAST_FRAME
    body = builder.build_creature(scene)
    bpy.context.view_layer.objects.active = body
    body.select_set(True)
    settings = scene.wks_segment
    settings.pose_count, settings.n_segments, settings.sides = 2, 5, "two"
    assert bpy.ops.wks_segment.learn() == {"FINISHED"}
    settings.segments[0].name = "Trunk"
    Path(MODELS).mkdir()
    assert bpy.ops.wks_segment.save_model(filepath=f"{MODELS}/creature.json") == {"FINISHED"}
    preferences().model_folder, preferences().cache_megabytes = MODELS, 123
    bpy.ops.wm.save_userpref()
    # Blender 4.3 cannot write presets with the Python 3.13 that Debian builds it for.
    PRESET.write_text("import bpy\nsettings = bpy.context.scene.wks_segment\nsettings.n_segments = 5\n")
    bpy.ops.wm.save_as_mainfile(filepath=FILE)


def check():
    assert (preferences().model_folder, preferences().cache_megabytes) == (MODELS, 123)
    bpy.ops.wm.open_mainfile(filepath=FILE)
    body, settings = bpy.data.objects["Creature"], bpy.context.scene.wks_segment
    assert (settings.pose_count, settings.n_segments, settings.sides) == (2, 5, "two")
    assert len(settings.models) == 1
    before = labels()
    assert bpy.ops.wks_segment.apply() == {"FINISHED"}
    # Without a window the list of a file of 0.1.0 is filled by this, and not when the file is opened.
    assert "Trunk" in [row.name for row in settings.segments], [row.name for row in settings.segments]
    assert (labels() == before).mean() > 0.95, f"{(labels() == before).mean():.3f} of the faces keep their label"
    settings.n_segments = 3
    bpy.ops.script.execute_preset(filepath=str(PRESET), menu_idname="WKS_SEGMENT_MT_presets")
    assert settings.n_segments == 5
    bpy.context.view_layer.objects.active = body
    assert bpy.ops.wks_segment.load_model(filepath=f"{MODELS}/creature.json") == {"FINISHED"}
    assert bpy.ops.wks_segment.clear() == {"FINISHED"}
    assert not [name for name in map(str, body.data.attributes.keys()) if name.startswith("wks_segment")]


step, version = sys.argv[sys.argv.index("--") + 1 :]
assert MODULE in bpy.context.preferences.addons, "the extension is not enabled"
package = Path(importlib.import_module(MODULE).__file__).parent
assert tomllib.loads((package / "blender_manifest.toml").read_text())["version"] == version
{"use": use, "check": check}[step]()
