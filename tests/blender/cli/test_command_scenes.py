"""Characters in .blend files that are disabled, or in another scene."""

import bpy
import pytest
from builders import limbed, limbed_rigged, select
from command_files import QUICK, assert_fails

from wks_segment.blender.scene.characters import evaluated_objects


def into_collection(*objects):
    collection = bpy.data.collections.new("Character")
    bpy.context.scene.collection.children.link(collection)
    for obj in objects:
        bpy.context.scene.collection.objects.unlink(obj)
        collection.objects.link(obj)
    return collection


def saved(tmp_path):
    path = tmp_path / "scene.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True)
    return path


@pytest.mark.parametrize("disabled", ["collection", "parent collection", "excluded", "object"])
def test_what_is_disabled_is_refused_by_name(command, tmp_path, disabled):
    obj = limbed_rigged()
    collection = into_collection(obj, obj.parent)
    if disabled == "object":
        obj.hide_viewport = True
    elif disabled == "excluded":
        bpy.context.view_layer.layer_collection.children["Character"].exclude = True
    elif disabled == "collection":
        collection.hide_viewport = True
    else:
        outer = bpy.data.collections.new("Outer")
        bpy.context.scene.collection.children.unlink(collection)
        bpy.context.scene.collection.children.link(outer)
        outer.children.link(collection)
        outer.hide_viewport = True
    model = tmp_path / "model.json"
    done = command("learn", saved(tmp_path), "--frames", 3, *QUICK, "--model", model)
    assert_fails(done, "all mesh objects in it are disabled", '"Walker"')
    assert not model.exists()
    done = command("segment", saved(tmp_path), "--object", "Walker", *QUICK)
    assert_fails(done, "disabled", '"Walker"')


def test_what_is_disabled_beside_others_is_named(command, tmp_path):
    limbed("Seen")
    off = limbed("Off")
    into_collection(off).hide_viewport = True
    done = command("segment", saved(tmp_path), *QUICK, "--json")
    assert [pose["name"] for pose in done.result["poses"]] == ["Seen"]
    assert 'Left out, disabled in viewports: "Off"' in done.result["notes"]


@pytest.mark.usefixtures("scene")
def test_what_is_only_hidden_is_evaluated():
    first, second = limbed("Hidden", subdivisions=1), limbed("In hidden collection", subdivisions=1)
    into_collection(second)
    select(first)
    first.hide_set(True)
    bpy.context.view_layer.layer_collection.children["Character"].hide_viewport = True
    assert evaluated_objects(bpy.context.view_layer) == {first, second}


def test_a_mesh_in_another_scene_is_found_and_the_scene_is_named(command, tmp_path):
    limbed("Body")
    bpy.context.window.scene = bpy.data.scenes.new("Empty")
    output = tmp_path / "out.blend"
    done = command("segment", saved(tmp_path), *QUICK, "--output", output, "--json")
    assert done.code == 0, done
    assert [pose["name"] for pose in done.result["poses"]] == ["Body"]
    assert 'Taken from the scene "Scene"' in done.result["notes"]
    bpy.ops.wm.open_mainfile(filepath=str(output))
    assert "wks_segment" in bpy.data.objects["Body"].data.attributes


def test_several_other_scenes_with_meshes_are_named(command, tmp_path):
    limbed("Body")
    other = bpy.data.scenes.new("Second")
    bpy.context.window.scene = other
    limbed("Body 2")
    bpy.context.window.scene = bpy.data.scenes.new("Empty")
    path = saved(tmp_path)
    assert_fails(command("segment", path, *QUICK), '"Scene", "Second"', "save the file")
    done = command("segment", path, "--object", "Body 2", *QUICK, "--json")
    assert 'Taken from the scene "Second"' in done.result["notes"]
