"""Writing labels keeps what the artist has on the mesh, and Clear restores exactly what was there."""

import bpy
import numpy as np
import pytest
from builders import changes, coordinates, limbed, mesh_object, numbers, read_labels, snapshot

from wks_segment.blender.outputs.labels import clear_labels, write_labels
from wks_segment.blender.outputs.options import OutputOptions
from wks_segment.blender.parts.palette import palette

pytestmark = pytest.mark.usefixtures("scene")


@pytest.fixture
def mesh():
    """A mesh without anything of an artist."""
    return limbed().data


@pytest.fixture
def painted(mesh):
    """A mesh with materials, colors, attributes and properties of an artist."""
    for name in ("Skin", "Cloth"):
        mesh.materials.append(bpy.data.materials.new(name))
    mesh.materials.append(None)
    mesh.polygons.foreach_set("material_index", np.arange(len(mesh.polygons), dtype=np.int32) % 3)
    tint = mesh.color_attributes.new("Tint", "FLOAT_COLOR", "POINT")
    dirt = mesh.color_attributes.new("Dirt", "BYTE_COLOR", "CORNER")
    tint.data.foreach_set("color", np.linspace(0, 1, 4 * len(mesh.vertices), dtype=np.float32))
    dirt.data.foreach_set("color", np.linspace(1, 0, 4 * len(mesh.loops), dtype=np.float32))
    mesh.color_attributes.active_color = mesh.color_attributes["Tint"]
    mesh.color_attributes.render_color_index = mesh.color_attributes.find("Dirt")
    mesh.attributes.new("stiffness", "FLOAT", "POINT")
    mesh.uv_layers.new(name="UVMap")
    mesh["made by"] = "an artist"
    return mesh


def stripes(mesh, count=5):
    """Labels by height."""
    height = coordinates(mesh)[np.array([polygon.vertices[0] for polygon in mesh.polygons]), 2]
    return np.digitize(height, np.linspace(height.min(), height.max(), count + 1)[1:-1])


# What is written


def test_faces_get_an_int_attribute(mesh):
    labels = stripes(mesh)
    write_labels(mesh, labels)
    attribute = mesh.attributes["wks_segment"]
    assert (attribute.data_type, attribute.domain) == ("INT", "FACE")
    np.testing.assert_array_equal(numbers(mesh, "wks_segment"), labels)
    np.testing.assert_array_equal(read_labels(mesh), labels)


def test_vertices_get_the_label_of_most_faces_around_them(mesh):
    labels = stripes(mesh)
    write_labels(mesh, labels)
    attribute = mesh.attributes["wks_segment_vertex"]
    assert (attribute.data_type, attribute.domain) == ("INT", "POINT")
    around = [[] for _ in mesh.vertices]
    for polygon, label in zip(mesh.polygons, labels, strict=True):
        for vertex in polygon.vertices:
            around[vertex].append(label)
    for label, labels_here in zip(numbers(mesh, "wks_segment_vertex"), around, strict=True):
        assert labels_here.count(label) == max(map(labels_here.count, labels_here))


def test_vertex_without_a_face_gets_a_label():
    mesh = mesh_object([(0, 0, 0), (1, 0, 0), (0, 1, 0), (5, 5, 5)], [(0, 1, 2)]).data
    write_labels(mesh, np.array([3]))
    assert numbers(mesh, "wks_segment_vertex").tolist() == [3, 3, 3, 0]


def test_each_face_has_one_flat_color_of_the_palette(mesh):
    labels = stripes(mesh)
    write_labels(mesh, labels)
    colors = mesh.color_attributes["wks_segment_color"]
    assert colors.domain == "CORNER"
    corners = numbers(mesh, "wks_segment_color", "color_srgb", 4)
    expected = palette()[np.repeat(labels, 3)]
    np.testing.assert_allclose(corners[:, :3], expected, atol=1 / 255)
    np.testing.assert_array_equal(corners[:, 3], 1)


def test_colors_are_shown_and_the_rendered_ones_stay(painted):
    rendered = painted.color_attributes[painted.color_attributes.render_color_index].name
    write_labels(painted, stripes(painted))
    assert painted.color_attributes.active_color.name == "wks_segment_color"
    assert painted.color_attributes[painted.color_attributes.render_color_index].name == rendered


def test_without_colors_the_active_color_stays(painted):
    write_labels(painted, stripes(painted), OutputOptions(colors=False))
    assert "wks_segment_color" not in painted.attributes
    assert painted.color_attributes.active_color.name == "Tint"


