"""Face sets, seams, materials from a template, UV maps, pieces: written, taken back, undone; the artist's own kept."""

import bpy
import numpy as np
import pytest
from builders import (
    changes,
    coordinates,
    labels_of,
    limbed,
    limbed_keys,
    limbed_rigged,
    mesh_object,
    numbers,
    scene_snapshot,
    select,
)

from wks_segment.blender.outputs.labels import clear_labels, write_labels
from wks_segment.blender.outputs.materials import PART_PROPERTY
from wks_segment.blender.outputs.options import OutputOptions
from wks_segment.blender.outputs.part_attributes import labels_on
from wks_segment.blender.parts.part_style import Style
from wks_segment.blender.scene.topology import border_edges

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment
FACE_SETS = ".sculpt_face_set"


def stripes(mesh, count=4):
    """Labels by height."""
    height = np.array([polygon.center.z for polygon in mesh.polygons])
    return np.digitize(height, np.linspace(height.min(), height.max(), count + 1)[1:-1])


def seams_of(mesh):
    return np.array([edge.use_seam for edge in mesh.edges])


def painted(obj):
    """An object with materials, seams, face sets, a UV map, vertex groups and a selection of an artist."""
    mesh = obj.data
    for name in ("Skin", "Cloth"):
        mesh.materials.append(bpy.data.materials.new(name))
    mesh.polygons.foreach_set("material_index", np.arange(len(mesh.polygons), dtype=np.int32) % 2)
    mesh.edges.foreach_set("use_seam", np.arange(len(mesh.edges)) % 7 == 0)
    mesh.attributes.new(FACE_SETS, "INT", "FACE").data.foreach_set("value", 1 + np.arange(len(mesh.polygons)) // 100)
    uvs = np.linspace(0, 1, 2 * len(mesh.loops), dtype=np.float32)
    mesh.uv_layers.new(name="First").data.foreach_set("uv", uvs)
    mesh.uv_layers.new(name="Second").data.foreach_set("uv", uvs[::-1].copy())
    mesh.uv_layers.active = mesh.uv_layers["Second"]
    obj.vertex_groups.new(name="Mine").add([1, 2, 3], 0.5, "REPLACE")
    mesh.polygons.foreach_set("select", np.arange(len(mesh.polygons)) % 3 == 0)
    mesh.update()
    return obj


@pytest.fixture(params=["plain", "painted"])
def obj(request, settings):
    made = limbed()
    if request.param == "painted":
        painted(made)
    select(made)
    return made


@pytest.fixture
def labeled(obj):
    write_labels(obj.data, stripes(obj.data))
    return obj


def undone(operator, **options):
    """What changes by an operator, and what is changed still when it is undone."""
    before = scene_snapshot()
    bpy.ops.ed.undo_push(message="before")
    assert operator(**options) == {"FINISHED"}
    after = scene_snapshot()
    bpy.ops.ed.undo_push(message="after")
    assert bpy.ops.ed.undo() == {"FINISHED"}
    return changes(before, after), changes(before, scene_snapshot())


# Every operator


@pytest.mark.parametrize(
    ("operator", "options"),
    [
        (OPS.bake, {}),
        (OPS.unwrap, {"method": "SEAMS"}),
        (OPS.unwrap, {"method": "SMART"}),
        (OPS.separate, {}),
        (OPS.segments_from, {"source": "FACE_SETS"}),
        (OPS.segments_from, {"source": "MATERIALS"}),
        (OPS.segments_from, {"source": "VERTEX_GROUPS"}),
        (OPS.clear, {}),
    ],
    ids=str,
)
@pytest.mark.parametrize("who", ["plain", "painted"])
def test_undo_gives_back_what_was(settings, who, operator, options):
    obj = limbed()
    if who == "painted":
        painted(obj)
    select(obj)
    settings.write_materials = settings.write_face_sets = settings.write_seams = settings.bake_unwrap = True
    settings.vertex_groups, settings.bake_size, settings.source = "hard", 64, "OBJECTS"
    assert OPS.learn() == {"FINISHED"}
    OPS.unwrap()
    # What is taken over is what is there: only a correction changes something.
    obj.data.attributes[FACE_SETS].data[5].value = 77
    obj.data.polygons[6].material_index = 0
    obj.vertex_groups.new(name="New").add(list(obj.data.polygons[7].vertices), 9.0, "REPLACE")
    obj.data.update()
    done, left = undone(operator, **options)
    assert done
    assert not left


def test_clear_after_everything_gives_back_what_was(obj, settings):
    before = scene_snapshot()
    settings.write_materials = settings.write_face_sets = settings.write_seams = settings.bake_unwrap = True
    settings.vertex_groups, settings.bake_size = "soft", 64
    for _ in range(2):
        for operator in (OPS.learn, OPS.unwrap, OPS.bake, OPS.separate, OPS.clear):
            assert operator() == {"FINISHED"}
        before["model"] = scene_snapshot()["model"]
        assert not changes(before, scene_snapshot())


def test_new_labels_take_back_what_is_not_asked_for_any_more(obj, settings):
    select(obj)
    OPS.learn()
    without = scene_snapshot()
    settings.write_materials = settings.write_face_sets = settings.write_seams = True
    OPS.learn()
    assert changes(without, scene_snapshot())
    settings.write_materials = settings.write_face_sets = settings.write_seams = False
    OPS.learn()
    assert not changes(without, scene_snapshot())


# Face sets


def test_each_segment_is_a_face_set(obj):
    labels = stripes(obj.data) + 1000 * (np.arange(len(obj.data.polygons)) % 3)
    write_labels(obj.data, labels, OutputOptions(face_sets=True))
    sets = numbers(obj.data, FACE_SETS)
    assert sets.min() > 0
    assert len(np.unique(sets)) == len(np.unique(np.stack([sets, labels]), axis=1).T) == len(np.unique(labels))


def test_face_sets_that_were_drawn_since_stay(obj):
    own = numbers(obj.data, FACE_SETS) if FACE_SETS in obj.data.attributes else np.ones(len(obj.data.polygons))
    write_labels(obj.data, stripes(obj.data), OutputOptions(face_sets=True))
    obj.data.attributes[FACE_SETS].data[3].value = 500
    clear_labels(obj.data)
    own[3] = 500
    np.testing.assert_array_equal(numbers(obj.data, FACE_SETS), own)


# Seams


def test_seams_are_where_the_segment_changes_and_where_they_were(obj):
    before = seams_of(obj.data)
    labels = stripes(obj.data)
    write_labels(obj.data, labels, OutputOptions(seams=True))
    around = {}
    for polygon in obj.data.polygons:
        for key in polygon.edge_keys:
            around.setdefault(key, set()).add(labels[polygon.index])
    expected = [len(around[edge.key]) > 1 for edge in obj.data.edges]
    np.testing.assert_array_equal(seams_of(obj.data), before | expected)


def test_seams_that_were_marked_since_stay(obj):
    before = seams_of(obj.data)
    write_labels(obj.data, stripes(obj.data), OutputOptions(seams=True))
    late = int(np.flatnonzero(~seams_of(obj.data))[0])
    obj.data.edges[late].use_seam = True
    clear_labels(obj.data)
    before[late] = True
    np.testing.assert_array_equal(seams_of(obj.data), before)


def test_borders_do_not_snap_to_seams_of_our_own(settings, obj):
    settings.snap_to = {"seams"}
    OPS.learn()
    first = labels_of(obj)
    settings.write_seams = True
    OPS.learn()
    OPS.learn()
    np.testing.assert_array_equal(labels_of(obj), first)


# Materials from a template


@pytest.fixture
def template():
    """A material whose Base Color comes from an RGB node, with a rough surface."""
    material = bpy.data.materials.new("Rough")
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = True
    tree = material.node_tree
    shader, rgb = tree.nodes["Principled BSDF"], tree.nodes.new("ShaderNodeRGB")
    shader.inputs["Roughness"].default_value = 0.9
    tree.links.new(rgb.outputs[0], shader.inputs["Base Color"])
    return material


def rgb_of(material):
    """The color of a material's RGB node."""
    (node,) = (node for node in material.node_tree.nodes if node.type == "RGB")
    return tuple(node.outputs[0].default_value[:3])


def test_materials_are_colored_copies_of_the_template(obj, settings, template):
    before = {"materials": sorted(material.name for material in bpy.data.materials), "rgb": rgb_of(template)}
    settings.write_materials, settings.material_template = True, template
    OPS.learn()
    ours = [material for material in obj.data.materials if PART_PROPERTY in material]
    assert len(ours) == len(np.unique(labels_of(obj)))
    for material in ours:
        assert material.node_tree.nodes["Principled BSDF"].inputs["Roughness"].default_value == pytest.approx(0.9)
        linear = np.array(rgb_of(material))
        srgb = np.where(linear < 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
        np.testing.assert_allclose(srgb, Style().colors_of(np.array(material[PART_PROPERTY])), atol=1e-3)
    assert rgb_of(template) == before["rgb"]
    OPS.clear()
    assert sorted(material.name for material in bpy.data.materials) == before["materials"]


# UV maps


def islands(mesh, uvs):
    """(corners,) number of the UV island that each corner is in."""
    parent = list(range(len(mesh.polygons)))

    def root(i):
        while parent[i] != i:
            parent[i] = parent[parent[i]]
            i = parent[i]
        return i

    seen = {}
    for polygon in mesh.polygons:
        corners = list(polygon.loop_indices)
        for a, b in zip(corners, corners[1:] + corners[:1], strict=True):
            key = frozenset((mesh.loops[i].vertex_index, *np.round(uvs[i], 5)) for i in (a, b))
            if key in seen:
                parent[root(polygon.index)] = root(seen[key])
            seen[key] = polygon.index
    return np.array([root(polygon.index) for polygon in mesh.polygons])


@pytest.mark.parametrize("method", ["SEAMS", "SMART"])
def test_segments_are_unwrapped_apart_from_each_other(labeled, method):
    before = list(labeled.data.uv_layers.keys())
    assert OPS.unwrap(method=method) == {"FINISHED"}
    mesh, labels = labeled.data, labels_of(labeled)
    assert list(mesh.uv_layers.keys()) == [*before, "WKS Segment"]
    assert mesh.uv_layers.active.name == "WKS Segment"
    assert not before or mesh.uv_layers[0].active_render
    uvs = numbers(mesh, "WKS Segment", "vector", 2)
    assert 0 <= uvs.min() < uvs.max() <= 1
    of_corner = np.repeat(labels, 3)
    boxes = {part: (uvs[of_corner == part].min(axis=0), uvs[of_corner == part].max(axis=0)) for part in range(4)}
    for part, (low, high) in boxes.items():
        for other, (other_low, other_high) in boxes.items():
            assert part == other or (high <= other_low).any() or (other_high <= low).any()
    found = islands(mesh, uvs)
    assert all(len(np.unique(labels[found == island])) == 1 for island in np.unique(found))


def test_scale_is_that_of_the_surface(labeled):
    OPS.unwrap()
    mesh, labels = labeled.data, labels_of(labeled)
    uvs = numbers(mesh, "WKS Segment", "vector", 2).reshape(-1, 3, 2)
    (ux, uy), (vx, vy) = (np.moveaxis(uvs[:, i] - uvs[:, 0], -1, 0) for i in (1, 2))
    in_map, area = np.abs(ux * vy - uy * vx) / 2, np.array([polygon.area for polygon in mesh.polygons])
    shares = [in_map[labels == part].sum() / area[labels == part].sum() for part in range(4)]
    assert max(shares) < 2 * min(shares)


def test_a_closed_segment_is_laid_out_too():
    """Without a border, along which it could be cut."""
    obj = limbed()
    write_labels(obj.data, np.zeros(len(obj.data.polygons), dtype=int))
    select(obj)
    assert OPS.unwrap() == {"FINISHED"}
    uvs = numbers(obj.data, "WKS Segment", "vector", 2).reshape(-1, 3, 2)
    (ux, uy), (vx, vy) = (np.moveaxis(uvs[:, i] - uvs[:, 0], -1, 0) for i in (1, 2))
    assert (np.abs(ux * vy - uy * vx) > 1e-9).mean() > 0.99
    assert 1 < len(np.unique(islands(obj.data, uvs.reshape(-1, 2)))) < 100


def test_vertices_that_an_importer_split_do_not_split_islands():
    points = coordinates(limbed("Whole").data)
    corners = np.array([list(polygon.vertices) for polygon in bpy.data.objects["Whole"].data.polygons])
    split = mesh_object(points[corners.ravel()], np.arange(corners.size).reshape(-1, 3), "Split")
    found = {}
    for obj in (bpy.data.objects["Whole"], split):
        write_labels(obj.data, stripes(obj.data))
        select(obj)
        OPS.unwrap()
        found[obj.name] = numbers(obj.data, "WKS Segment", "vector", 2)
    np.testing.assert_allclose(found["Split"], found["Whole"], atol=1e-4)


def test_a_mesh_full_of_uv_maps_is_refused(labeled):
    while len(labeled.data.uv_layers) < 8:
        labeled.data.uv_layers.new()
    before = scene_snapshot()
    with pytest.raises(RuntimeError, match="8 UV maps"):
        OPS.unwrap()
    assert not changes(before, scene_snapshot())


def test_unwrapping_changes_nothing_else(labeled):
    other = limbed("Other")
    select(other, labeled)
    before = scene_snapshot()
    OPS.unwrap()
    changed = changes(before, scene_snapshot())
    assert changed
    assert all(path.startswith("/meshes/Limbed/") and ("uv" in path or "WKS Segment" in path) for path in changed), (
        changed
    )


# The way back


def test_corrected_face_sets_become_segments(obj):
    labels = stripes(obj.data)
    write_labels(obj.data, labels, OutputOptions(face_sets=True))
    sets = obj.data.attributes[FACE_SETS].data
    sets[0].value, sets[1].value, sets[2].value = sets[len(sets) - 1].value, 90, 95
    expected = labels.copy()
    expected[:3] = labels[-1], 4, 5
    OPS.segments_from(source="FACE_SETS")
    np.testing.assert_array_equal(labels_of(obj), expected)


def test_corrected_materials_become_segments(obj, settings):
    labels = stripes(obj.data)
    settings.write_materials = True
    write_labels(obj.data, labels, OutputOptions(materials=True))
    first = len(obj.data.materials) - 4
    obj.data.materials.append(bpy.data.materials.new("Fur"))
    obj.data.polygons[0].material_index = first + labels[-1]
    obj.data.polygons[1].material_index = first + 4
    expected = labels.copy()
    expected[:2] = labels[-1], 4
    OPS.segments_from(source="MATERIALS")
    np.testing.assert_array_equal(labels_of(obj), expected)


def test_the_artists_own_materials_become_segments(settings):
    obj = painted(limbed())
    select(obj)
    OPS.segments_from(source="MATERIALS")
    np.testing.assert_array_equal(labels_of(obj), np.arange(len(obj.data.polygons)) % 2)


@pytest.mark.parametrize("kind", ["hard", "soft"])
def test_corrected_vertex_groups_become_segments(obj, settings, kind):
    settings.vertex_groups = kind
    OPS.learn()
    labels = labels_of(obj)
    corners = list(obj.data.polygons[0].vertices)
    target = int(next(part for part in np.unique(labels) if part != labels[0]))
    group = obj.vertex_groups[f"WKS Segment {target + 1}"]
    for other in obj.vertex_groups:
        other.remove(corners)
    group.add(corners, 1.0, "REPLACE")
    OPS.segments_from(source="VERTEX_GROUPS")
    found = labels_of(obj)
    assert found[0] == target
    # Beside the corrected face and its neighbors, a face keeps its segment, or on a border gets one that is there.
    near = [p.index for p in obj.data.polygons if set(p.vertices) & set(corners)]
    kept = np.ones(len(found), dtype=bool)
    kept[near] = False
    assert (found == labels)[kept].mean() > 0.95
    assert [name for name in obj.vertex_groups.keys() if name == "Mine"] == ["Mine"] * ("Mine" in obj.vertex_groups)  # noqa: SIM118


def test_objects_of_a_character_share_what_is_called_the_same(settings):
    body, hat = limbed("Body"), limbed("Hat")
    hat.parent = body
    skin, felt = bpy.data.materials.new("Skin"), bpy.data.materials.new("Felt")
    body.data.materials.append(skin)
    hat.data.materials.append(felt)
    hat.data.materials.append(skin)
    hat.data.polygons.foreach_set("material_index", np.arange(len(hat.data.polygons), dtype=np.int32) % 2)
    select(body, hat)
    OPS.segments_from(source="MATERIALS")
    np.testing.assert_array_equal(labels_of(body), 0)
    np.testing.assert_array_equal(labels_of(hat), 1 - np.arange(len(hat.data.polygons)) % 2)


@pytest.mark.parametrize("source", ["FACE_SETS", "MATERIALS", "VERTEX_GROUPS"])
def test_nothing_to_take_segments_from_is_named(settings, source):
    select(limbed())
    before = scene_snapshot()
    with pytest.raises(RuntimeError, match=r'"Limbed" has no (face sets|materials|vertex groups)'):
        OPS.segments_from(source=source)
    assert not changes(before, scene_snapshot())


# Separate


def faces_at(obj):
    """Sorted centers of an object's faces as they are seen, in world space."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    seen = obj.evaluated_get(depsgraph)
    centers = [seen.matrix_world @ polygon.center for polygon in seen.to_mesh().polygons]
    return np.array(sorted([tuple(np.round(center, 4)) for center in centers]))


def pieces_of(obj):
    pieces = [other for other in bpy.data.objects if "wks_segment_piece" in other]
    return [piece for piece in pieces if piece["wks_segment_piece"]["of"] == obj]


@pytest.mark.parametrize("make", [limbed, limbed_rigged, lambda: limbed_keys(0.5)], ids=["plain", "rigged", "keyed"])
def test_pieces_look_as_the_whole_and_move_with_it(settings, make):
    obj = make()
    painted(obj)
    obj.location = (1, 2, 3)
    body = obj.parent or obj
    write_labels(obj.data, stripes(obj.data), OutputOptions(materials=True))
    select(obj)
    assert OPS.separate() == {"FINISHED"}
    pieces = pieces_of(obj)
    assert sorted(piece.name for piece in pieces) == [f"Segment {i}" for i in range(1, 5)]
    assert obj.hide_get()
    assert obj.hide_render
    assert not obj.select_get()
    assert all(piece.select_get() and piece.parent == body for piece in pieces)
    for frame, location in ((1, (1, 2, 3)), (11, (5, 0, 0))):
        bpy.context.scene.frame_set(frame)
        obj.location = location
        if obj.data.shape_keys:
            for other in (obj, *pieces):
                other.data.shape_keys.key_blocks[1].value = frame / 11
        for piece in pieces if obj.parent else []:
            piece.location = location
        bpy.context.view_layer.update()
        together = sorted(map(tuple, np.concatenate([faces_at(piece) for piece in pieces]).tolist()))
        np.testing.assert_allclose(together, faces_at(obj), atol=2e-4)
    for piece in pieces:
        assert [m.name for m in piece.data.materials] == [m.name for m in obj.data.materials]
        assert list(piece.data.uv_layers.keys()) == ["First", "Second"]
        assert piece.vertex_groups.keys() == obj.vertex_groups.keys()
        assert [m.type for m in piece.modifiers] == [m.type for m in obj.modifiers]
        assert len(np.unique(labels_of(piece))) == 1


def test_pieces_keep_uvs_and_material_of_each_face(settings):
    obj = painted(limbed())
    labels = stripes(obj.data)
    write_labels(obj.data, labels)
    select(obj)
    OPS.separate()
    uvs = numbers(obj.data, "First", "vector", 2).reshape(-1, 3, 2)
    for piece in pieces_of(obj):
        (part,) = np.unique(labels_of(piece))
        np.testing.assert_array_equal(numbers(piece.data, "First", "vector", 2).reshape(-1, 3, 2), uvs[labels == part])
        np.testing.assert_array_equal(
            numbers(piece.data, "material_index"), numbers(obj.data, "material_index")[labels == part]
        )


@pytest.mark.parametrize("which", ["pieces", "whole"])
def test_clear_gives_the_whole_back(labeled, which):
    before = scene_snapshot()
    OPS.separate()
    if which == "whole":
        labeled.hide_set(False)
        select(labeled)
    OPS.clear()
    clean = scene_snapshot()
    write_labels(labeled.data, stripes(labeled.data))
    assert not changes(before, scene_snapshot())
    assert list(clean["objects"]) == ["Limbed"]


def test_a_piece_that_was_worked_on_stays(labeled, printed):
    OPS.separate()
    first, second = pieces_of(labeled)[:2]
    first.data.vertices[0].co.x += 0.5
    second.name = "Arm"
    printed()
    OPS.clear()
    assert "2 separated objects were worked on since, and stay" in printed().out
    assert sorted(obj.name for obj in bpy.data.objects) == ["Arm", "Limbed", "Segment 1"]
    assert not pieces_of(labeled)


def test_what_is_separated_is_not_separated_again(labeled):
    OPS.separate()
    with pytest.raises(RuntimeError, match="is separated already"):
        OPS.separate()


# Transfer


def test_an_outfit_gets_the_segments_of_the_nearest_surface(settings):
    body, coat = limbed("Body", 0.4), limbed("Coat", 0.4, subdivisions=5)
    coat.data.transform(coat.matrix_world.Scale(1.03, 4))
    coat.location = body.location = (3, 0, 0)
    write_labels(body.data, stripes(body.data))
    select(body, coat)
    assert OPS.transfer() == {"FINISHED"}
    assert (labels_of(coat) == stripes(coat.data)).mean() > 0.95
    np.testing.assert_array_equal(labels_of(body), stripes(body.data))


def test_transfer_sees_both_as_they_are_posed(settings):
    body, coat = limbed_rigged("Body"), limbed("Coat")
    bpy.context.scene.frame_set(11)
    seen = body.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
    points = np.array([vertex.co for vertex in seen.vertices])
    coat.data.vertices.foreach_set("co", points.ravel().astype(np.float32))
    coat.data.update()
    write_labels(body.data, stripes(body.data))
    select(body, coat)
    assert OPS.transfer() == {"FINISHED"}
    np.testing.assert_array_equal(labels_of(coat), stripes(body.data))


def test_transfer_writes_what_is_asked_for_and_can_be_undone(settings):
    body, coat = limbed("Body"), painted(limbed("Coat"))
    write_labels(body.data, stripes(body.data))
    settings.write_face_sets = settings.write_seams = settings.write_materials = True
    settings.vertex_groups = "hard"
    select(body, coat)
    done, left = undone(OPS.transfer)
    assert all("/Body/" not in path for path in done)
    assert any("wks_segment_seam" in path for path in done)
    assert not left


def test_transfer_needs_labels_on_the_active_object(settings):
    select(limbed("One"), limbed("Two"))
    assert not OPS.transfer.poll()


def test_borders_of_labels():
    mesh = mesh_object([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [(0, 1, 2), (0, 2, 3)]).data
    found = {edge.key for edge, border in zip(mesh.edges, border_edges(mesh, np.array([4, 2])), strict=True) if border}
    assert found == {(0, 2)}
    assert not border_edges(mesh, np.array([1, 1])).any()
    assert labels_on(mesh) is None


def test_pieces_are_removed_though_the_whole_is_out_of_sight(labeled):
    """In a collection that is excluded from the view layer, where nothing can be shown or selected."""
    collection = bpy.data.collections.new("Kept")
    bpy.context.scene.collection.children.link(collection)
    OPS.separate()
    collection.objects.link(labeled)
    bpy.context.scene.collection.objects.unlink(labeled)
    bpy.context.view_layer.layer_collection.children["Kept"].exclude = True
    assert OPS.clear() == {"FINISHED"}
    assert [obj.name for obj in bpy.data.objects] == ["Limbed"]
    assert not labeled.hide_render
