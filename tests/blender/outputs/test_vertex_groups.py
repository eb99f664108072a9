"""Vertex groups: what weights they hold, and that the artist's own stay as they are."""

from dataclasses import replace

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
    numbers,
    scene_snapshot,
    select,
)

from wks_segment.blender.outputs.labels import clear_labels, write_labels
from wks_segment.blender.outputs.vertex_weights import LEAST_WEIGHT, own_vertices, soft_weights
from wks_segment.blender.scene import poses as reader
from wks_segment.blender.scene.characters import Character
from wks_segment.blender.scene.mesh_arrays import Body
from wks_segment.blender.workflow import pipeline
from wks_segment.blender.workflow.pipeline import Run
from wks_segment.blender.workflow.report import Report
from wks_segment.core import PoseSegmentation, TriangleMesh
from wks_segment.core.progress import Progress

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment
QUICK = ("--eigenpairs", 30, "--energies", 40, "--segments", 4)


def groups_of(obj):
    """Vertex groups of an object: name, whether it is locked, and (n,) weights, NaN for vertices that are not in it."""
    weights = np.full((len(obj.vertex_groups), len(obj.data.vertices)), np.nan)
    for vertex in obj.data.vertices:
        for member in vertex.groups:
            weights[member.group, vertex.index] = member.weight
    return {group.name: (group.lock_weight, weights[group.index].tobytes()) for group in obj.vertex_groups}


def weights_of(obj, names=None):
    """(n, k) weights in the groups of these names, ours if not given; 0 for vertices that are not in one."""
    groups = groups_of(obj)
    names = [name for name in groups if name.startswith("WKS Segment")] if names is None else names
    return np.nan_to_num(np.stack([np.frombuffer(groups[name][1]) for name in names], axis=1))


def ours(obj):
    return [name for name in obj.vertex_groups.keys() if name.startswith("WKS Segment")]  # noqa: SIM118


def learned(settings, kind, *objects):
    settings.vertex_groups = kind
    select(*objects)
    assert OPS.learn() == {"FINISHED"}


def fitted(obj):
    """A model of 4 segments of an object as it is, and the pose."""
    (pose,) = reader.read_objects(bpy.context, [Character((obj,))])
    return PoseSegmentation(n_segments=4, n_eigenpairs=30, n_energies=40).fit([pose.mesh]), pose


def faces_around(mesh):
    """The faces of each vertex."""
    around = [[] for _ in mesh.vertices]
    for polygon in mesh.polygons:
        for vertex in polygon.vertices:
            around[vertex].append(polygon.index)
    return around


def read(obj):
    return reader.read_objects(bpy.context, [Character((obj,))])[0]


@pytest.fixture
def rigged(settings):
    """A character on an armature, with a locked and an active group of the artist, learned from by frames."""
    obj = limbed_rigged()
    obj.vertex_groups["root"].lock_weight = True
    obj.vertex_groups.new(name="Mask").add(range(0, 600, 7), 0.25, "REPLACE")
    obj.vertex_groups.active_index = 1
    settings.source, settings.pose_count = "FRAMES", 3
    return obj


# What is written


def test_no_groups_unless_asked_for(settings):
    obj = limbed()
    select(obj)
    OPS.learn()
    assert settings.vertex_groups == "none"
    assert not len(obj.vertex_groups)


def test_hard_groups_hold_every_vertex_of_the_faces_of_a_segment(settings):
    obj = limbed()
    learned(settings, "hard", obj)
    expected = np.zeros((len(obj.data.vertices), 4))
    for polygon, label in zip(obj.data.polygons, labels_of(obj), strict=True):
        expected[list(polygon.vertices), label] = 1
    assert ours(obj) == [f"WKS Segment {i}" for i in (1, 2, 3, 4)]
    np.testing.assert_array_equal(weights_of(obj), expected)
    assert (expected.sum(axis=1) == 2).any(), "no vertex is on a border"


