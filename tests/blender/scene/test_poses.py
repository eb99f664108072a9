"""Reading poses: what the artist sees, and the way back to the artist's own polygons."""

import bpy
import numpy as np
import pytest
from builders import (
    bent,
    changes,
    coordinates,
    labels_of,
    limbed,
    limbed_keys,
    limbed_rigged,
    mesh_object,
    rig,
    scene_snapshot,
    select,
    snapshot,
)

from wks_segment.blender.cli.creature import build_creature
from wks_segment.blender.errors import UserError
from wks_segment.blender.scene import poses as reader
from wks_segment.blender.scene.characters import Character, group, mesh_objects

pytestmark = pytest.mark.usefixtures("scene")
UP = np.array([0.0, 0.0, 1.0])
CUBE = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]


def read(*objects):
    bpy.context.view_layer.update()
    return reader.read_pose(bpy.context, Character(objects), "a pose")


def box(low=-1.0, high=1.0, name="Box"):
    return mesh_object(low + (high - low) * (CUBE + 1) / 2, QUADS, name)


def extent(pose):
    return pose.mesh.vertices.min(axis=0), pose.mesh.vertices.max(axis=0)


# What is seen


def test_object_transform_is_applied():
    cube = box()
    cube.location, cube.scale, cube.rotation_euler = (10, 0, 0), (1, 2, 3), (0, 0, np.pi / 2)
    low, high = extent(read(cube))
    np.testing.assert_allclose(low, (8, -1, -3), atol=1e-5)
    np.testing.assert_allclose(high, (12, 1, 3), atol=1e-5)


def test_negative_scale_mirrors_and_keeps_the_area():
    cube = box(0, 1)
    cube.scale = (-2, 1, 1)
    pose = read(cube)
    np.testing.assert_allclose(extent(pose), ((-2, 0, 0), (0, 1, 1)), atol=1e-6)
    assert pose.mesh.area == pytest.approx(4 * 2 + 2 * 1, rel=1e-5)


def test_upright_is_as_the_object_itself_has_it():
    cube = box(0, 1)
    cube.location, cube.rotation_euler, cube.scale = (3, 0, 1), (0.3, 2, 1), (1, 2, 3)
    upright = read(cube).upright.vertices
    np.testing.assert_allclose(np.ptp(upright, axis=0), (1, 2, 3), atol=1e-5)
    left = coordinates(cube.data)[:, 0] > 0.5
    assert upright[left, 0].min() > upright[~left, 0].max() + 0.9


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_in_a_mirror_left_is_what_is_seen_on_the_left(axis):
    """Left of someone who looks along −Y and is upright: turned upside down or round, it changes sides."""
    cube = box(0, 1)
    cube.scale[axis] = -1
    upright = read(cube).upright.vertices
    triple = np.linalg.det(read(cube).axes)
    assert triple == pytest.approx(1)
    left = coordinates(cube.data)[:, 0] > 0.5
    assert upright[left, 0].max() < upright[~left, 0].min() + 1e-6


def test_upright_is_at_rest_and_as_the_armature_has_it():
    obj = limbed_rigged()
    armature = obj.parent
    armature.rotation_euler.z = np.pi
    bpy.context.scene.frame_set(11)
    (pose,) = reader.read_objects(bpy.context, [Character((obj,))])
    np.testing.assert_allclose(pose.upright.vertices, coordinates(obj.data), atol=1e-5)
    assert np.abs(pose.mesh.vertices * (-1, -1, 1) - coordinates(obj.data)).max() > 0.5


def test_the_largest_object_says_where_left_is():
    eye, body = box(name="A"), limbed("Body")
    eye.rotation_euler.z = 2
    np.testing.assert_allclose(read(eye, body).axes, np.eye(3), atol=1e-6)


def test_parent_transform_is_applied():
    cube, empty = box(), bpy.data.objects.new("Empty", None)
    bpy.context.scene.collection.objects.link(empty)
    empty.scale = (3, 3, 3)
    cube.parent = empty
    assert extent(read(cube))[1] == pytest.approx((3, 3, 3))


