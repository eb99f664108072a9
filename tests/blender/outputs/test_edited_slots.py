"""Faces get back the material that they had, whatever happened to slots in between."""

import bpy
import numpy as np
import pytest
from builders import limbed, select
from painted_objects import stripes

from wks_segment.blender.outputs.labels import write_labels
from wks_segment.blender.outputs.options import OutputOptions

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment


@pytest.fixture
def obj(settings):
    """An object with three own materials, one of which no face uses, and materials of segments."""
    obj = limbed(subdivisions=3)
    for name in ("Skin", "Cloth", "Metal"):
        obj.data.materials.append(bpy.data.materials.new(name))
    index = np.arange(len(obj.data.polygons), dtype=np.int32) % 3
    obj.data.polygons.foreach_set("material_index", np.where(index == 1, 0, index).astype(np.int32))
    labeled(obj)
    return obj


def labeled(obj):
    write_labels(obj.data, stripes(obj.data), OutputOptions(materials=True))
    select(obj)


def shown(obj):
    """Name of the material that each face shows."""
    names = [slot.material.name if slot.material else None for slot in obj.material_slots]
    return [names[min(p.material_index, len(names) - 1)] if names else None for p in obj.data.polygons]


EXPECTED = ["Metal" if i % 3 == 2 else "Skin" for i in range(320)]


def remove_slot(obj, name):
    obj.active_material_index = [slot.material.name for slot in obj.material_slots].index(name)
    bpy.ops.object.material_slot_remove()


def move_up(obj, name, steps):
    obj.active_material_index = [slot.material.name for slot in obj.material_slots].index(name)
    for _ in range(steps):
        bpy.ops.object.material_slot_move(direction="UP")


def renamed(obj):
    bpy.data.materials["Skin"].name = "Hero Skin"
    remove_slot(obj, "Hero Skin")


def with_new_slot(obj):
    obj.data.materials.append(bpy.data.materials.new("Fur"))
    move_up(obj, "Fur", 7)


def through_several(obj):
    move_up(obj, "Segment 3", 4)
    remove_slot(obj, "Skin")
    remove_slot(obj, "Segment 2")
    bpy.ops.object.material_slot_remove_unused()
    labeled(obj)
    move_up(obj, "Segment 1", 1)


EDITS = {
    "nothing": (lambda obj: None, ["Skin", "Cloth", "Metal"]),
    "unused own slot removed": (lambda obj: remove_slot(obj, "Cloth"), ["Skin", "Metal"]),
    "used own slot removed": (lambda obj: remove_slot(obj, "Skin"), ["Cloth", "Metal", "Skin"]),
    "segment's slot moved": (lambda obj: move_up(obj, "Segment 1", 3), ["Skin", "Cloth", "Metal"]),
    "own slot moved": (lambda obj: move_up(obj, "Metal", 2), ["Metal", "Skin", "Cloth"]),
    "first segment's slot removed": (lambda obj: remove_slot(obj, "Segment 1"), ["Skin", "Cloth", "Metal"]),
    "segment's slot removed": (lambda obj: remove_slot(obj, "Segment 3"), ["Skin", "Cloth", "Metal"]),
    "all segments' slots removed": (
        lambda obj: [remove_slot(obj, f"Segment {i}") for i in (2, 1, 4, 3)], ["Skin", "Cloth", "Metal"],
    ),
    "unused slots removed": (lambda obj: bpy.ops.object.material_slot_remove_unused(), ["Skin", "Metal"]),
    "all slots removed": (lambda obj: obj.data.materials.clear(), ["Skin", "Metal"]),
    "new slot": (with_new_slot, ["Fur", "Skin", "Cloth", "Metal"]),
    "several": (through_several, None),
}  # fmt: skip


@pytest.mark.parametrize("edit", EDITS)
def test_clear_gives_faces_their_material_back(obj, edit):
    change, slots = EDITS[edit]
    change(obj)
    OPS.clear()
    assert shown(obj) == EXPECTED
    assert slots is None or [material.name for material in obj.data.materials] == slots
    assert not [name for name in bpy.data.materials.keys() if name.startswith("Segment")]  # noqa: SIM118