def test_soft_weights_of_a_vertex_sum_to_one(settings):
    poses = limbed_poses(0.0, 0.3, 0.6)
    learned(settings, "soft", *poses)
    for obj in poses:
        weights = weights_of(obj)
        np.testing.assert_allclose(weights.sum(axis=1), 1, atol=1e-6)
        assert weights[weights > 0].min() >= LEAST_WEIGHT - 1e-6
        assert ((weights > 0.1) & (weights < 0.9)).any(), "all weights are hard"
        columns = [int(name.split()[-1]) - 1 for name in ours(obj)]
        largest = np.array(columns)[weights.argmax(axis=1)]
        # On a border most faces around a vertex can be of another segment than the vertex itself.
        inside = np.array([len(set(labels_of(obj)[faces])) == 1 for faces in faces_around(obj.data)])
        assert inside.mean() > 0.5
        assert (largest == numbers(obj.data, "wks_segment_vertex"))[inside].mean() > 0.95


def test_soft_weights_are_the_mean_over_the_poses(settings, rigged):
    learned(settings, "soft", rigged)
    model = pipeline.stored_model(settings)
    character = Character((rigged,))
    frames = reader.own_frames(bpy.context.scene, character, 3)
    poses = reader.read_frames(bpy.context, character, frames)
    described = pipeline.describe(model, poses, Run(Report([])))
    each = [model.predict_soft(of_pose) for of_pose in described]
    components = [int(name.split()[-1]) - 1 for name in ours(rigged)]

    def cut(posteriors):
        kept = np.where(posteriors < LEAST_WEIGHT, 0, posteriors)
        return (kept / kept.sum(axis=1, keepdims=True))[:, components]

    got = weights_of(rigged)
    np.testing.assert_allclose(got, cut(np.mean(each, axis=0)), atol=1e-5)
    assert min(np.abs(got - cut(one)).max() for one in each) > 0.05


def test_smoothness_reaches_the_soft_weights(settings):
    obj = limbed()
    steps = []
    edges = np.array([edge.vertices for edge in obj.data.edges])
    for smoothness in (0.0, 1.0, 4.0):
        settings.smoothness = smoothness
        learned(settings, "soft", obj)
        weights = weights_of(obj)
        steps.append(np.abs(weights[edges[:, 0]] - weights[edges[:, 1]]).sum())
        if smoothness == 0:
            pose, model = read(obj), pipeline.stored_model(settings)
            (signature,) = pipeline.describe(model, [pose], Run(Report([])))
            plain = model.predict_proba(signature)
            np.testing.assert_allclose(weights[plain >= 0.99], plain[plain >= 0.99], atol=0.011)
            np.testing.assert_array_equal(weights > 0, plain >= LEAST_WEIGHT)
    assert steps[0] > 1.1 * steps[1] > 1.1 * 1.1 * steps[2]


def test_apply_writes_soft_groups_to_an_unseen_pose(settings):
    first, unseen = limbed("First"), limbed("Unseen", 0.5)
    learned(settings, "soft", first)
    select(unseen)
    assert OPS.apply() == {"FINISHED"}
    np.testing.assert_allclose(weights_of(unseen).sum(axis=1), 1, atol=1e-6)
    assert ours(unseen) == ours(first)
    assert np.abs(weights_of(first) - weights_of(unseen)).mean() < 0.1


def test_only_segments_that_occur_get_a_group():
    mesh = limbed().data
    weights = np.zeros((len(mesh.vertices), 9))
    weights[:5, 2], weights[5:, 7] = 1, 0.5
    write_labels(mesh, np.zeros(len(mesh.polygons), dtype=int), weights=dict(enumerate(weights.T)))
    obj = bpy.data.objects["Limbed"]
    assert obj.vertex_groups.keys() == ["WKS Segment 3", "WKS Segment 8"]
    np.testing.assert_array_equal(weights_of(obj), weights[:, [2, 7]])


def test_modifier_that_uses_a_group_of_ours_sees_new_weights_at_once():
    obj = limbed()
    everywhere = np.ones(642)
    write_labels(obj.data, np.zeros(1280, dtype=int), weights={0: everywhere})
    obj.modifiers.new("Mask", "MASK").vertex_group = "WKS Segment 1"

    def shown():
        return len(obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).data.vertices)

    assert shown() == 642
    write_labels(obj.data, np.zeros(1280, dtype=int), weights={0: everywhere * (np.arange(642) < 600)})
    assert shown() == 600