def test_our_materials_come_after_the_artists(painted):
    labels = stripes(painted)
    write_labels(painted, labels, OutputOptions(materials=True))
    assert [m and m.name for m in painted.materials[:3]] == ["Skin", "Cloth", None]
    assert len(painted.materials) == 3 + 5
    for polygon, label in zip(painted.polygons, labels, strict=True):
        material = painted.materials[polygon.material_index]
        assert material.name == f"Segment {label + 1}"
    for label in range(5):
        linear = bpy.data.materials[f"Segment {label + 1}"].diffuse_color[:3]
        srgb = [12.92 * c if c < 0.0031308 else 1.055 * c ** (1 / 2.4) - 0.055 for c in linear]
        assert srgb == pytest.approx(palette()[label], abs=1e-3)


def test_only_parts_that_occur_get_a_material(mesh):
    write_labels(mesh, np.where(np.arange(len(mesh.polygons)) < 5, 2, 7), OutputOptions(materials=True))
    assert [material.name for material in mesh.materials] == ["Segment 3", "Segment 8"]


def test_meshes_share_the_material_of_a_part(mesh):
    other = limbed("Other").data
    write_labels(mesh, stripes(mesh), OutputOptions(materials=True))
    write_labels(other, stripes(other), OutputOptions(materials=True))
    assert list(mesh.materials) == list(other.materials)
    clear_labels(mesh)
    assert len(other.materials) == 5
    assert [material.name for material in bpy.data.materials] == [f"Segment {i}" for i in range(1, 6)]
    clear_labels(other)
    assert not len(bpy.data.materials)


# What is kept


def kept(before, after):
    """Whether everything of the artist on a mesh is still there, next to what is new."""
    for name, attribute in before["attributes"].items():
        if name != "material_index":
            assert after["attributes"][name] == attribute, name
    assert after["slots"][: len(before["slots"])] == before["slots"]
    assert before["properties"].items() <= after["properties"].items()


@pytest.mark.parametrize("materials", [False, True])
def test_data_of_the_artist_are_kept(painted, materials):
    before = snapshot(painted)
    write_labels(painted, stripes(painted), OutputOptions(materials=materials))
    kept(before, snapshot(painted))
    if not materials:
        assert snapshot(painted)["material index"] == before["material index"]


@pytest.mark.parametrize(
    ("name", "kind", "domain"),
    [
        ("wks_segment", "FLOAT", "FACE"),
        ("wks_segment", "INT", "FACE"),
        ("wks_segment_vertex", "INT", "POINT"),
        ("wks_segment_color", "BYTE_COLOR", "CORNER"),
        ("wks_segment_own_material", "INT", "FACE"),
    ],
)
def test_attribute_of_the_artist_with_our_name_survives(mesh, name, kind, domain):
    mesh.attributes.new(name, kind, domain)
    before = snapshot(mesh)
    labels = stripes(mesh)
    write_labels(mesh, labels, OutputOptions(materials=True))
    kept(before, snapshot(mesh))
    np.testing.assert_array_equal(read_labels(mesh), labels)
    write_labels(mesh, labels, OutputOptions(materials=True))
    kept(before, snapshot(mesh))
    clear_labels(mesh)
    assert not changes(before, snapshot(mesh))


def test_vertex_groups_of_the_artist_with_our_names_survive(mesh):
    obj = bpy.data.objects["Limbed"]
    names = ["wks_segment", "wks_segment_vertex", "wks_segment_color", "wks_segment_own_material"]
    for name in names:
        obj.vertex_groups.new(name=name).add([1, 2], 0.5, "REPLACE")
    before, labels = snapshot(mesh), stripes(mesh)
    for _ in range(2):
        write_labels(mesh, labels, OutputOptions(materials=True))
        np.testing.assert_array_equal(read_labels(mesh), labels)
        assert obj.vertex_groups.keys() == names
        assert {f"{name}.001" for name in names} < set(mesh.attributes.keys())
    clear_labels(mesh)
    assert not changes(before, snapshot(mesh))


def test_property_of_the_artist_with_our_name_survives(mesh):
    mesh["wks_segment"] = 3.5
    labels = stripes(mesh)
    write_labels(mesh, labels)
    np.testing.assert_array_equal(numbers(mesh, "wks_segment"), labels)
    clear_labels(mesh)
    assert mesh["wks_segment"] == 3.5


# Again


