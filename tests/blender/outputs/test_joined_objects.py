"""Objects with segments that were duplicated, joined, split or appended: Clear takes back all of ours in each."""

from dataclasses import replace

import bpy
import numpy as np
import pytest
from builders import limbed, numbers, select
from painted_objects import FACE_SETS, seams_of, stripes

from wks_segment.blender.outputs.labels import write_labels
from wks_segment.blender.outputs.options import OutputOptions
from wks_segment.blender.outputs.origin import Origin, enter_origin
from wks_segment.blender.outputs.overrides import keep_by_hand_of
from wks_segment.blender.parts.part_style import SetNotes
from wks_segment.blender.props.label_set import style_of

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment
ALL = OutputOptions(ucupaint=True, materials=True, vertex_groups="hard", face_sets=True, seams=True)


def character(name, materials, parts=0, options=ALL):
    """An object with own materials, a vertex group, seams and face sets; with segments, if it has parts."""
    obj = limbed(name, subdivisions=2)
    mesh = obj.data
    for material in materials:
        mesh.materials.append(bpy.data.materials.new(material))
    n = len(mesh.polygons)
    mesh.polygons.foreach_set("material_index", np.arange(n, dtype=np.int32) % max(len(materials), 1))
    mesh.edges.foreach_set("use_seam", np.arange(len(mesh.edges)) % 7 == 0)
    mesh.attributes.new(FACE_SETS, "INT", "FACE").data.foreach_set("value", 1 + np.arange(n, dtype=np.int32) // 40)
    obj.vertex_groups.new(name=f"Of {name}").add([0, 1], 0.5, "REPLACE")
    mesh.update()
    if parts:
        write_labels(mesh, stripes(mesh, parts), options)
    return obj


def state(obj):
    """What an artist has on an object."""
    mesh = obj.data
    names = [material.name if material else None for material in mesh.materials]
    return {
        "materials": [names[polygon.material_index] if names else None for polygon in mesh.polygons],
        "seams": seams_of(mesh).tolist(),
        "face sets": renumbered(numbers(mesh, FACE_SETS)),
        "attributes": sorted(
            attribute.name
            for attribute in mesh.attributes
            if not attribute.name.startswith((".select", ".uv_select")) and attribute.name != "sharp_face"
        ),
        "groups": sorted(obj.vertex_groups.keys()),
        "properties": sorted(mesh.keys()),
    }


def renumbered(sets):
    """For each object of 80 faces, its sets with numbers in the order of their first face: a join changes numbers."""
    objects = [sets[i : i + 80].tolist() for i in range(0, len(sets), 80)]
    return [[list(dict.fromkeys(each)).index(number) for number in each] for each in objects]


def joined(*objects):
    for obj in objects:
        obj.data.update()
    select(*objects)
    bpy.ops.object.join()
    return objects[0]


SKIN, METAL = ("Skin", "Cloth"), ("Metal", "Glass")
NO_COLORS = OutputOptions(colors=False, materials=True)
JOINS = {
    "labeled, labeled": ((SKIN, 3, ALL), (METAL, 5, ALL)),
    "labeled, plain": ((SKIN, 3, ALL), (METAL, 0, ALL)),
    "plain, labeled": ((SKIN, 0, ALL), (METAL, 5, ALL)),
    "other outputs": ((SKIN, 3, NO_COLORS), (METAL, 5, ALL)),
    "no materials, materials": ((SKIN, 3, OutputOptions()), (METAL, 5, ALL)),
    "without own materials": (((), 3, ALL), (METAL, 5, ALL)),
    "into own materials": ((SKIN, 3, ALL), ((), 5, ALL)),
    "three": ((SKIN, 3, ALL), (METAL, 5, ALL), (("Fur",), 0, ALL)),
}


@pytest.mark.parametrize("join", JOINS)
@pytest.mark.parametrize("reopened", [False, True])
def test_clear_after_a_join(tmp_path, join, reopened):
    """As if the objects had been joined without segments."""
    made = [character(f"Plain {i}", m) for i, (m, _, _) in enumerate(JOINS[join])]
    expected = state(joined(*made))
    # Blender gives faces without a material another object's; in 4.2 in both of these.
    if join == "into own materials":
        expected["materials"][80:] = [None] * 80
    if join == "without own materials":
        expected["materials"][:80] = [None] * 80
    del made
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    joined(*(character(f"Plain {i}", m, parts, options) for i, (m, parts, options) in enumerate(JOINS[join])))
    if reopened:
        path = str(tmp_path / "joined.blend")
        bpy.ops.wm.save_as_mainfile(filepath=path)
        bpy.ops.wm.open_mainfile(filepath=path)
    obj = bpy.data.objects["Plain 0"]
    select(obj)
    assert OPS.clear() == {"FINISHED"}
    found = state(obj)
    for key, value in expected.items():
        assert found[key] == value, key
    assert not [name for name in bpy.data.materials.keys() if name.startswith("Segment")]  # noqa: SIM118


def in_face_sets(name, had_sets, parts, options):
    obj = limbed(name, subdivisions=2)
    if had_sets:
        # Blender 4.2 joins more than five into others of the same object.
        size = 10 if bpy.app.version >= (5, 0, 0) else 20
        sets = 1 + np.arange(len(obj.data.polygons), dtype=np.int32) // size
        obj.data.attributes.new(FACE_SETS, "INT", "FACE").data.foreach_set("value", sets)
    if parts:
        write_labels(obj.data, stripes(obj.data, parts), options)
    return obj


def borders_of_sets(obj):
    """Which faces are in the same set; none are if there are no sets."""
    if FACE_SETS not in obj.data.attributes:
        return None
    sets = numbers(obj.data, FACE_SETS)
    return np.equal.outer(sets, sets)


STATES = [
    (had_sets, parts, OutputOptions(face_sets=writes))
    for had_sets in (False, True)
    for parts, writes in ((0, False), (3, False), (5, True))
]


@pytest.mark.parametrize("second", STATES, ids=lambda state: f"sets {state[0]}, {state[1]} parts")
@pytest.mark.parametrize("first", STATES, ids=lambda state: f"sets {state[0]}, {state[1]} parts")
def test_face_sets_after_a_join(first, second):
    """As if the objects had been joined without segments."""
    expected = borders_of_sets(
        joined(*(in_face_sets(str(i), had, 0, None) for i, (had, _, _) in enumerate((first, second))))
    )
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    obj = joined(*(in_face_sets(str(i), *each) for i, each in enumerate((first, second))))
    if first[1] or second[1]:
        select(obj)
        OPS.clear()
    np.testing.assert_array_equal(borders_of_sets(obj), expected)


@pytest.mark.parametrize("steps", ["clear", "reopen, clear", "write, clear", "write, reopen, clear"])
@pytest.mark.parametrize("active", [0, 3])
def test_id_maps_of_joined_objects(settings, tmp_path, active, steps):
    settings.bake_size, settings.bake_unwrap = 64, True
    first, second, other = (character(name, SKIN, parts) for name, parts in (("A", active), ("B", 5), ("C", 4)))
    for obj in (first, second, other):
        select(obj)
        if obj != first or active:
            OPS.bake()
    joined(first, second)
    for step in steps.split(", "):
        if step == "reopen":
            bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "joined.blend"))
            bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "joined.blend"))
        select(bpy.data.objects["A"])
        if step == "write":
            write_labels(bpy.context.object.data, stripes(bpy.context.object.data), OutputOptions())
            assert "B ID Map" in bpy.data.images
        if step == "clear":
            OPS.clear()
    assert [image.name for image in bpy.data.images] == ["C ID Map"]