def test_armature_is_applied():
    obj = limbed_rigged()
    bpy.context.scene.frame_set(1)
    straight = read(obj).mesh.vertices
    bpy.context.scene.frame_set(11)
    raised = read(obj).mesh.vertices
    np.testing.assert_allclose(straight, coordinates(obj.data), atol=1e-5)
    tip = straight[:, 0].argmax()
    assert np.linalg.norm(raised[tip] - straight[tip]) > 0.5
    still = straight[:, 0] < 0.5
    np.testing.assert_allclose(raised[still], straight[still], atol=1e-5)


def test_shape_key_values_are_applied():
    obj = limbed_keys(0.8)
    basis = coordinates(obj.data)
    obj.data.shape_keys.key_blocks["Bend 0.8"].value = 0.5
    np.testing.assert_allclose(read(obj).mesh.vertices, (basis + bent(basis, 0.8)) / 2, atol=1e-5)


def test_modifiers_that_are_off_take_no_part():
    cube = box()
    cube.modifiers.new("Subdivision", "SUBSURF").show_viewport = False
    assert read(cube).mesh.n_faces == 12


def test_two_objects_are_read_as_one_surface_in_order():
    first, second = box(name="A"), limbed("B")
    pose = read(first, second)
    assert pose.mesh.n_vertices == 8 + len(second.data.vertices)
    assert pose.mesh.faces[:12].max() < 8 <= pose.mesh.faces[12:].min()
    assert np.unique(pose.polygon_of).tolist() == list(range(6 + len(second.data.polygons)))
    ranges = reader.polygon_ranges(pose.character)
    assert [(obj.name, part.start, part.stop) for obj, part in ranges] == [
        ("A", 0, 6),
        ("B", 6, pose.polygon_of[-1] + 1),
    ]


# Where triangles come from


def test_ngons_are_triangulated_and_know_their_polygon():
    angles = np.linspace(0, 2 * np.pi, 7)[:-1]
    ring = np.stack([np.cos(angles), np.sin(angles), np.zeros(6)], axis=1)
    prism = mesh_object(
        np.concatenate([ring - UP, ring + UP]),
        [range(6), range(11, 5, -1), *((i, (i + 1) % 6, (i + 1) % 6 + 6, i + 6) for i in range(6))],
    )
    pose = read(prism)
    assert pose.mesh.n_faces == 4 + 4 + 6 * 2
    assert np.bincount(pose.polygon_of).tolist() == [4, 4, 2, 2, 2, 2, 2, 2]
    corners = [set(polygon.vertices) for polygon in prism.data.polygons]
    for triangle, polygon in zip(pose.mesh.faces.tolist(), pose.polygon_of.tolist(), strict=True):
        assert set(triangle) <= corners[polygon]


def polygon_centers(obj):
    return np.array([polygon.center for polygon in obj.data.polygons])


def darts():
    """Two objects of one quad, which Blender must cut from corner 0 in the one and from corner 1 in the other."""
    corners = np.array([(0, 0, 0), (1, -1, 0), (2, 0, 0), (1, 2, 0)], dtype=float)
    inward = corners.copy()
    inward[1, 1] = 1
    quad = [(0, 1, 2, 3)]
    return mesh_object(corners, quad, "Kite"), mesh_object(inward, quad, "Dart")


def test_poses_of_the_same_polygons_are_cut_alike():
    kite, dart = darts()
    assert not read(kite).is_mesh_of(read(dart)), "Blender cuts them alike"
    first, second = reader.read_objects(bpy.context, [Character((kite,)), Character((dart,))])
    assert first.is_mesh_of(second)
    np.testing.assert_array_equal(second.mesh.vertices, read(dart).mesh.vertices)
    np.testing.assert_array_equal(first.mesh.faces, read(kite).mesh.faces)


