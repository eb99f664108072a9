"""Simulations that were played and not baked keep their frames, whatever is asked for."""

import contextlib
from itertools import pairwise

import bpy
import numpy as np
import pytest
from builders import coordinates, limbed, limbed_rigged, refuses, rig, select
from painted_objects import stripes

from wks_segment.blender.outputs.labels import write_labels
from wks_segment.blender.outputs.origin import Origin, enter_origin
from wks_segment.blender.outputs.overrides import keep_by_hand
from wks_segment.blender.parts.part_style import SetNotes
from wks_segment.blender.scene import poses as reader
from wks_segment.blender.scene.characters import Character
from wks_segment.blender.workflow import segment_list
from wks_segment.blender.workflow.live_session import session_of

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment
LEARN = OPS.learn
LAST = 8


def play():
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, LAST
    for frame in range(1, LAST + 1):
        scene.frame_set(frame)


def simulated(kind="CLOTH", subdivided=True, name="Skirt"):
    obj = limbed(name, subdivisions=3)
    obj.modifiers.new("Simulation", kind)
    if subdivided:
        obj.modifiers.new("Subdivision", "SUBSURF").levels = 1
    return obj


def cache_of(obj):
    return obj.modifiers["Simulation"].point_cache


def seen(obj):
    evaluated = obj.evaluated_get(bpy.context.evaluated_depsgraph_get())
    places = coordinates(evaluated.to_mesh())
    evaluated.to_mesh_clear()
    return places


def zone_tree():
    """Nodes with a simulation zone that lifts a mesh by 0.1 in each frame."""
    tree = bpy.data.node_groups.new("Lift", "GeometryNodeTree")
    for side in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=side, socket_type="NodeSocketGeometry")
    start, end, move = (
        tree.nodes.new(f"GeometryNode{kind}") for kind in ("SimulationInput", "SimulationOutput", "SetPosition")
    )
    start.pair_with_output(end)
    move.inputs["Offset"].default_value = (0, 0, 0.1)
    chain = [tree.nodes.new("NodeGroupInput"), start, move, end, tree.nodes.new("NodeGroupOutput")]
    for one, other in pairwise(chain):
        out = next(socket for socket in one.outputs if socket.type == "GEOMETRY")
        tree.links.new(out, next(socket for socket in other.inputs if socket.type == "GEOMETRY"))
    return tree


@pytest.mark.parametrize("kind", ["CLOTH", "SOFT_BODY"])
def test_frames_are_read_from_the_cache_and_it_stays(kind):
    obj = simulated(kind)
    play()
    expected = {}
    for frame in (3, LAST):
        bpy.context.scene.frame_set(frame)
        expected[frame] = seen(obj)
    assert np.abs(expected[3] - expected[LAST]).max() > 0.01, "nothing moves: the test is void"
    before = cache_of(obj).info
    names = set(bpy.data.objects.keys()), set(bpy.data.scenes.keys()), set(bpy.data.meshes.keys())
    poses = reader.read_frames(bpy.context, Character((obj,)), [3, LAST])
    for pose, frame in zip(poses, (3, LAST), strict=True):
        np.testing.assert_allclose(pose.mesh.vertices, expected[frame], atol=1e-6)
        assert np.bincount(pose.polygon_of, minlength=len(obj.data.polygons)).tolist() == [6] * len(obj.data.polygons)
    assert cache_of(obj).info == before
    assert not cache_of(obj).is_outdated
    assert names == (set(bpy.data.objects.keys()), set(bpy.data.scenes.keys()), set(bpy.data.meshes.keys()))


@pytest.mark.parametrize("source", ["FRAMES", "OBJECTS"])
def test_a_played_simulation_is_to_be_baked_before_labels_are_written(settings, source):
    obj = simulated()
    play()
    bpy.context.scene.frame_set(5)
    before = cache_of(obj).info
    settings.source = source
    select(obj)
    refuses(LEARN, '"Simulation" of "Skirt" is not baked.*Bake it first')
    assert (cache_of(obj).info, bpy.context.scene.frame_current) == (before, 5)


def rename_and_recolor():
    """Not refused: the list changes, and the mesh gets names and colors with its next labels."""
    segment = bpy.context.scene.wks_segment.segments[0]
    segment.name, segment.color = "Arm", (1, 0, 0)


def transfer():
    source = limbed("Body", subdivisions=3)
    write_labels(source.data, stripes(source.data))
    select(source, bpy.data.objects["Skirt"])
    OPS.transfer()


def live():
    bpy.context.scene.wks_segment.smoothness = 2.0
    OPS.update()


CHANGES = {
    "learn": LEARN,
    "apply": lambda: OPS.apply(),
    "live": live,
    "clear": lambda: OPS.clear(),
    "merge": lambda: OPS.merge_segments(into=1),
    "restore": lambda: OPS.restore_segments(),
    "forget": lambda: OPS.forget_faces(),
    "rename and recolor": rename_and_recolor,
    "show": lambda: OPS.show_segments(),
    "select": lambda: OPS.select_segment(),
    "separate": lambda: OPS.separate(),
    "unwrap": lambda: OPS.unwrap(),
    "bake": lambda: OPS.bake(),
    "transfer": transfer,
    "segments from": lambda: OPS.segments_from(source="MATERIALS"),
}


