"""Objects of all kinds that Blender has: segmented, or refused with a reason."""

import bpy
import numpy as np
import pytest
from builders import (
    changes,
    labels_of,
    limbed,
    limbed_poses,
    limbed_rigged,
    mesh_object,
    rig,
    scene_snapshot,
    select,
    snapshot,
)  # fmt: skip
from mathutils import Matrix

from wks_segment.blender.scene import poses as reader
from wks_segment.blender.scene.characters import group

OPS = bpy.ops.wks_segment
BENDS = (0.0, 0.5)
pytestmark = pytest.mark.usefixtures("scene")


def reason(operator, **options):
    """Why an operator refuses; nothing may have changed."""
    before = scene_snapshot()
    with pytest.raises(RuntimeError) as caught:
        operator(**options)
    assert not changes(before, scene_snapshot())
    return str(caught.value)


def add(data, name="Thing"):
    obj = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(obj)
    select(obj)
    return obj


# Objects that are not meshes


@pytest.mark.parametrize(
    ("make", "called"),
    [
        (lambda: bpy.data.curves.new("Thing", "CURVE"), "curve"),
        (lambda: bpy.data.curves.new("Thing", "SURFACE"), "surface"),
        (lambda: bpy.data.curves.new("Thing", "FONT"), "text"),
        (lambda: bpy.data.metaballs.new("Thing"), "metaball"),
    ],
)
def test_a_type_that_can_be_converted_is_named(make, called):
    add(make())
    assert f'"Thing" is a {called}: convert it first (Object > Convert > Mesh)' in reason(OPS.learn)


def test_a_converted_metaball_is_a_mesh_like_any_other():
    ball = bpy.data.metaballs.new("Thing")
    for x in (0, 1.2, 2.4):
        ball.elements.new().co = (x, 0, 0)
    add(ball)
    bpy.ops.object.convert(target="MESH")
    assert OPS.learn() == {"FINISHED"}


def test_an_instance_of_a_collection_is_named():
    collection = bpy.data.collections.new("Asset")
    collection.objects.link(bpy.data.objects.new("Inner", limbed().data))
    empty = add(None, "Copy")
    empty.instance_type, empty.instance_collection = "COLLECTION", collection
    assert '"Copy" is an instance: make it real first' in reason(OPS.learn)


def test_geometry_nodes_that_give_only_instances_are_explained():
    obj = limbed("Scattered")
    tree = bpy.data.node_groups.new("Nodes", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    into, out = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
    instance = tree.nodes.new("GeometryNodeGeometryToInstance")
    tree.links.new(into.outputs[0], instance.inputs[0])
    tree.links.new(instance.outputs[0], out.inputs[0])
    obj.modifiers.new("Nodes", "NODES").node_group = tree
    select(obj)
    assert "if it consists of instances, add a Realize Instances node" in reason(OPS.learn)


def test_an_object_of_edges_only_has_no_faces():
    mesh = bpy.data.meshes.new("Wire")
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1), (1, 2)], [])
    add(mesh, "Wire")
    assert '"Wire" has no faces' in reason(OPS.learn)


# Shared and linked data


def test_a_library_override_shares_its_mesh_with_the_library(tmp_path):
    limbed("Foreign")
    path = tmp_path / "library.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with bpy.data.libraries.load(str(path), link=True) as (source, target):
        target.objects = source.objects
    override = target.objects[0].override_create()
    bpy.context.scene.collection.objects.link(override)
    select(override)
    assert '"Foreign" is linked from another file: make it local first' in reason(OPS.learn)


def test_two_objects_of_one_mesh_get_their_labels_once():
    first = limbed("First")
    second = bpy.data.objects.new("Second", first.data)
    second.location.x = 8
    bpy.context.scene.collection.objects.link(second)
    select(first, second)
    assert OPS.learn() == {"FINISHED"}
    assert len(np.unique(labels_of(first))) > 1


def test_materials_that_other_objects_use_stay_as_they_are():
    first, other = limbed("First"), limbed("Other")
    shared = bpy.data.materials.new("Shared")
    for obj in (first, other):
        obj.data.materials.append(shared)
    before = snapshot(other.data)
    bpy.context.scene.wks_segment.write_materials = True
    select(first)
    assert OPS.learn() == {"FINISHED"}
    assert not changes(before, snapshot(other.data))
    assert OPS.clear() == {"FINISHED"}
    assert [material.name for material in first.data.materials] == ["Shared"]


# States of an object