def test_poses_of_other_polygons_keep_their_triangles():
    kite = darts()[0]
    halves = mesh_object(coordinates(kite.data), [(0, 1, 3), (1, 2, 3)])
    corner = mesh_object(coordinates(kite.data), [(0, 1, 2)])
    for other in (halves, corner):
        _, pose = reader.read_objects(bpy.context, [Character((kite,)), Character((other,))])
        np.testing.assert_array_equal(pose.mesh.faces, read(other).mesh.faces)


def test_frames_and_rest_position_are_cut_alike(scene):
    obj = build_creature(scene)
    # Quads that are not flat: which diagonal is the shorter one hangs on the pose.
    rough = coordinates(obj.data) + np.random.default_rng(0).normal(0, 0.005, (len(obj.data.vertices), 3))
    obj.data.vertices.foreach_set("co", rough.astype(np.float32).ravel())
    obj.data.update()
    creature = Character((obj,))
    cuts = []
    for frame in (5, 20):
        scene.frame_set(frame)
        cuts.append(reader.read_pose(bpy.context, creature, "a pose"))
    assert not cuts[0].is_mesh_of(cuts[1]), "Blender cuts them alike"
    first, second = reader.read_frames(bpy.context, creature, [5, 20])
    assert first.is_mesh_of(second)
    np.testing.assert_array_equal(first.rest.faces, first.mesh.faces)
    np.testing.assert_allclose(first.rest.vertices, coordinates(creature.objects[0].data), atol=1e-6)


def test_subdivided_faces_map_to_the_own_polygons():
    obj = limbed(subdivisions=3)
    obj.modifiers.new("Subdivision", "SUBSURF").levels = 1
    pose = read(obj)
    assert pose.mesh.n_faces == 6 * len(obj.data.polygons)
    assert np.bincount(pose.polygon_of).tolist() == [6] * len(obj.data.polygons)
    middles = pose.mesh.vertices[pose.mesh.faces].mean(axis=1)
    away = np.linalg.norm(middles - polygon_centers(obj)[pose.polygon_of], axis=1)
    nearest = np.linalg.norm(middles[:, None] - polygon_centers(obj)[None], axis=2).min(axis=1)
    assert (away < nearest + 0.2).all()


def test_mirrored_faces_map_to_the_own_polygons_on_both_sides():
    obj = box(0.5, 1)
    obj.modifiers.new("Mirror", "MIRROR")
    pose = read(obj)
    assert np.bincount(pose.polygon_of).tolist() == [4] * 6
    middles = pose.mesh.vertices[pose.mesh.faces].mean(axis=1)
    own = polygon_centers(obj)[pose.polygon_of]
    np.testing.assert_allclose(np.abs(middles[:, 0]), own[:, 0], atol=0.2)
    assert (middles[:, 0] < 0).sum() == 12


@pytest.mark.parametrize("kind", ["SOLIDIFY", "ARRAY", "TRIANGULATE", "EDGE_SPLIT", "WELD", "BEVEL", "MULTIRES"])
def test_every_polygon_is_found_behind_a_modifier(kind):
    obj = limbed(subdivisions=3)
    obj.modifiers.new("Modifier", kind)
    pose = read(obj)
    assert np.unique(pose.polygon_of).tolist() == list(range(len(obj.data.polygons)))


def test_faces_that_a_boolean_takes_from_another_object_are_of_no_own_polygon():
    obj, other = limbed(subdivisions=3), limbed("Other", subdivisions=3)
    other.location.x = 1
    boolean = obj.modifiers.new("Boolean", "BOOLEAN")
    boolean.object, boolean.operation = other, "UNION"
    pose = read(obj)
    assert pose.mesh.n_faces > len(obj.data.polygons), "the other object adds nothing: the test is void"
    assert np.bincount(pose.polygon_of[pose.polygon_of >= 0])[0] < 10
    assert (pose.polygon_of == -1).sum() > 100