def test_second_write_replaces_the_first(painted):
    write_labels(painted, stripes(painted, 7), OutputOptions(materials=True))
    write_labels(painted, stripes(painted, 3), OutputOptions(materials=True))
    twice = snapshot(painted)
    clear_labels(painted)
    write_labels(painted, stripes(painted, 3), OutputOptions(materials=True))
    assert not changes(twice, snapshot(painted))
    assert len(painted.materials) == 3 + 3
    assert not [name for name in twice["attributes"] if name.endswith(".001")]


def test_writing_without_colors_and_materials_removes_earlier_ones(painted):
    before = snapshot(painted)
    write_labels(painted, stripes(painted), OutputOptions(materials=True))
    write_labels(painted, stripes(painted), OutputOptions(colors=False))
    after = snapshot(painted)
    assert set(after["attributes"]) - set(before["attributes"]) == {
        "wks_segment",
        "wks_segment_vertex",
        ".wks_segment_written",
    }
    assert after["slots"] == before["slots"]
    assert after["material index"] == before["material index"]


# Clear


@pytest.mark.parametrize("colors", [False, True])
@pytest.mark.parametrize("materials", [False, True])
@pytest.mark.parametrize("who", ["mesh", "painted"])
def test_clear_restores_exactly_what_was_there(request, who, colors, materials):
    mesh = request.getfixturevalue(who)
    before, materials_before = snapshot(mesh), bpy.data.materials[:]
    write_labels(mesh, stripes(mesh), OutputOptions(colors=colors, materials=materials))
    assert changes(before, snapshot(mesh))
    assert clear_labels(mesh)
    assert not changes(before, snapshot(mesh))
    assert bpy.data.materials[:] == materials_before


def test_clear_after_several_writes_restores_exactly_what_was_there(painted):
    before = snapshot(painted)
    for count, materials in ((5, True), (3, False), (4, True)):
        write_labels(painted, stripes(painted, count), OutputOptions(materials=materials))
    clear_labels(painted)
    assert not changes(before, snapshot(painted))


def test_clear_without_labels_does_nothing(painted):
    before = snapshot(painted)
    assert not clear_labels(painted)
    assert not changes(before, snapshot(painted))
    assert read_labels(painted) is None


def test_clear_leaves_what_the_artist_added_since(painted):
    write_labels(painted, stripes(painted), OutputOptions(materials=True))
    painted.materials.append(bpy.data.materials.new("Fur"))
    painted.attributes.new("late", "FLOAT", "FACE")
    clear_labels(painted)
    assert [m and m.name for m in painted.materials] == ["Skin", "Cloth", None, "Fur"]
    assert "late" in painted.attributes


def test_clear_works_after_the_artist_removed_some_outputs(painted):
    write_labels(painted, stripes(painted), OutputOptions(materials=True))
    for name in ("wks_segment", "wks_segment_color"):
        painted.attributes.remove(painted.attributes[name])
    assert read_labels(painted) is None
    assert clear_labels(painted)
    assert not [name for name in painted.attributes.keys() if name.startswith("wks_segment")]  # noqa: SIM118
    assert painted.color_attributes.active_color.name == "Tint"


def test_clearing_a_copy_of_a_labeled_mesh_leaves_the_original(painted):
    before = snapshot(painted)
    write_labels(painted, stripes(painted), OutputOptions(materials=True))
    labeled, copy = snapshot(painted), painted.copy()
    clear_labels(copy)
    assert not changes(before, snapshot(copy))
    assert not changes(labeled, snapshot(painted))


def test_materials_linked_to_the_object_stay_there(mesh):
    obj = bpy.data.objects["Limbed"]
    mesh.materials.append(bpy.data.materials.new("On the mesh"))
    obj.material_slots[0].link = "OBJECT"
    obj.material_slots[0].material = bpy.data.materials.new("On the object")
    write_labels(mesh, stripes(mesh), OutputOptions(materials=True))
    assert len(obj.material_slots) == 6
    clear_labels(mesh)
    assert [(slot.link, slot.material.name) for slot in obj.material_slots] == [("OBJECT", "On the object")]
    assert [material.name for material in mesh.materials] == ["On the mesh"]


def test_other_objects_of_the_mesh_show_the_labels(mesh):
    twin = bpy.data.objects.new("Twin", mesh)
    bpy.context.scene.collection.objects.link(twin)
    labels = stripes(mesh)
    write_labels(mesh, labels)
    np.testing.assert_array_equal(read_labels(twin.data), labels)
    clear_labels(twin.data)
    assert read_labels(mesh) is None
