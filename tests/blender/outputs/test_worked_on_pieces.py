"""Separated objects that an artist has worked on, in whatever way, stay with Clear; others go."""

import bpy
import numpy as np
import pytest
from builders import limbed, select
from mathutils import Matrix
from painted_objects import painted, stripes

from wks_segment.blender.outputs.labels import write_labels
from wks_segment.blender.outputs.options import OutputOptions

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment
KEPT = 'You have changed these separated objects, they stay: "{}"'


@pytest.fixture
def pieces(settings):
    """The objects that a character with materials, shape keys, a modifier and an action was separated into."""
    obj = painted(limbed(subdivisions=3))
    obj.shape_key_add(name="Basis")
    obj.shape_key_add(name="Bulge").value = 0.2
    obj.data.shape_keys.key_blocks["Bulge"].keyframe_insert("value", frame=1)
    obj.data.shape_keys.key_blocks["Bulge"].value = 0.4
    obj.data.shape_keys.key_blocks["Bulge"].keyframe_insert("value", frame=11)
    obj.shape_key_add(name="Thin")
    obj.modifiers.new("Sub", "SUBSURF").levels = 0
    obj["export"], obj["is_body"] = "body", True
    obj.modifiers.new("Hair", "PARTICLE_SYSTEM").particle_system.settings.type = "HAIR"
    obj.modifiers.new("Nodes", "NODES").node_group = node_group()
    write_labels(obj.data, stripes(obj.data), OutputOptions(materials=True, vertex_groups="hard", seams=True))
    select(obj)
    OPS.separate()
    return [other for other in bpy.data.objects if other is not obj]


def node_group():
    """A group of Geometry Nodes that changes nothing, with an input."""
    group = bpy.data.node_groups.new("Nothing", "GeometryNodeTree")
    for name, kind, way in (
        ("Geometry", "Geometry", "INPUT"),
        ("Size", "Float", "INPUT"),
        ("Out", "Geometry", "OUTPUT"),
    ):
        group.interface.new_socket(name, in_out=way, socket_type=f"NodeSocket{kind}")
    group.links.new(group.nodes.new("NodeGroupInput").outputs[0], group.nodes.new("NodeGroupOutput").inputs[0])
    return group


def node_input(piece):
    modifier = piece.modifiers["Nodes"]
    name = next(name for name in modifier.keys() if isinstance(modifier[name], float))  # noqa: SIM118
    modifier[name] = 0.5


def attribute(name, domain, elements, kind="FLOAT"):
    def add(piece):
        mesh = piece.data
        values = np.ones(len(getattr(mesh, elements)), np.float32 if kind == "FLOAT" else np.int32)
        made = mesh.attributes.get(name) or mesh.attributes.new(name, kind, domain)
        made.data.foreach_set("value", values)

    return add


def linked_to(make):
    """Adds an object of the artist that has something to do with a piece."""

    def add(piece):
        other = bpy.data.objects.new("Mine", None)
        bpy.context.scene.collection.objects.link(other)
        make(other, piece)

    return add


def in_another_collection(piece):
    collection = bpy.data.collections.new("Mine")
    bpy.context.scene.collection.children.link(collection)
    collection.objects.link(piece)


def share_mesh(piece):
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Shares", piece.data))


def driver(piece):
    piece.data.shape_keys.key_blocks["Thin"].driver_add("value").driver.expression = "0.5"


def combed(piece):
    select(piece)
    bpy.ops.particle.particle_edit_toggle()
    bpy.ops.object.mode_set(mode="OBJECT")


def in_a_property_of_the_scene(piece):
    bpy.context.scene["target"] = piece