@pytest.mark.parametrize("change", CHANGES)
def test_no_button_throws_frames_away(settings, change):
    obj = simulated("CLOTH")
    settings.bake_unwrap, settings.bake_size = True, 64
    settings.vertex_groups, settings.write_materials = "hard", True
    select(obj)
    LEARN()
    keep_by_hand(obj.data, np.where(np.arange(len(obj.data.polygons)) < 9, 2, -1))
    segment_list.fill(settings)
    obj.data.materials.append(bpy.data.materials.new("Velvet"))
    play()
    bpy.context.scene.frame_set(5)
    before = cache_of(obj).info
    assert before.startswith(f"{LAST} frames")
    with (
        contextlib.nullcontext()
        if change == "rename and recolor"
        else pytest.raises(RuntimeError, match="Bake it first")
    ):
        CHANGES[change]()
    bpy.context.view_layer.update()
    assert (cache_of(obj).info, cache_of(obj).is_outdated) == (before, False)
    assert bpy.context.mode == "OBJECT"


@pytest.mark.parametrize(("name", "value"), [("write_seams", True), ("palette", "maximal")])
def test_no_setting_of_outputs_throws_frames_away(settings, name, value):
    """They act at once on labels whose model is gone as well; the panel says why an output does not."""
    obj = simulated("CLOTH")
    select(obj)
    settings.keep_notes(SetNotes(), "gone/4")
    write_labels(obj.data, stripes(obj.data))
    enter_origin(obj.data, Origin("gone/4"))
    play()
    bpy.context.scene.frame_set(5)
    before = cache_of(obj).info
    assert before.startswith(f"{LAST} frames")
    setattr(settings, name, value)
    bpy.context.view_layer.update()
    assert (cache_of(obj).info, cache_of(obj).is_outdated) == (before, False)
    assert ("Bake it first" in session_of(bpy.context).message) == (name == "write_seams")


def with_particles(obj):
    obj.modifiers.new("Sparks", "PARTICLE_SYSTEM")
    return obj.particle_systems[0].point_cache


def with_rigid_body(obj):
    select(obj)
    bpy.ops.rigidbody.world_add()
    bpy.ops.rigidbody.object_add()
    return bpy.context.scene.rigidbody_world.point_cache


@pytest.mark.parametrize("source", ["FRAMES", "OBJECTS"])
@pytest.mark.parametrize("make", [with_particles, with_rigid_body])
def test_other_kinds_of_simulations_keep_their_frames(settings, make, source):
    obj = limbed("Body", subdivisions=3)
    cache = make(obj)
    play()
    before = cache.info
    assert before.startswith(f"{LAST} frames"), "nothing was simulated: the test is void"
    settings.source = source
    select(obj)
    refuses(LEARN, 'of "Body" is not baked.*Bake it first')
    bpy.context.view_layer.update()
    assert (cache.info, cache.is_outdated, bpy.context.scene.frame_current) == (before, False, LAST)


def test_an_outdated_simulation_is_no_reason(settings):
    obj = simulated()
    select(obj)
    LEARN()
    play()
    for mode in ("EDIT", "OBJECT"):
        bpy.ops.object.mode_set(mode=mode)
    assert cache_of(obj).is_outdated
    assert OPS.clear() == {"FINISHED"}


def test_a_simulation_that_was_not_played_has_one_pose_in_all_frames(settings):
    obj = simulated()
    settings.source = "FRAMES"
    select(obj)
    refuses(LEARN, "Bake it first")
    settings.source = "OBJECTS"
    assert LEARN() == {"FINISHED"}


def test_a_baked_simulation_is_learned_from(settings):
    obj = simulated()
    bpy.context.scene.frame_end = LAST
    cache_of(obj).frame_end = LAST
    bpy.ops.ptcache.bake_all(bake=True)
    settings.source, settings.pose_count = "FRAMES", 2
    settings.use_frame_range, settings.frame_first, settings.frame_last = True, 2, LAST
    select(obj)
    assert LEARN() == {"FINISHED"}
    assert "2 poses" in settings.model_summary


def test_a_simulation_that_hangs_on_the_character_keeps_its_frames(settings):
    cape = simulated(name="Cape", subdivided=False)
    armature = rig([cape])
    body = limbed("Body", subdivisions=3)
    body.parent = armature
    body.modifiers.new("Armature", "ARMATURE").object = armature
    flag = simulated(name="Flag", subdivided=False)
    play()
    before = cache_of(cape).info
    settings.source = "FRAMES"
    select(body)
    refuses(LEARN, 'of "Cape" is not baked')
    bpy.context.scene.frame_set(2)
    assert (cache_of(cape).info, cache_of(cape).is_outdated) == (before, False)
    bpy.data.objects.remove(cape)
    assert LEARN() == {"FINISHED"}
    bpy.context.scene.frame_set(2)
    assert (cache_of(flag).info, cache_of(flag).is_outdated) == (before, False)


@pytest.mark.parametrize("source", ["FRAMES", "OBJECTS"])
def test_a_simulation_zone_is_refused_before_its_state_is_lost(settings, source):
    obj = limbed("Balloon", subdivisions=3)
    obj.modifiers.new("Zone", "NODES").node_group = zone_tree()
    obj.modifiers.new("Subdivision", "SUBSURF").levels = 1
    play()
    before = seen(obj)
    assert np.abs(before[:, 2].min() - coordinates(obj.data)[:, 2].min()) > 0.5, "nothing moves: the test is void"
    settings.source = source
    select(obj)
    refuses(LEARN, '"Zone" of "Balloon" is not baked to disk')
    bpy.context.scene.frame_set(1)
    bpy.context.scene.frame_set(LAST)
    np.testing.assert_allclose(seen(obj), before, atol=1e-6)


def test_a_rig_without_simulations_has_its_rest_position():
    (pose,) = reader.read_frames(bpy.context, Character((limbed_rigged(),)), [11])
    assert pose.rest is not None