@pytest.mark.parametrize("with_modifier", [(), (0,), (1,), (0, 1)])
def test_each_object_of_a_character_gets_its_own_weights(settings, with_modifier):
    body, child = limbed_rigged("Body"), limbed("Child", 0.4, subdivisions=3)
    child.parent = body.parent
    child.location.x = 6
    for i in with_modifier:
        (body, child)[i].modifiers.new("Solidify", "SOLIDIFY").thickness = 0.01
    learned(settings, "hard", body, child)
    assert "1 pose" in settings.model_summary, "they are not one character"
    for obj in (body, child):
        hard = weights_of(obj)
        assert set(np.unique(hard)) == {0, 1}
        assert hard.any(axis=1).all()
    learned(settings, "soft", body, child)
    for obj in (body, child):
        weights = weights_of(obj)
        np.testing.assert_allclose(weights.sum(axis=1), 1, atol=1e-6)
        columns = np.array([int(name.split()[-1]) - 1 for name in ours(obj)])
        assert (columns[weights.argmax(axis=1)] == numbers(obj.data, "wks_segment_vertex")).mean() > 0.8
    assert body.vertex_groups.keys()[:2] == ["root", "limb"]


def test_no_object_is_left_behind(settings):
    obj = limbed()
    learned(settings, "soft", obj)
    OPS.clear()
    assert bpy.data.objects[:] == [obj]
    assert obj.data.users == 1


# Vertices that the pose does not show one to one


def modified(kind, **options):
    obj = limbed()
    modifier = obj.modifiers.new("Modifier", kind)
    for name, value in options.items():
        setattr(modifier, name, value)
    return obj


@pytest.mark.parametrize(
    ("kind", "options", "same"),
    [
        ("CAST", {"factor": 0.3}, True),
        ("SUBSURF", {"levels": 0}, True),
        ("SUBSURF", {"show_viewport": False}, True),
        ("SUBSURF", {"levels": 1}, False),
        ("MIRROR", {}, False),
        ("SOLIDIFY", {"thickness": 0.1}, False),
    ],
)
def test_pose_knows_whether_its_vertices_are_the_artists(kind, options, same):
    pose = read(modified(kind, **options))
    assert pose.vertex_of.shape == (pose.mesh.n_vertices,)
    if same:
        np.testing.assert_array_equal(pose.vertex_of, np.arange(642))
    else:
        assert (pose.vertex_of == -1).all()


