"""Properties of the artist that happen to have our names are left alone, on meshes, objects, materials and images."""

import bpy
import pytest
from builders import limbed, select
from painted_objects import stripes

from wks_segment.blender.outputs.labels import write_labels
from wks_segment.blender.outputs.options import OutputOptions

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment
NAMES = (
    "wks_segment_note", "wks_segment_piece", "wks_segment_whole", "wks_segment_component", "wks_segment_template",
    "wks_segment_made", "wks_segment_id_map", "wks_segment_id_map_made", "wks_segment_note.001",
)  # fmt: skip
VALUES = {"text": "mine", "number": 3, "group": {"of": "mine", "on": 1}, "list": [1, 2, 3]}


def kept(block):
    return {name: getattr(block[name], "to_dict", lambda name=name: plain(block[name]))() for name in NAMES}


def plain(value):
    return value if isinstance(value, str) or not hasattr(value, "__len__") else list(value)


@pytest.mark.parametrize("value", VALUES)
def test_properties_with_our_names_stay(settings, value):
    obj = limbed(subdivisions=3)
    skin = bpy.data.materials.new("Skin")
    obj.data.materials.append(skin)
    for name in NAMES:
        obj[name] = obj.data[name] = skin[name] = VALUES[value]
    expected = dict.fromkeys(NAMES, VALUES[value])
    for _ in range(2):
        write_labels(obj.data, stripes(obj.data), OutputOptions(materials=True))
        select(obj)
        assert OPS.separate() == {"FINISHED"}
        assert len(bpy.data.objects) == 5
        assert kept(obj) == kept(obj.data) == kept(skin) == expected
        assert OPS.clear() == {"FINISHED"}
        assert kept(obj) == kept(obj.data) == kept(skin) == expected
        assert bpy.data.objects.keys() == ["Limbed"]
        assert [material.name for material in obj.data.materials] == ["Skin"]
        assert not obj.hide_get()


@pytest.mark.parametrize("value", VALUES)
def test_nothing_of_ours_is_nothing_to_clear(settings, value):
    obj = limbed(subdivisions=3)
    for name in NAMES:
        obj[name] = obj.data[name] = VALUES[value]
    obj.data.attributes.new("wks_segment", "INT", "FACE")
    obj.data.attributes.new("wks_segment_vertex", "INT", "POINT")
    select(obj)
    assert not OPS.clear.poll()
