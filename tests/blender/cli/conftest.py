"""Fixtures of tests of the command line."""

import pytest


@pytest.fixture(scope="session")
def folder(extension, tmp_path_factory):
    """Folder with files of the test character: animated, with shape keys, and three poses in each static format."""
    # Not at the top: pytest loads this file also where bpy is not installed.
    from builders import limbed, limbed_keys, limbed_rigged
    from command_files import BENDS, empty_scene, save

    folder = tmp_path_factory.mktemp("characters")
    empty_scene()
    limbed_rigged()
    for suffix in (".blend", ".glb", ".gltf", ".fbx"):
        save(folder / f"walker{suffix}")
    empty_scene()
    limbed_keys(0.4, 0.8)
    save(folder / "keyed.blend")
    for i, bend in enumerate(BENDS):
        empty_scene()
        limbed(f"Pose {i}", bend)
        for suffix in (".obj", ".ply", ".stl", ".blend"):
            save(folder / f"pose_{i}{suffix}")
    empty_scene()
    return folder