def test_joined_labels_are_written_again(settings):
    """Apply and the like begin with what is there."""
    obj = joined(character("A", SKIN, 3), character("B", METAL, 5))
    write_labels(obj.data, stripes(obj.data), OutputOptions(materials=True))
    select(obj)
    OPS.clear()
    assert [material.name for material in obj.data.materials] == [*SKIN, *METAL]
    half = len(obj.data.polygons) // 2
    assert state(obj)["materials"] == [SKIN[i % 2] for i in range(half)] + [METAL[i % 2] for i in range(half)]
    assert sorted(obj.vertex_groups.keys()) == ["Of A", "Of B"]


@pytest.mark.parametrize("active", [0, 5])
def test_joined_labels_are_listed_and_edited(settings, active):
    """Also where the object that the others were joined with had none."""
    obj = joined(character("A", SKIN, active), character("B", METAL, 5))
    select(obj)
    OPS.refresh_segments()
    assert [item.number for item in settings.segments] == [0, 1, 2, 3, 4]
    assert OPS.merge_segments(into=1) == {"FINISHED"}
    assert [item.number for item in settings.segments] == [1, 2, 3, 4]
    slots = [material.name for material in obj.data.materials if material.name.startswith("Segment")]
    assert slots == ["Segment 2", "Segment 3", "Segment 4", "Segment 5"]
    OPS.clear()
    assert [material.name for material in obj.data.materials] == [*SKIN, *METAL]
    assert sorted(obj.vertex_groups.keys()) == ["Of A", "Of B"]


