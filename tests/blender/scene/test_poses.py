"""Reading a pose: what the artist sees, and which triangle comes from which of the artist's polygons."""

import bpy
import numpy as np
import pytest
from boxes import CUBE, QUADS, box, read
from builders import (
    bent,
    changes,
    coordinates,
    limbed,
    limbed_keys,
    limbed_rigged,
    mesh_object,
    snapshot,
)

from wks_segment.blender.cli.creature import build_creature
from wks_segment.blender.errors import UserError
from wks_segment.blender.scene import poses as reader
from wks_segment.blender.scene.characters import Character, polygon_ranges

pytestmark = pytest.mark.usefixtures("scene")
UP = np.array([0.0, 0.0, 1.0])


def extent(pose):
    return pose.mesh.vertices.min(axis=0), pose.mesh.vertices.max(axis=0)


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


def test_upright_is_in_the_objects_own_axes():
    cube = box(0, 1)
    cube.location, cube.rotation_euler, cube.scale = (3, 0, 1), (0.3, 2, 1), (1, 2, 3)
    upright = read(cube).upright.vertices
    np.testing.assert_allclose(np.ptp(upright, axis=0), (1, 2, 3), atol=1e-5)
    left = coordinates(cube.data)[:, 0] > 0.5
    assert upright[left, 0].min() > upright[~left, 0].max() + 0.9


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_left_of_a_mirrored_object_is_where_it_is_seen(axis):
    """Left of someone who looks along −Y and is upright: turned upside down or round, it changes sides."""
    cube = box(0, 1)
    cube.scale[axis] = -1
    upright = read(cube).upright.vertices
    triple = np.linalg.det(read(cube).axes)
    assert triple == pytest.approx(1)
    left = coordinates(cube.data)[:, 0] > 0.5
    assert upright[left, 0].max() < upright[~left, 0].min() + 1e-6


def test_upright_is_the_rest_position_in_the_axes_of_the_armature():
    obj = limbed_rigged()
    armature = obj.parent
    armature.rotation_euler.z = np.pi
    bpy.context.scene.frame_set(11)
    (pose,) = reader.read_objects(bpy.context, [Character((obj,))])
    np.testing.assert_allclose(pose.upright.vertices, coordinates(obj.data), atol=1e-5)
    assert np.abs(pose.mesh.vertices * (-1, -1, 1) - coordinates(obj.data)).max() > 0.5


def test_left_is_that_of_the_largest_object():
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


def test_modifiers_that_are_off_are_ignored():
    cube = box()
    cube.modifiers.new("Subdivision", "SUBSURF").show_viewport = False
    assert read(cube).mesh.n_faces == 12


def test_two_objects_are_read_as_one_surface_in_order():
    first, second = box(name="A"), limbed("B")
    pose = read(first, second)
    assert pose.mesh.n_vertices == 8 + len(second.data.vertices)
    assert pose.mesh.faces[:12].max() < 8 <= pose.mesh.faces[12:].min()
    assert np.unique(pose.polygon_of).tolist() == list(range(6 + len(second.data.polygons)))
    ranges = polygon_ranges(pose.character)
    assert [(obj.name, part.start, part.stop) for obj, part in ranges] == [
        ("A", 0, 6),
        ("B", 6, pose.polygon_of[-1] + 1),
    ]


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
    """Two objects of one quad, which Blender must split from corner 0 in the one and from corner 1 in the other."""
    corners = np.array([(0, 0, 0), (1, -1, 0), (2, 0, 0), (1, 2, 0)], dtype=float)
    inward = corners.copy()
    inward[1, 1] = 1
    quad = [(0, 1, 2, 3)]
    return mesh_object(corners, quad, "Kite"), mesh_object(inward, quad, "Dart")


def test_poses_of_the_same_polygons_are_triangulated_alike():
    kite, dart = darts()
    assert not read(kite).is_mesh_of(read(dart)), "Blender triangulates them alike"
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


def test_frames_and_rest_position_are_triangulated_alike(scene):
    obj = build_creature(scene)
    # Quads that are not flat: which diagonal is the shorter one depends on the pose.
    rough = coordinates(obj.data) + np.random.default_rng(0).normal(0, 0.005, (len(obj.data.vertices), 3))
    obj.data.vertices.foreach_set("co", rough.astype(np.float32).ravel())
    obj.data.update()
    creature = Character((obj,))
    cuts = []
    for frame in (5, 20):
        scene.frame_set(frame)
        cuts.append(reader.read_pose(bpy.context, creature, "a pose"))
    assert not cuts[0].is_mesh_of(cuts[1]), "Blender triangulates them alike"
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
    centers = pose.mesh.vertices[pose.mesh.faces].mean(axis=1)
    away = np.linalg.norm(centers - polygon_centers(obj)[pose.polygon_of], axis=1)
    nearest = np.linalg.norm(centers[:, None] - polygon_centers(obj)[None], axis=2).min(axis=1)
    assert (away < nearest + 0.2).all()


def test_mirrored_faces_map_to_the_own_polygons_on_both_sides():
    obj = box(0.5, 1)
    obj.modifiers.new("Mirror", "MIRROR")
    pose = read(obj)
    assert np.bincount(pose.polygon_of).tolist() == [4] * 6
    centers = pose.mesh.vertices[pose.mesh.faces].mean(axis=1)
    own = polygon_centers(obj)[pose.polygon_of]
    np.testing.assert_allclose(np.abs(centers[:, 0]), own[:, 0], atol=0.2)
    assert (centers[:, 0] < 0).sum() == 12


@pytest.mark.parametrize("kind", ["SOLIDIFY", "ARRAY", "TRIANGULATE", "EDGE_SPLIT", "WELD", "BEVEL", "MULTIRES"])
def test_every_polygon_is_found_after_a_modifier(kind):
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
    with pytest.raises(UserError, match=r'modifier of "Statue".*apply it, or turn it off'):
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


def test_islands_and_loose_vertices_are_read():
    points, quads = [*CUBE, *(CUBE + 5), (9, 9, 9)], [*QUADS, *(tuple(8 + i for i in quad) for quad in QUADS)]
    pose = read(mesh_object(points, quads))
    assert (pose.mesh.n_vertices, pose.mesh.n_faces) == (17, 24)


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


def test_an_object_without_faces_is_ignored_in_a_character_with_faces():
    wire = mesh_object([(0, 0, 0), (1, 0, 0)], [], "Wire")
    assert read(box(name="A"), wire).mesh.n_faces == 12