WORK = {
    "vertex": lambda piece: setattr(piece.data.shape_keys.key_blocks[0].data[0], "co", (9, 9, 9)),
    "modifier setting": lambda piece: setattr(piece.modifiers["Sub"], "render_levels", 3),
    "input of nodes": node_input,
    "particles": lambda piece: setattr(piece.particle_systems[0], "seed", 7),
    "new modifier": lambda piece: piece.modifiers.new("Bend", "SIMPLE_DEFORM"),
    "seam": lambda piece: setattr(piece.data.edges[0], "use_seam", not piece.data.edges[0].use_seam),
    "sharp edge": lambda piece: setattr(piece.data.edges[0], "use_edge_sharp", True),
    "smooth face": lambda piece: setattr(piece.data.polygons[0], "use_smooth", not piece.data.polygons[0].use_smooth),
    "material of a face": lambda piece: setattr(piece.data.polygons[0], "material_index", 0),
    "material of a slot": lambda piece: setattr(piece.material_slots[0], "material", bpy.data.materials["Cloth"]),
    "slot of the object": lambda piece: setattr(piece.material_slots[0], "link", "OBJECT"),
    "mask": attribute(".sculpt_mask", "POINT", "vertices"),
    "crease": attribute("crease_edge", "EDGE", "edges"),
    "own attribute": attribute("painted", "POINT", "vertices"),
    "face set": attribute(".sculpt_face_set", "FACE", "polygons", "INT"),
    "custom normals": lambda piece: piece.data.normals_split_custom_set([(0, 0, 1)] * len(piece.data.loops)),
    "UV": lambda piece: setattr(piece.data.uv_layers["First"].uv[0], "vector", (5, 5)),
    "color": lambda piece: setattr(piece.data.color_attributes[0].data[0], "color", (0, 0, 0, 1)),
    "group renamed": lambda piece: setattr(piece.vertex_groups[0], "name", "Hand"),
    "weight": lambda piece: piece.vertex_groups[0].add([0], 0.123, "REPLACE"),
    "shape key value": lambda piece: setattr(piece.data.shape_keys.key_blocks["Thin"], "value", 0.7),
    "shape key range": lambda piece: setattr(piece.data.shape_keys.key_blocks["Bulge"], "slider_max", 2.0),
    "driver": driver,
    "custom property": lambda piece: piece.__setitem__("export", "hand"),
    "custom property of the mesh": lambda piece: piece.data.__setitem__("detail", 2),
    "constraint": lambda piece: piece.constraints.new("COPY_LOCATION"),
    "name": lambda piece: setattr(piece, "name", "Hand"),
    "name of the mesh": lambda piece: setattr(piece.data, "name", "Hand"),
    "place": lambda piece: setattr(piece, "location", (1, 2, 3)),
    "parent": lambda piece: setattr(piece, "parent", None),
    "display": lambda piece: setattr(piece, "show_wire", True),
    "ray visibility": lambda piece: setattr(piece, "visible_shadow", False),
    "keyframe": lambda piece: piece.keyframe_insert("location", frame=3),
    "collection": in_another_collection,
    "child": linked_to(lambda other, piece: setattr(other, "parent", piece)),
    "target": linked_to(
        lambda other, piece: setattr(other.constraints.new("COPY_LOCATION"), "target", piece)
    ),
    "mesh used elsewhere": share_mesh,
    "hidden face": lambda piece: setattr(piece.data.polygons[0], "hide", True),
    "hair": combed,
    "color that is rendered": lambda piece: setattr(piece.data.attributes, "default_color_name", "None"),
    "order of modifiers": lambda piece: piece.modifiers.move(0, 1),
    "asset": lambda piece: piece.asset_mark(),
    "property of the scene": in_a_property_of_the_scene,
}  # fmt: skip


@pytest.mark.parametrize("work", WORK)
def test_a_piece_that_was_worked_on_stays(pieces, printed, work):
    piece = pieces[1]
    WORK[work](piece)
    name, mesh = piece.name, piece.data
    select(*pieces)
    printed()
    OPS.clear()
    assert name in bpy.data.objects
    assert bpy.data.objects[name].data == mesh
    assert KEPT.format(name) in printed().out
    kept = {name, "Limbed", "Mine", "Shares"}
    assert set(bpy.data.objects.keys()) <= kept, "pieces without work are removed"


