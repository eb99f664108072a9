"""What Blender writes appears whole or not at all, wherever the disk ends."""

import shutil

import bpy
import numpy as np
import pytest
from builders import limbed
from full_disk import files_end_at

from wks_segment.blender.errors import UserError
from wks_segment.blender.outputs.id_map import save_image
from wks_segment.blender.render.contact_sheet import picture_scene, render
from wks_segment.blender.scene.complete_files import check_complete, check_obj
from wks_segment.blender.scene.file_formats import save_scene

STEPS = 12
"""Places at which the disk ends, from nothing to one byte too few."""


def saved_scene(path):
    save_scene(path)


def saved_picture(path):
    with picture_scene() as scene:
        scene.collection.objects.link(bpy.data.objects.new("camera", bpy.data.cameras.new("camera")))
        scene.camera = scene.objects["camera"]
        render(scene, path, 300, 200)


def saved_image(path):
    image = bpy.data.images.new("map", 64, 64)
    image.pixels.foreach_set(np.random.default_rng(0).random(64 * 64 * 4).astype(np.float32))
    save_image(image, path)


def character(scene):
    obj = limbed("Body")
    obj.data.materials.append(bpy.data.materials.new("Skin"))


WRITERS = {
    "scene.blend": saved_scene, "scene.glb": saved_scene, "scene.obj": saved_scene, "picture.png": saved_picture,
    "map.png": saved_image,
}  # fmt: skip


@pytest.fixture(params=WRITERS)
def written(request, scene, tmp_path):
    """A writer, and the file that it has written."""
    if request.param == "picture.png":
        request.getfixturevalue("needs_rendering")
    character(scene)
    path = tmp_path / "out" / request.param
    path.parent.mkdir()
    WRITERS[request.param](path)
    return WRITERS[request.param], path


def test_a_disk_that_ends_anywhere_leaves_the_old_file(written):
    write, path = written
    size, precious = path.stat().st_size, path.read_bytes()
    others = {each.name for each in path.parent.iterdir()}
    for n_bytes in [*range(0, size - 1, size // STEPS), size - 1]:
        with files_end_at(n_bytes), pytest.raises(UserError, match=path.name):
            write(path)
        assert path.read_bytes() == precious
        assert {each.name for each in path.parent.iterdir()} == others
    write(path)


def test_a_full_disk_is_the_reason(written, small_disk):
    write, path = written
    disk = small_disk(64)
    (disk / "filler").write_bytes(bytes(60_000))
    with pytest.raises(UserError, match="No space left on device"):
        write(disk / path.name)
    assert [each.name for each in disk.iterdir()] == ["filler"]


def damages(data):
    """A file without its end, in some places, and one without a piece in the middle."""
    for share in (0.1, 0.5, 0.9):
        yield data[: int(share * len(data))]
    for n_bytes in (1, 4, 24, 32):
        yield data[:-n_bytes]
    middle = len(data) // 2
    yield data[:middle] + data[middle + 4096 :] if len(data) > 10_000 else data[:middle] + data[middle + 40 :]
    yield b""


def test_a_damaged_file_is_not_complete(written, tmp_path):
    _, path = written
    if path.suffix == ".obj":
        return
    copy = tmp_path / f"copy{path.suffix}"
    shutil.copyfile(path, copy)
    check_complete(copy)
    for data in damages(path.read_bytes()):
        copy.write_bytes(data)
        with pytest.raises(OSError, match="copy"):
            check_complete(copy)


@pytest.mark.parametrize("compress", [True, False])
def test_a_scene_is_complete_compressed_or_not(scene, tmp_path, compress):
    character(scene)
    path = tmp_path / "scene.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True, compress=compress)
    check_complete(path)
    for data in damages(path.read_bytes()):
        path.write_bytes(data)
        with pytest.raises(OSError, match="scene"):
            check_complete(path)


def test_an_obj_file_has_all_faces_and_its_materials(scene, tmp_path):
    character(scene)
    hidden = limbed("Hidden")
    hidden.hide_viewport = True
    path = tmp_path / "two words.obj"
    save_scene(path)
    lines = path.read_bytes().splitlines(keepends=True)
    assert b"mtllib two words.mtl\n" in lines
    assert sorted(each.name for each in tmp_path.iterdir()) == ["two words.mtl", "two words.obj"]
    n_faces = sum(line.startswith(b"f ") for line in lines)
    check_obj(path, n_faces)
    for end in (b"", b"\n"):
        path.write_bytes(b"".join(lines[:-1]).removesuffix(b"\n") + end)
        with pytest.raises(OSError, match="two words"):
            check_obj(path, n_faces)


def test_relative_paths_stay_right(scene, tmp_path):
    (tmp_path / "textures").mkdir()
    texture = bpy.data.images.new("skin", 4, 4)
    texture.filepath_raw = str(tmp_path / "textures" / "skin.png")
    texture.save()
    texture.use_fake_user = True
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "first.blend"))
    texture.filepath = "//textures/skin.png"
    save_scene(tmp_path / "second.blend")
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "second.blend"), load_ui=False)
    assert bpy.data.images["skin"].filepath == "//textures/skin.png"