def test_a_renamed_material_is_given_back(obj):
    renamed(obj)
    OPS.clear()
    assert shown(obj) == ["Hero Skin" if name == "Skin" else name for name in EXPECTED]


def test_a_replaced_material_of_a_slot_stays(obj):
    obj.material_slots[0].material = bpy.data.materials.new("Wool")
    OPS.clear()
    assert shown(obj) == ["Wool" if name == "Skin" else name for name in EXPECTED]
    assert [material.name for material in obj.data.materials] == ["Wool", "Cloth", "Metal"]


def test_faces_that_the_artist_assigned_stay(obj):
    obj.data.polygons[5].material_index = 1
    obj.data.materials.append(bpy.data.materials.new("Fur"))
    obj.data.polygons[6].material_index = len(obj.data.materials) - 1
    move_up(obj, "Segment 1", 2)
    OPS.clear()
    expected = list(EXPECTED)
    expected[5:7] = ["Cloth", "Fur"]
    assert shown(obj) == expected


def test_what_cannot_be_given_back_is_left_and_named(obj, printed):
    bpy.data.materials.remove(bpy.data.materials["Skin"])
    before = shown(obj)
    printed()
    OPS.clear()
    lost = EXPECTED.count("Skin")
    assert shown(obj) == ["Metal" if name == "Metal" else old for name, old in zip(EXPECTED, before, strict=True)]
    out = printed().out
    assert f'{lost} faces of "Limbed" keep "Segment 1", "Segment 2", "Segment 3", "Segment 4"' in out


def test_slots_of_objects_keep_their_materials(settings):
    obj = limbed(subdivisions=3)
    for name in ("A", "B"):
        obj.data.materials.append(bpy.data.materials.new(name))
    obj.material_slots[1].link = "OBJECT"
    obj.material_slots[1].material = bpy.data.materials.new("On the object")
    obj.data.polygons.foreach_set("material_index", np.arange(320, dtype=np.int32) % 2)
    before = shown(obj)
    labeled(obj)
    move_up(obj, "Segment 1", 2)
    OPS.clear()
    assert [(slot.link, slot.material.name) for slot in obj.material_slots] == [
        ("DATA", "A"),
        ("OBJECT", "On the object"),
    ]
    assert shown(obj) == before


def test_a_material_that_the_artist_put_on_an_object_in_our_slot_stays(obj):
    slot = obj.material_slots["Segment 2"]
    slot.link, slot.material = "OBJECT", bpy.data.materials.new("Gold")
    before = shown(obj)
    labeled(obj)
    assert obj.material_slots["Gold"].link == "OBJECT"
    OPS.clear()
    assert [slot.name for slot in obj.material_slots] == ["Skin", "Cloth", "Metal", "Gold"]
    assert shown(obj) == ["Gold" if name == "Gold" else own for name, own in zip(before, EXPECTED, strict=True)]


def test_mesh_without_materials(settings):
    obj = limbed(subdivisions=3)
    labeled(obj)
    remove_slot(obj, "Segment 2")
    OPS.clear()
    assert not obj.material_slots
    assert "material_index" not in obj.data.attributes


@pytest.mark.parametrize("step", ["learn", "apply", "update", "merge_segments", "clear"])
def test_faces_that_cannot_get_their_material_back_are_named(obj, settings, printed, step):
    OPS.clear()
    settings.write_materials = True
    OPS.learn()
    bpy.data.materials.remove(bpy.data.materials["Metal"])
    n_lost = sum(name == "Metal" for name in EXPECTED)
    if step == "update":
        settings.smoothness = 2.0
    printed()
    getattr(OPS, step)(**{"into": 1} if step == "merge_segments" else {})
    assert f'{n_lost} faces of "Limbed" keep "Segment' in printed().out
