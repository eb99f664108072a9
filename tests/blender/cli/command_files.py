"""Helpers of tests of the command line: quick settings, files of test characters, and how a command must fail."""

import bpy

QUICK = ("--eigenpairs", 30, "--energies", 40, "--segments", 4)
BENDS = (0.0, 0.3, 0.6)


def empty_scene():
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)


def save(path):
    """Write the current scene to a file, in the format of its suffix."""
    name = str(path)
    if path.suffix == ".blend":
        bpy.ops.wm.save_as_mainfile(filepath=name, copy=True)
    elif path.suffix == ".glb":
        bpy.ops.export_scene.gltf(filepath=name)
    elif path.suffix == ".gltf":
        bpy.ops.export_scene.gltf(filepath=name, export_format="GLTF_SEPARATE")
    elif path.suffix == ".fbx":
        bpy.ops.export_scene.fbx(filepath=name)
    else:
        getattr(bpy.ops.wm, f"{path.suffix[1:]}_export")(filepath=name)
    return path


def mesh_of_scene():
    (mesh,) = [obj for obj in bpy.context.scene.objects if obj.type == "MESH" and not obj.name.startswith("Ico")]
    return mesh


def assert_fails(done, *words):
    """Check that a command failed with exit code 1 and a message with some words, without a traceback."""
    assert done.code == 1, done
    _, separator, message = ("\n" + done.err).partition("\nwks_segment: ")  # after the output of importers
    assert separator, done
    assert "Traceback" not in message, done
    for word in words:
        assert str(word) in message, done