def test_the_corners_decide_not_the_kind_of_modifier():
    """Triangulate changes nothing of triangles, but splits a quad."""
    pose = read(modified("TRIANGULATE"))
    np.testing.assert_array_equal(pose.vertex_of, np.arange(642))
    quads = mesh_object([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [(0, 1, 2, 3)])
    quads.modifiers.new("Triangulate", "TRIANGULATE")
    assert (read(quads).vertex_of == -1).all()


@pytest.mark.parametrize(
    ("kind", "options"),
    [
        ("SUBSURF", {"levels": 1}),
        ("MIRROR", {"use_axis": (False, True, False)}),
        ("SOLIDIFY", {"thickness": 0.05}),
        ("EDGE_SPLIT", {"split_angle": 0.2}),
    ],
)
def test_soft_weights_through_modifiers_that_make_faces(settings, kind, options):
    obj = modified(kind, **options)
    learned(settings, "soft", obj)
    weights = weights_of(obj)
    np.testing.assert_allclose(weights.sum(axis=1), 1, atol=1e-6)
    columns = np.array([int(name.split()[-1]) - 1 for name in ours(obj)])
    assert (columns[weights.argmax(axis=1)] == numbers(obj.data, "wks_segment_vertex")).mean() > 0.9


def test_the_way_over_polygons_comes_close_to_that_over_vertices():
    model, pose = fitted(limbed())
    described = [model.describe(pose.mesh)]
    body = Body.of(pose.character)
    exact = soft_weights(model, [pose], described, body, Progress())
    over_polygons = soft_weights(model, [replace(pose, vertex_of=np.full(642, -1))], described, body, Progress())
    assert np.abs(exact - over_polygons).max() > 1e-3, "it is the same way"
    assert np.abs(exact - over_polygons).mean() < 0.05
    assert (exact.argmax(axis=1) == over_polygons.argmax(axis=1)).mean() > 0.95


def test_vertex_gets_the_mean_over_its_polygons_by_area():
    """Two faces, one three times as large, with values 0 and 4 all around, meet in an edge."""
    obj = mesh_object([(0, 0, 0), (0, 1, 0), (-1, 0, 0), (3, 0, 0), (9, 9, 9)], [(0, 1, 2), (0, 3, 1)])
    pose = read(obj)
    split = TriangleMesh(pose.mesh.vertices[pose.mesh.faces.ravel()], np.arange(6).reshape(2, 3))
    apart = replace(pose, mesh=split, vertex_of=np.full(6, -1))
    values = np.repeat(np.where(pose.polygon_of == 0, 0.0, 4.0), 3)[:, None]
    own, seen = own_vertices(apart, values, Body.of(pose.character))
    np.testing.assert_allclose(own[:, 0], [3, 3, 0, 4, 0])
    np.testing.assert_array_equal(seen, [True, True, True, True, False])


def test_vertices_that_are_masked_out_take_the_weights_next_to_them(settings):
    obj = limbed()
    high = [vertex.index for vertex in obj.data.vertices if vertex.co.x > 1.5]
    group = obj.vertex_groups.new(name="Hidden")
    group.add(high, 1.0, "REPLACE")
    mask = obj.modifiers.new("Mask", "MASK")
    mask.vertex_group, mask.invert_vertex_group = "Hidden", True
    assert read(obj).mesh.n_vertices < len(obj.data.vertices)
    learned(settings, "soft", obj)
    weights = weights_of(obj)
    np.testing.assert_allclose(weights.sum(axis=1), 1, atol=1e-6)
    seen = np.setdiff1d(np.arange(len(weights)), high)
    points = np.array([vertex.co for vertex in obj.data.vertices])
    tip = high[np.argmax(points[high, 0])]
    nearest = seen[np.linalg.norm(points[seen] - points[tip], axis=1).argmin()]
    # The ring at the cut is seen through the faces that are left, and may be nearer.
    assert np.abs(weights[tip] - weights[nearest]).sum() < 0.5


def test_vertex_without_a_face_has_weights_too(settings):
    obj = limbed()
    obj.data.vertices.add(1)
    obj.data.vertices[-1].co = (5, 0, 1)
    obj.data.update()
    learned(settings, "soft", obj)
    np.testing.assert_allclose(weights_of(obj).sum(axis=1), 1, atol=1e-6)
    learned(settings, "hard", obj)
    assert weights_of(obj)[-1].sum() == 0


# What is kept


@pytest.mark.parametrize("kind", ["hard", "soft"])
def test_groups_of_the_artist_stay_as_they_are(settings, rigged, kind):
    before = groups_of(rigged)
    for n_segments in (4, 3):
        settings.n_segments = n_segments
        learned(settings, kind, rigged)
        after = groups_of(rigged)
        assert rigged.vertex_groups.keys()[:3] == ["root", "limb", "Mask"]
        assert {name: after[name] for name in before} == before
        assert rigged.vertex_groups.active.name == "limb"
    OPS.clear()
    assert groups_of(rigged) == before
    assert rigged.vertex_groups.active_index == 1


def test_artists_group_and_attribute_with_our_names_survive(settings):
    obj = limbed()
    obj.vertex_groups.new(name="WKS Segment 1").add([3, 4], 0.5, "REPLACE")
    attribute = obj.data.attributes.new("WKS Segment 2", "FLOAT", "POINT")
    attribute.data.foreach_set("value", np.linspace(0, 1, 642, dtype=np.float32))
    before, values = groups_of(obj), numbers(obj.data, "WKS Segment 2")
    for _ in range(2):
        learned(settings, "hard", obj)
        assert obj.vertex_groups.keys() == [
            "WKS Segment 1", "WKS Segment 1.001", "WKS Segment 2.001", "WKS Segment 3", "WKS Segment 4",
        ]  # fmt: skip
        assert groups_of(obj)["WKS Segment 1"] == before["WKS Segment 1"]
    OPS.clear()
    assert groups_of(obj) == before
    np.testing.assert_array_equal(numbers(obj.data, "WKS Segment 2"), values)


def test_active_group_of_the_artist_stays_behind_ours_too(settings, rigged):
    learned(settings, "soft", rigged)
    rigged.vertex_groups.new(name="Late").add([0, 1, 2], 0.75, "REPLACE")
    rigged.vertex_groups.active_index = rigged.vertex_groups["Late"].index
    late = groups_of(rigged)["Late"]
    OPS.learn()
    assert groups_of(rigged)["Late"] == late
    assert rigged.vertex_groups.active.name == "Late"
    OPS.clear()
    assert groups_of(rigged)["Late"] == late
    assert rigged.vertex_groups.active.name == "Late"
    assert rigged.vertex_groups.keys() == ["root", "limb", "Mask", "Late"]


def test_one_of_ours_that_is_active_stays_active_until_it_goes(settings, rigged):
    learned(settings, "soft", rigged)
    rigged.vertex_groups.active_index = rigged.vertex_groups["WKS Segment 3"].index
    OPS.learn()
    assert rigged.vertex_groups.active.name == "WKS Segment 3"
    OPS.clear()
    assert rigged.vertex_groups.active.name == "limb"


def test_first_of_ours_is_active_where_there_was_no_group(settings):
    obj = limbed()
    learned(settings, "soft", obj)
    assert obj.vertex_groups.active.name == "WKS Segment 1"
    OPS.clear()
    assert obj.vertex_groups.active_index == -1


# Again, and Clear


def test_second_run_replaces_the_groups_of_the_first(settings):
    obj = limbed()
    settings.n_segments = 6
    learned(settings, "soft", obj)
    assert len(ours(obj)) == 6
    settings.n_segments = 3
    learned(settings, "soft", obj)
    assert obj.vertex_groups.keys() == [f"WKS Segment {i}" for i in (1, 2, 3)]
    twice = groups_of(obj)
    OPS.clear()
    assert not len(obj.vertex_groups)
    OPS.learn()
    assert groups_of(obj) == twice
    learned(settings, "none", obj)
    assert not len(obj.vertex_groups)


def test_ours_are_known_after_saving_and_renaming(settings, rigged, tmp_path):
    learned(settings, "soft", rigged)
    path = tmp_path / "scene.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.wm.open_mainfile(filepath=str(path))
    obj = bpy.data.objects["Walker"]
    assert len(ours(obj)) == 4
    obj.vertex_groups["Mask"].name = "Hair"
    obj.vertex_groups["WKS Segment 2"].name = "Head"
    head = groups_of(obj)["Head"]
    select(obj)
    OPS.apply()
    assert obj.vertex_groups.keys()[:4] == ["root", "limb", "Hair", "Head"]
    assert len(ours(obj)) == 4
    assert groups_of(obj)["Head"] == head, "what the artist has renamed is the artist's"
    OPS.clear()
    assert obj.vertex_groups.keys() == ["root", "limb", "Hair", "Head"]


def test_clear_works_after_the_artist_removed_a_group_of_ours(settings):
    obj = limbed()
    learned(settings, "hard", obj)
    obj.vertex_groups.remove(obj.vertex_groups["WKS Segment 2"])
    assert OPS.clear() == {"FINISHED"}
    assert not len(obj.vertex_groups)


def test_objects_that_share_a_mesh_share_the_groups(settings):
    first = limbed()
    twin = bpy.data.objects.new("Twin", first.data)
    bpy.context.scene.collection.objects.link(twin)
    first.vertex_groups.new(name="Mask").add([1, 2], 1.0, "REPLACE")
    learned(settings, "soft", first, twin)
    assert first.vertex_groups.keys() == ["Mask", *(f"WKS Segment {i}" for i in (1, 2, 3, 4))]
    assert groups_of(twin) == groups_of(first)
    np.testing.assert_allclose(weights_of(twin).sum(axis=1), 1, atol=1e-6)
    select(twin)
    OPS.clear()
    assert first.vertex_groups.keys() == twin.vertex_groups.keys() == ["Mask"]


def test_a_copy_is_cleared_by_itself(settings):
    obj = limbed()
    learned(settings, "hard", obj)
    before, copy = groups_of(obj), obj.copy()
    copy.data = obj.data.copy()
    clear_labels(copy.data)
    assert not len(copy.vertex_groups)
    assert groups_of(obj) == before


def test_linked_mesh_keeps_its_groups(settings, tmp_path):
    obj = limbed("Foreign")
    learned(settings, "hard", obj)
    path = tmp_path / "library.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True)
    bpy.data.objects.remove(obj)
    with bpy.data.libraries.load(str(path), link=True) as (source, target):
        target.objects = source.objects
    (linked,) = target.objects
    bpy.context.scene.collection.objects.link(linked)
    select(linked)
    before = groups_of(linked)
    OPS.clear()
    with pytest.raises(RuntimeError, match="linked from another file"):
        OPS.learn()
    assert len(before) == 4
    assert groups_of(linked) == before


def test_undo_gives_back_the_groups(settings, rigged):
    settings.vertex_groups = "soft"
    select(rigged)
    bpy.ops.ed.undo_push(message="before")
    before = groups_of(rigged)
    OPS.learn()
    written = groups_of(bpy.data.objects["Walker"])
    assert len(written) == 7
    bpy.ops.ed.undo_push(message="learned")
    assert bpy.ops.ed.undo() == {"FINISHED"}
    walker = bpy.data.objects["Walker"]
    assert groups_of(walker) == before
    assert walker.vertex_groups.active.name == "limb"
    assert bpy.ops.ed.redo() == {"FINISHED"}
    assert groups_of(bpy.data.objects["Walker"]) == written
    select(bpy.data.objects["Walker"])
    OPS.clear()
    bpy.ops.ed.undo_push(message="cleared")
    assert groups_of(bpy.data.objects["Walker"]) == before
    assert bpy.ops.ed.undo() == {"FINISHED"}
    assert groups_of(bpy.data.objects["Walker"]) == written


def test_a_refused_run_leaves_the_groups(settings):
    obj = limbed()
    learned(settings, "soft", obj)
    obj.modifiers.new("Remesh", "REMESH")
    before, groups = scene_snapshot(), groups_of(obj)
    with pytest.raises(RuntimeError, match="modifier"):
        OPS.learn()
    assert not changes(before, scene_snapshot())
    assert groups_of(obj) == groups


# The command line


@pytest.fixture
def walker(tmp_path, rigged, settings):
    """A file with the character, whose scene asks for hard groups."""
    settings.vertex_groups = "hard"
    path = tmp_path / "walker.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True)
    return path


def opened(path):
    bpy.ops.wm.open_mainfile(filepath=str(path))
    return bpy.data.objects["Walker"]


def test_segment_and_apply_write_the_groups_that_are_asked_for(command, walker, tmp_path):
    output, model = tmp_path / "out.blend", tmp_path / "model.json"
    segment = ("segment", walker, "--frames", 3, *QUICK, "--model", model, "--output", output)
    done = command(*segment, "--vertex-groups", "soft")
    assert done.code == 0, done
    obj = opened(output)
    assert obj.vertex_groups.keys() == ["root", "limb", "Mask", *(f"WKS Segment {i}" for i in (1, 2, 3, 4))]
    np.testing.assert_allclose(weights_of(obj).sum(axis=1), 1, atol=1e-6)
    soft = weights_of(obj)

    done = command("apply", walker, "--frames", 3, "--model", model, "--output", output, "--vertex-groups", "hard")
    assert done.code == 0, done
    hard = weights_of(opened(output))
    assert set(np.unique(hard)) == {0, 1}
    assert ((hard > 0) == (soft > 0.5)).mean() > 0.9

    assert command(*segment).code == 0
    assert ours(opened(output)) == [], "the file's own setting was taken"


def test_wrong_use_of_the_option(command, walker, tmp_path):
    done = command("segment", walker, "--output", tmp_path / "out.blend", "--vertex-groups", "fuzzy")
    assert done.code == 2
    assert "'none', 'hard', 'soft'" in done.err or "none, hard, soft" in done.err
    assert command("learn", walker, "--model", tmp_path / "m.json", "--vertex-groups", "soft").code == 2