def test_hidden_faces_are_labeled_and_stay_hidden():
    obj = limbed()
    hidden = np.zeros(len(obj.data.polygons), dtype=bool)
    hidden[::3] = True
    obj.data.polygons.foreach_set("hide", hidden)
    select(obj)
    assert OPS.learn() == {"FINISHED"}
    assert (labels_of(obj) >= 0).all()
    now = np.empty_like(hidden)
    obj.data.polygons.foreach_get("hide", now)
    np.testing.assert_array_equal(now, hidden)


def test_edit_mode_of_another_selected_object_is_refused():
    first, second = limbed_poses(*BENDS)
    select(first, second)
    bpy.ops.object.mode_set(mode="EDIT")
    assert "Switch to Object Mode first" in reason(OPS.learn)
    bpy.ops.object.mode_set(mode="OBJECT")


@pytest.mark.parametrize("scale", [(-1, 1, 1), (2, 0.5, 1), (1e-6, 1e-6, 1e-6), (1e6, 1e6, 1e6)])
def test_object_scale_changes_no_labels(scale):
    plain, scaled = limbed("Plain"), limbed("Scaled")
    scaled.scale = scale
    select(plain)
    assert OPS.learn() == {"FINISHED"}
    select(scaled)
    assert OPS.apply() == {"FINISHED"}
    if len({abs(s) for s in scale}) == 1:
        assert (labels_of(plain) == labels_of(scaled)).mean() > 0.98


def test_far_from_the_origin():
    plain, far = limbed("Plain"), limbed("Far")
    far.location = (3e4, -3e4, 3e4)
    select(plain)
    assert OPS.learn() == {"FINISHED"}
    select(far)
    assert OPS.apply() == {"FINISHED"}
    assert (labels_of(plain) == labels_of(far)).mean() > 0.9


def test_four_faces_are_enough():
    tetrahedron = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], [(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)]
    obj = mesh_object(*tetrahedron, "Tetrahedron")
    bpy.context.scene.wks_segment.n_segments = 2
    select(obj)
    assert OPS.learn() == {"FINISHED"}
    assert set(labels_of(obj)) <= {0, 1}


# Islands


def test_islands_are_connected_as_in_the_rest_position():
    body, eye = limbed("Body"), limbed("Eye", subdivisions=3)
    eye.data.transform(Matrix.Scale(0.1, 4))
    eye.data.transform(Matrix.Translation((3.4, 0, 0.8)))
    armature = rig([body, eye])
    before = armature.data.pose_position
    poses = reader.read_frames(bpy.context, group([body, eye])[0], [1, 11, 21])
    assert armature.data.pose_position == before
    assert all(pose.rest is not None for pose in poses)
    np.testing.assert_allclose(poses[0].rest.vertices, poses[1].rest.vertices)
    assert np.abs(poses[1].mesh.vertices - poses[1].rest.vertices).max() > 0.5
    assert reader.read_objects(bpy.context, group([limbed("Alone")]))[0].rest is None


# Limits


def test_a_job_above_the_limit_is_refused_with_an_estimate():
    settings = bpy.context.scene.wks_segment
    settings.limit_minutes, settings.n_eigenpairs = 0.1, 1000
    select(*limbed_poses(0.0, 0.1, 0.2, 0.3, 0.4, 0.5))
    said = reason(OPS.learn)
    assert "6 poses of up to 642 vertices take about" in said
    assert "allowed are 0.1 minutes" in said
    settings.limit_minutes, settings.limit_memory = 10, 0.1
    assert "allowed are 10.0 minutes and 0.1 GB" in reason(OPS.learn)


def test_a_confirmed_job_goes_on():
    bpy.context.scene.wks_segment.limit_memory = 0.001
    select(limbed())
    assert "of memory; allowed are" in reason(OPS.learn)
    assert OPS.learn(confirmed=True) == {"FINISHED"}
    assert "of memory; allowed are" in reason(OPS.apply)
    assert OPS.apply(confirmed=True) == {"FINISHED"}


# Undo, and reopening


@pytest.mark.parametrize("name", ["learn", "apply", "clear"])
def test_every_operator_can_be_undone_and_survives_saving(name, tmp_path):
    obj = limbed_rigged("Walker")
    select(obj)
    settings = bpy.context.scene.wks_segment
    settings.write_materials = True
    if name != "learn":
        OPS.learn()
    bpy.ops.ed.undo_push(message="before")
    before = snapshot(obj.data)
    getattr(OPS, name)()
    after = snapshot(bpy.data.meshes["Walker"])
    path = tmp_path / "after.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True)
    bpy.ops.ed.undo_push(message="after")
    assert bpy.ops.ed.undo() == {"FINISHED"}
    assert not changes(before, snapshot(bpy.data.meshes["Walker"]))
    bpy.ops.wm.open_mainfile(filepath=str(path))
    assert not changes(after, snapshot(bpy.data.meshes["Walker"]))
