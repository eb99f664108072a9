"""Vertex groups: which are written, and which weights they have."""

import bpy
import numpy as np
import pytest
from builders import (
    labels_of,
    limbed,
    limbed_poses,
    limbed_rigged,
    numbers,
    select,
)
from group_checks import faces_around, learned, ours, read, weights_of

from wks_segment.blender.outputs.labels import write_labels
from wks_segment.blender.outputs.vertex_weights import LEAST_WEIGHT
from wks_segment.blender.scene import poses as reader
from wks_segment.blender.scene.characters import Character
from wks_segment.blender.workflow import describing, pipeline
from wks_segment.blender.workflow.describing import Run
from wks_segment.blender.workflow.report import Report

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment
QUICK = ("--eigenpairs", 30, "--energies", 40, "--segments", 4)


def test_no_groups_by_default(settings):
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
    described = describing.describe(model, poses, Run(Report([])))
    each = [model.predict_soft(of_pose) for of_pose in described]
    components = [int(name.split()[-1]) - 1 for name in ours(rigged)]

    def cut(posteriors):
        kept = np.where(posteriors < LEAST_WEIGHT, 0, posteriors)
        return (kept / kept.sum(axis=1, keepdims=True))[:, components]

    got = weights_of(rigged)
    np.testing.assert_allclose(got, cut(np.mean(each, axis=0)), atol=1e-5)
    assert min(np.abs(got - cut(one)).max() for one in each) > 0.05


def test_smoothness_smooths_the_soft_weights(settings):
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
            (signature,) = describing.describe(model, [pose], Run(Report([])))
            plain = model.predict_proba(signature)
            np.testing.assert_allclose(weights[plain >= 0.99], plain[plain >= 0.99], atol=0.011)
            np.testing.assert_array_equal(weights > 0, plain >= LEAST_WEIGHT)
    assert steps[0] > steps[1] > 1.1 * steps[2]


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


def test_a_modifier_uses_new_weights_of_our_groups_at_once():
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
        # An object may be one segment as a whole.
        assert set(np.unique(hard)) <= {0, 1}
        assert hard.any(axis=1).all()
    learned(settings, "soft", body, child)
    for obj in (body, child):
        weights = weights_of(obj)
        np.testing.assert_allclose(weights.sum(axis=1), 1, atol=1e-6)
        columns = np.array([int(name.split()[-1]) - 1 for name in ours(obj)])
        assert (columns[weights.argmax(axis=1)] == numbers(obj.data, "wks_segment_vertex")).mean() > 0.8
    assert body.vertex_groups.keys()[:2] == ["root", "limb"]


def test_no_temporary_object_stays(settings):
    obj = limbed()
    learned(settings, "soft", obj)
    OPS.clear()
    assert bpy.data.objects[:] == [obj]
    assert obj.data.users == 1


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


def test_segment_and_apply_write_the_chosen_groups(command, walker, tmp_path):
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


def test_a_wrong_value_of_the_option_is_refused(command, walker, tmp_path):
    done = command("segment", walker, "--output", tmp_path / "out.blend", "--vertex-groups", "fuzzy")
    assert done.code == 2
    assert "'none', 'hard', 'soft'" in done.err or "none, hard, soft" in done.err
    assert command("learn", walker, "--model", tmp_path / "m.json", "--vertex-groups", "soft").code == 2
