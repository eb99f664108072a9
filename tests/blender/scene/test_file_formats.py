"""Formats that Blender has no importer of its own for."""

import bpy
import numpy as np
import pytest
from builders import coordinates, limbed_rigged

from wks_segment.blender.errors import UserError
from wks_segment.blender.scene import file_formats

pytestmark = pytest.mark.usefixtures("scene")
PYRAMID = """OFF
# a comment
5 5 8
0 0 0
1 0 0  0.5 0.5 0.5 1
1 1 0
0 1 0   # the last corner of the base
0.5 0.5 1

4 0 1 2 3
3 0 4 1 255 0 0
3 1 4 2
3 2 4 3
3 3 4 0
"""


def opened(path):
    (objects,) = file_formats.open_files([path])
    return objects


@pytest.mark.parametrize("text", [PYRAMID, PYRAMID.replace("OFF\n", "COFF "), PYRAMID.replace("\n", "\r\n")])
def test_off_is_read(tmp_path, text):
    path = tmp_path / "Pyramid.OFF"
    path.write_bytes(text.encode())
    (obj,) = opened(path)
    assert obj.name == "Pyramid"
    np.testing.assert_allclose(coordinates(obj.data)[[1, 4]], [(1, 0, 0), (0.5, 0.5, 1)])
    assert [list(face.vertices) for face in obj.data.polygons][:2] == [[0, 1, 2, 3], [0, 4, 1]]


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("", "file is empty"),
        ("solid cube\n", "does not begin with"),
        ("OFF BINARY\n", "does not begin with"),
        (PYRAMID.replace("3 3 4 0\n", ""), "ends before all"),
        (PYRAMID.replace("3 1 4 2", "3 1 9 2"), "line 12 "),
        (PYRAMID.replace("1 1 0", "1 x 0"), "line 6 "),
        (PYRAMID.replace("3 1 4 2", "3 1 4"), "line 12 "),
    ],
)
def test_damaged_off_is_refused_with_the_line(tmp_path, text, match):
    path = tmp_path / "broken.off"
    path.write_text(text)
    with pytest.raises(UserError, match=match):
        opened(path)


def test_vrm_is_read(tmp_path):
    limbed_rigged()
    bpy.ops.export_scene.gltf(filepath=str(tmp_path / "avatar.glb"))
    path = (tmp_path / "avatar.glb").rename(tmp_path / "avatar.vrm")
    assert "Walker" in [obj.name for obj in opened(path)]
    assert bpy.data.objects["Walker"].modifiers[0].type == "ARMATURE"


@pytest.mark.parametrize("suffix", [".dae", ".3ds", ".max", ".bvh"])
def test_other_formats_are_refused_with_what_to_do(tmp_path, suffix):
    path = tmp_path / f"character{suffix}"
    path.write_text("x")
    with pytest.raises(UserError, match=r"save it as \.glb, \.fbx or \.blend"):
        opened(path)