def test_clear_after_a_join_of_labels_of_two_models(settings):
    """Groups have the names of their own label set, and faces by hand of a third one have an attribute."""
    objects = [character("A", SKIN), character("B", METAL)]
    before = [state(obj)["attributes"] for obj in objects]
    for obj, labels, name in zip(objects, ("first/3", "second/5"), ("Head", "Tail"), strict=True):
        settings.keep_notes(SetNotes(names={0: name}), labels)
        write_labels(obj.data, stripes(obj.data, 3), replace(ALL, style=style_of(labels)))
        enter_origin(obj.data, Origin(labels))
    keep_by_hand_of(objects[1].data, "second/4", stripes(objects[1].data))
    obj = joined(*objects)
    assert {"WKS Head", "WKS Tail"} <= set(obj.vertex_groups.keys())
    OPS.clear()
    assert sorted(obj.vertex_groups.keys()) == ["Of A", "Of B"]
    assert state(obj)["attributes"] == before[0]


def test_a_renamed_material_of_a_joined_object_is_given_back(settings):
    first, second = character("A", SKIN, 3), character("B", METAL, 5)
    bpy.data.materials["Metal"].name = "Steel"
    obj = joined(first, second)
    select(obj)
    OPS.clear()
    assert set(state(obj)["materials"]) == {"Skin", "Cloth", "Steel", "Glass"}


@pytest.mark.parametrize("how", ["MATERIAL", "LOOSE", "SELECTED"])
def test_clear_after_a_split(settings, how):
    whole = character("A", SKIN, 4)
    select(whole)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    if how == "SELECTED":
        bpy.ops.object.mode_set(mode="OBJECT")
        whole.data.polygons.foreach_set("select", np.arange(len(whole.data.polygons)) < 100)
        bpy.ops.object.mode_set(mode="EDIT")
    elif how == "LOOSE":
        bpy.ops.mesh.edge_split(type="EDGE")
    bpy.ops.mesh.separate(type=how)
    bpy.ops.object.mode_set(mode="OBJECT")
    parts = [obj for obj in bpy.data.objects if obj.type == "MESH"]
    assert len(parts) > 1
    select(*parts)
    OPS.clear()
    for obj in parts:
        found = state(obj)
        assert set(found["materials"]) <= set(SKIN)
        assert not [name for name in found["attributes"] if "wks_segment" in name]
        assert found["groups"] == ["Of A"]
        assert not found["properties"]
    shown = [name for obj in parts for name in state(obj)["materials"]]
    assert sorted(shown) == sorted(SKIN[i % 2] for i in range(len(shown)))


@pytest.mark.parametrize("linked", [False, True])
def test_clear_after_a_duplicate(settings, linked):
    obj = character("A", SKIN, 4)
    select(obj)
    bpy.ops.object.duplicate(linked=linked)
    copy = bpy.context.active_object
    expected = state(character("Plain", ()))["attributes"]
    select(obj, copy)
    OPS.clear()
    for each in (obj, copy):
        assert state(each)["attributes"] == expected
        assert state(each)["materials"] == [SKIN[i % 2] for i in range(len(each.data.polygons))]
    assert not [name for name in bpy.data.materials.keys() if name.startswith("Segment")]  # noqa: SIM118


def test_clear_after_an_append(settings, tmp_path):
    """Names get numbers, because they are taken."""
    character("A", SKIN, 4)
    path = str(tmp_path / "library.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path, copy=True)
    with bpy.data.libraries.load(path) as (there, here):
        here.objects = there.objects
    appended = here.objects[0]
    bpy.context.scene.collection.objects.link(appended)
    names = {material.name for material in appended.data.materials}
    assert "Segment 1.001" in names
    select(appended)
    OPS.clear()
    assert {material.name for material in appended.data.materials} == {"Skin.001", "Cloth.001"}
    assert [name for name in bpy.data.materials.keys() if name.startswith("Segment")] == [  # noqa: SIM118
        f"Segment {i}" for i in (1, 2, 3, 4)
    ]