@pytest.mark.parametrize("kind", ["REMESH", "SKIN"])
def test_modifier_without_trace_of_origin_is_refused(kind):
    obj = box(name="Statue")
    obj.modifiers.new("Modifier", kind)
    with pytest.raises(UserError, match=r'"Statue".*modifier.*apply it, or turn it off'):
        read(obj)


@pytest.mark.parametrize("kind", ["SUBSURF", "REMESH"])
def test_nothing_stays_on_the_mesh_after_reading(kind):
    obj = limbed(subdivisions=3)
    obj.modifiers.new("Modifier", kind)
    before = snapshot(obj.data)
    if kind == "REMESH":
        with pytest.raises(UserError):
            read(obj)
    else:
        read(obj)
    assert not changes(before, snapshot(obj.data))


def test_loose_parts_and_stray_vertices_are_read():
    points, quads = [*CUBE, *(CUBE + 5), (9, 9, 9)], [*QUADS, *(tuple(8 + i for i in quad) for quad in QUADS)]
    pose = read(mesh_object(points, quads))
    assert (pose.mesh.n_vertices, pose.mesh.n_faces) == (17, 24)


# Frames


def test_frames_are_read_by_name_and_the_scene_returns_to_its_frame():
    obj, scene = limbed_rigged(), bpy.context.scene
    scene.frame_set(7, subframe=0.25)
    poses = reader.read_frames(bpy.context, Character((obj,)), [1, 11])
    assert [pose.name for pose in poses] == ["Walker, frame 1", "Walker, frame 11"]
    assert not poses[0].is_like(poses[1])
    assert (scene.frame_current, scene.frame_subframe) == (7, 0.25)


def test_frame_returns_after_an_error():
    obj, scene = limbed_rigged(), bpy.context.scene
    obj.modifiers.new("Remesh", "REMESH")
    scene.frame_set(7, subframe=0.5)
    with pytest.raises(UserError):
        reader.read_frames(bpy.context, Character((obj,)), [1, 11])
    assert (scene.frame_current, scene.frame_subframe) == (7, 0.5)


def test_evenly_holds_both_ends_and_repeats_nothing():
    assert reader.evenly(1, 9, 3) == [1, 5, 9]
    assert reader.evenly(0, 3, 10) == [0, 1, 2, 3]
    assert reader.evenly(5, 5, 4) == [5]
    assert reader.evenly(-10, 10, 5) == [-10, -5, 0, 5, 10]
    assert reader.evenly(3, 9, 1) == [3]


def test_own_frames_lie_within_the_action_and_leave_out_its_ends():
    obj, scene = limbed_rigged(bends=((101, 0.0), (141, 0.8))), bpy.context.scene
    scene.frame_start, scene.frame_end = 1, 10
    frames = reader.own_frames(scene, Character((obj,)), 4)
    assert frames == [106, 116, 126, 136]


def test_own_frames_of_a_character_without_action_are_those_of_the_scene():
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 10, 20
    assert reader.own_frames(scene, Character((limbed(),)), 2) in ([12, 18], [12, 17])


def test_own_frames_follow_keyed_shape_keys_and_objects():
    obj, scene = limbed_keys(0.8), bpy.context.scene
    key = obj.data.shape_keys.key_blocks[1]
    key.keyframe_insert("value", frame=50)
    key.keyframe_insert("value", frame=60)
    obj.keyframe_insert("location", frame=40)
    assert reader.own_frames(scene, Character((obj,)), 2) == [45, 55]


# Shape keys


def test_shape_keys_are_read_alone_at_their_full_value():
    obj = limbed_keys(0.4, 0.8)
    obj.data.shape_keys.key_blocks[1].value = 0.7
    basis = coordinates(obj.data)
    poses = reader.read_shape_keys(bpy.context, Character((obj,)), 9)
    assert [pose.name for pose in poses] == ["Keyed, Basis", "Keyed, Bend 0.4", "Keyed, Bend 0.8"]
    for pose, bend in zip(poses, (0, 0.4, 0.8), strict=True):
        np.testing.assert_allclose(pose.mesh.vertices, bent(basis, bend), atol=1e-5)