def reloaded(tmp_path):
    path = str(tmp_path / "pieces.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)


def through_edit_mode(tmp_path):
    piece = bpy.data.objects["Segment 2"]
    select(piece)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.object.mode_set(mode="OBJECT")


def clicked_at(tmp_path):
    piece = bpy.data.objects["Segment 2"]
    piece.active_material_index = piece.vertex_groups.active_index = piece.active_shape_key_index = 1
    piece.data.uv_layers.active_index = 0
    piece.modifiers["Sub"].show_expanded = False
    select(piece)


def undone(tmp_path):
    bpy.ops.ed.undo_push(message="before")
    bpy.data.objects["Segment 2"].location.x += 1
    bpy.ops.ed.undo_push(message="moved")
    bpy.ops.ed.undo()


def styled(tmp_path):
    bpy.ops.wks_segment.refresh_segments()
    settings = bpy.context.scene.wks_segment
    settings.segments[1].name = "Belly"
    settings.segments[2].color = (0.1, 0.9, 0.3)


NO_WORK = {
    "nothing": lambda tmp_path: None,
    "another frame": lambda tmp_path: bpy.context.scene.frame_set(7),
    "saved and opened": reloaded,
    "through Edit Mode": through_edit_mode,
    "clicked at": clicked_at,
    "undone": undone,
    "another style": styled,
}


@pytest.mark.parametrize("what", NO_WORK)
def test_pieces_without_work_are_removed(pieces, tmp_path, printed, what):
    NO_WORK[what](tmp_path)
    select(bpy.data.objects["Segment 1"])
    printed()
    OPS.clear()
    assert "they stay" not in printed().out
    assert bpy.data.objects.keys() == ["Limbed"]
    assert bpy.data.meshes.keys() == ["Limbed"]
    assert sorted(bpy.data.materials.keys()) == ["Cloth", "Skin"]


def rename_original():
    bpy.data.objects["Limbed"].name = "Hero"
    bpy.data.meshes["Limbed"].name = "Body"


def rename_what_is_used():
    for block in (*bpy.data.collections, *bpy.data.actions, *bpy.data.node_groups, *bpy.data.particles):
        block.name = f"My {block.name}"
    bpy.data.materials["Skin"].name = "Leather"
    bpy.context.scene.name = "Take 1"


@pytest.mark.parametrize(
    ("rename", "is_reloaded"), [(rename_original, False), (rename_original, True), (rename_what_is_used, False)]
)
def test_pieces_are_removed_when_something_else_was_renamed(pieces, tmp_path, printed, rename, is_reloaded):
    rename()
    if is_reloaded:
        reloaded(tmp_path)
    select(bpy.data.objects["Segment 1"])
    printed()
    OPS.clear()
    assert "they stay" not in printed().out
    assert len(bpy.data.objects) == len(bpy.data.meshes) == 1
    assert len(bpy.data.materials) == 2


def test_a_copy_of_a_piece_stays(pieces):
    copies = []
    for linked in (True, False):
        copy = pieces[1].copy()
        if not linked:
            copy.data = pieces[1].data.copy()
        copy.name = f"Copy {linked}"
        bpy.context.scene.collection.objects.link(copy)
        copies.append(copy.name)
    select(*pieces)
    OPS.clear()
    assert set(copies) < set(bpy.data.objects.keys())
    assert len(bpy.data.objects["Copy True"].data.polygons)


@pytest.fixture
def sculpted_pieces(settings):
    """Pieces of a character with a Multires modifier."""
    obj = limbed(subdivisions=2)
    obj.shape_key_add(name="Basis")
    obj.modifiers.new("Multires", "MULTIRES")
    select(obj)
    bpy.ops.object.multires_subdivide(modifier="Multires")
    write_labels(obj.data, stripes(obj.data), OutputOptions())
    OPS.separate()
    return [other for other in bpy.data.objects if other is not obj]


def sculpt(piece):
    """Give the upper level of a Multires modifier another shape."""
    evaluated = piece.evaluated_get(bpy.context.evaluated_depsgraph_get())
    shape = bpy.data.objects.new("Shape", bpy.data.meshes.new_from_object(evaluated))
    shape.data.transform(Matrix.Scale(1.3, 4))
    bpy.context.scene.collection.objects.link(shape)
    select(piece, shape)
    assert bpy.ops.object.multires_reshape(modifier="Multires") == {"FINISHED"}
    bpy.data.meshes.remove(shape.data)


def test_a_piece_whose_multires_detail_was_sculpted_stays(sculpted_pieces, printed):
    """No property of Blender has this detail."""
    sculpt(sculpted_pieces[1])
    select(*sculpted_pieces)
    printed()
    OPS.clear()
    assert KEPT.format("Segment 2") in printed().out
    assert sorted(bpy.data.objects.keys()) == ["Limbed", "Segment 2"]
    assert len(bpy.data.scenes) == 1
    assert len(bpy.data.meshes) == 2