def test_only_so_many_shape_keys_are_taken_evenly():
    obj = limbed_keys(0.1, 0.2, 0.3, 0.4)
    poses = reader.read_shape_keys(bpy.context, Character((obj,)), 3)
    assert [pose.name for pose in poses] == ["Keyed, Basis", "Keyed, Bend 0.2", "Keyed, Bend 0.4"]


@pytest.mark.parametrize("pinned", [True, False])
def test_active_shape_key_and_pin_come_back(pinned):
    obj = limbed_keys(0.4, 0.8)
    obj.active_shape_key_index, obj.show_only_shape_key = 1, pinned
    reader.read_shape_keys(bpy.context, Character((obj,)), 3)
    assert (obj.active_shape_key_index, obj.show_only_shape_key) == (1, pinned)


def test_active_shape_key_comes_back_after_an_error():
    obj = limbed_keys(0.4, 0.8)
    obj.active_shape_key_index = 1
    obj.modifiers.new("Remesh", "REMESH")
    with pytest.raises(UserError):
        reader.read_shape_keys(bpy.context, Character((obj,)), 3)
    assert (obj.active_shape_key_index, obj.show_only_shape_key) == (1, False)


def test_muted_shape_keys_are_left_out():
    obj = limbed_keys(0.4, 0.8)
    obj.data.shape_keys.key_blocks["Bend 0.4"].mute = True
    assert [pose.name for pose in reader.read_shape_keys(bpy.context, Character((obj,)), 9)] == [
        "Keyed, Basis",
        "Keyed, Bend 0.8",
    ]


def test_object_whose_shape_keys_are_all_muted_is_refused():
    obj = limbed_keys(0.4)
    for key in obj.data.shape_keys.key_blocks:
        key.mute = True
    with pytest.raises(UserError, match='"Keyed"'):
        reader.read_shape_keys(bpy.context, Character((obj,)), 3)


def test_object_without_shape_keys_is_refused():
    with pytest.raises(UserError, match='"Limbed" has no shape keys'):
        reader.read_shape_keys(bpy.context, Character((limbed(),)), 3)


# Characters


def test_objects_on_one_armature_are_one_character():
    body, hat, other = limbed("Body"), limbed("Hat"), limbed("Other")
    rig([body, hat], "Skeleton")
    characters = group([body, hat, other])
    assert [(character.name, len(character.objects)) for character in characters] == [("Skeleton", 2), ("Other", 1)]


def test_object_on_a_bone_belongs_to_the_armature():
    body, hat = limbed("Body"), limbed("Hat")
    armature = rig([body], "Skeleton")
    hat.parent, hat.parent_type, hat.parent_bone = armature, "BONE", "limb"
    assert [character.objects for character in group([body, hat])] == [(body, hat)]


def test_bone_shapes_are_no_characters():
    body, shape = limbed("Body"), box(name="Widget")
    armature = rig([body])
    armature.pose.bones["limb"].custom_shape = shape
    assert mesh_objects([shape, armature, body]) == [body]


def test_no_object_is_refused():
    with pytest.raises(UserError, match="select the character's mesh"):
        group([])


# Surfaces that cannot be used


def test_not_finite_coordinate_is_named_with_its_vertex():
    obj = limbed("Broken")
    obj.data.vertices[3].co.x = float("nan")
    with pytest.raises(UserError, match=r'"Broken".*vertex 3 .*not finite'):
        reader.read_objects(bpy.context, [Character((obj,))])


def test_object_without_faces_is_named():
    wire = mesh_object([(0, 0, 0), (1, 0, 0)], [], "Wire")
    with pytest.raises(UserError, match='"Wire" has no faces'):
        read(wire)


def test_object_without_size_is_named():
    flat = box(name="Flat")
    flat.scale = (0, 0, 0)
    bpy.context.view_layer.update()
    with pytest.raises(UserError, match=r'"Flat".*no area'):
        reader.read_objects(bpy.context, [Character((flat,))])


def test_object_that_is_a_wire_takes_no_part_in_a_character_that_has_faces():
    wire = mesh_object([(0, 0, 0), (1, 0, 0)], [], "Wire")
    assert read(box(name="A"), wire).mesh.n_faces == 12


# From pose to labels


def learn(settings, *objects, **values):
    for name, value in values.items():
        setattr(settings, name, value)
    select(*objects)
    assert bpy.ops.wks_segment.learn() == {"FINISHED"}


def test_polygons_that_a_modifier_hides_are_labeled_like_their_neighbors(settings):
    obj = limbed()
    learn(settings, obj)
    obj.modifiers.new("Decimate", "DECIMATE").ratio = 0.4
    hidden = np.bincount(read(obj).polygon_of, minlength=len(obj.data.polygons)) == 0
    assert hidden.sum() > 100, "the modifier hides nothing: the test is void"
    bpy.ops.wks_segment.apply()
    labels = labels_of(obj)
    centers = np.array([polygon.center for polygon in obj.data.polygons])
    distances = np.linalg.norm(centers[hidden][:, None] - centers[~hidden], axis=2)
    # Several can be equally near: it is the label of one of them.
    nearest = distances <= distances.min(axis=1, keepdims=True) * (1 + 1e-4)
    alike = labels[hidden][:, None] == labels[~hidden]
    assert (nearest & alike).any(axis=1).all()
    assert len(np.unique(labels)) > 1


def test_seams_of_an_imported_file_are_no_borders(settings, tmp_path):
    """A glTF file has a vertex several times along a seam of its UV map."""
    bpy.ops.mesh.primitive_uv_sphere_add(segments=24, ring_count=16)
    path = tmp_path / "seamed.glb"
    bpy.ops.export_scene.gltf(filepath=str(path))
    bpy.ops.object.delete()
    bpy.ops.import_scene.gltf(filepath=str(path))
    (sphere,) = mesh_objects(bpy.context.scene.objects)
    split = len(sphere.data.vertices)
    assert split > 24 * 15 + 2, "the file has no seam: the test is void"
    (pose,) = reader.read_objects(bpy.context, [Character((sphere,))])
    described = settings.new_model().describe(pose.mesh)
    assert described.surface.n_components == 1
    assert len(described.surface.vertex_of) == split
    learn(settings, sphere, n_segments=3)
    labels = labels_of(sphere)
    at_vertices = np.array([value.value for value in sphere.data.attributes["wks_segment_vertex"].data])
    assert len(at_vertices) == split
    around = [set() for _ in at_vertices]
    for polygon, label in zip(sphere.data.polygons, labels, strict=True):
        for vertex in polygon.vertices:
            around[vertex].add(label)
    assert all(label in labels_here for label, labels_here in zip(at_vertices, around, strict=True))


def test_each_loose_part_gets_labels_and_breaks_no_other(settings):
    points = np.concatenate([coordinates(limbed(subdivisions=4).data), 0.1 * CUBE + (0, 0, 4)])
    faces = [list(polygon.vertices) for polygon in bpy.data.objects["Limbed"].data.polygons]
    n_own = len(faces)
    faces += [tuple(int(i) + len(points) - 8 for i in quad) for quad in QUADS]
    alone, both = bpy.data.objects["Limbed"], mesh_object(points, faces, "Both")
    learn(settings, alone)
    bpy.ops.object.select_all(action="DESELECT")
    select(both)
    assert bpy.ops.wks_segment.apply() == {"FINISHED"}
    assert (labels_of(both)[:n_own] == labels_of(alone)).mean() > 0.9
    assert len(labels_of(both)) == n_own + 6


def test_reading_leaves_the_scene_as_it_was():
    obj = limbed_rigged()
    obj.modifiers.new("Subdivision", "SUBSURF")
    select(obj)
    before = scene_snapshot()
    reader.read_frames(bpy.context, Character((obj,)), [3, 9])
    assert not changes(before, scene_snapshot())
