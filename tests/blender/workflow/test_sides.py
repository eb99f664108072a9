"""Left and right: told apart where the character is at rest, named and colored, on request only."""

import bpy
import numpy as np
import pytest
from builders import changes, coordinates, labels_of, limbed, numbers, read_labels, scene_snapshot, select, snapshot
from mathutils import Matrix

from wks_segment.blender.cli import creature as builder
from wks_segment.blender.cli import demo_scene
from wks_segment.blender.outputs.labels import clear_labels, write_labels
from wks_segment.blender.outputs.options import OutputOptions
from wks_segment.blender.parts import part_ids
from wks_segment.blender.parts.palette import sided_palette
from wks_segment.blender.scene.characters import Character
from wks_segment.blender.workflow.describing import Run
from wks_segment.blender.workflow.report import Report

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment
QUICK = ("--eigenpairs", 60, "--energies", 40, "--segments", 6)
ON_SIDES = ("paw", "ball", "foot", "heel")
ALONE = ("nose", "snout", "ear_tip.L", "ear_tip.R", "neck", "waist", "tail_3", "tail_6")
"""Bones of segments in the middle: the ears are part of the head, which has no side."""
NO_SIDES = "No segment has parts on both sides"
NOT_IN_PAPER = "Left and right are not told apart with the method of the paper: both sides are one part"


@pytest.fixture
def creature(settings, monkeypatch):
    """The creature of the demo, coarse, its walk to be learned from with two sides."""
    monkeypatch.setattr(builder, "SUBDIVISIONS", 1)
    obj = builder.build_creature(bpy.context.scene)
    settings.source, settings.pose_count, settings.sides = "FRAMES", 4, "two"
    settings.n_segments, settings.n_eigenpairs, settings.n_energies = 6, 60, 40
    select(obj)
    return obj


LEARNED = {}


@pytest.fixture
def learned(creature, settings):
    """The creature with its labels. The model is learned once."""
    if not LEARNED:
        assert OPS.learn() == {"FINISHED"}
        LEARNED["model"] = settings.model
    settings.model = LEARNED["model"]
    bpy.context.scene.frame_set(15)
    assert OPS.apply() == {"FINISHED"}
    return creature


def polygons_at(obj, bone):
    """Whether each polygon moves with a bone."""
    weights = weights_of(obj)
    names = [group.name for group in obj.vertex_groups if not group.name.startswith("WKS")]
    main = np.argmax([weights[name] for name in names], axis=0)
    return np.array([names[main[polygon.vertices[0]]] == bone for polygon in obj.data.polygons])


def weights_of(obj):
    """(n,) weights of the vertices in each group, by name."""
    weights = np.zeros((len(obj.vertex_groups), len(obj.data.vertices)))
    for vertex in obj.data.vertices:
        for member in vertex.groups:
            weights[member.group, vertex.index] = member.weight
    return {group.name: weights[group.index] for group in obj.vertex_groups}


def ours(obj):
    return {name: weights for name, weights in weights_of(obj).items() if name.startswith("WKS")}


def sides_are_right(obj, left=1, right=2):
    """What bones are named is where they are at rest."""
    sides = part_ids.sides_of(labels_of(obj))
    for bone in ON_SIDES:
        assert set(sides[polygons_at(obj, f"{bone}.L")]) == {left}, bone
        assert set(sides[polygons_at(obj, f"{bone}.R")]) == {right}, bone
    for bone in ALONE:
        assert set(sides[polygons_at(obj, bone)]) == {0}, bone
    return True


# Numbers and names


def test_part_numbers_encode_segment_and_side():
    numbered = part_ids.from_segments(np.array([2, 2, 2, 0, -1]), np.array([0, 1, -1, 1, 0]))
    assert numbered.tolist() == [2, 1002, 2002, 1000, -1]
    assert part_ids.segments_of(numbered[:4]).tolist() == [2, 2, 2, 0]
    assert part_ids.sides_of(numbered[:4]).tolist() == [0, 1, 2, 1]
    names = [part_ids.default_name(part) for part in numbered[:4].tolist()]
    assert names == ["Segment 3", "Segment 3.L", "Segment 3.R", "Segment 1.L"]


def test_blender_recognizes_side_suffixes():
    assert bpy.utils.flip_name(part_ids.default_name(1002)) == part_ids.default_name(2002)


def test_parts_are_sorted_by_segment():
    assert part_ids.unique_parts(np.array([2001, 1, 2000, 5, 1001, 1])) == [2000, 1, 1001, 2001, 5]


# Learn and Segment


def test_left_matches_left_bones_and_central_parts_have_no_side(creature):
    assert OPS.learn() == {"FINISHED"}
    assert sides_are_right(creature)
    # Legs and tail are segments of their own.
    places = [part_ids.segments_of(labels_of(creature)[polygons_at(creature, bone)]) for bone in ("foot.L", "tail_6")]
    assert not set(places[0]) & set(places[1])


def test_both_sides_are_one_part_by_default(learned, settings):
    sided = labels_of(learned)
    settings.property_unset("sides")
    OPS.apply()
    np.testing.assert_array_equal(labels_of(learned), part_ids.segments_of(sided))
    assert sided.max() > labels_of(learned).max() == 5


def test_left_is_told_at_rest_for_turned_characters(creature):
    rig = creature.parent
    rig.rotation_euler, rig.location = (0.5, 0.2, 3.0), (5, 0, 1)
    root = rig.pose.bones["pelvis"]
    root.matrix = Matrix.Rotation(np.pi, 4, "Z") @ root.matrix
    OPS.learn()
    assert sides_are_right(creature)


@pytest.mark.parametrize(("scale", "left"), [((1, 1, 1), 1), ((-1, 1, 1), 2)])
def test_left_of_an_object_without_a_rig(creature, settings, scale, left):
    statues = []
    for frame in (5, 20, 35, 50):
        bpy.context.scene.frame_set(frame)
        posed = creature.evaluated_get(bpy.context.evaluated_depsgraph_get())
        statue = bpy.data.objects.new("Statue", bpy.data.meshes.new_from_object(posed))
        bpy.context.scene.collection.objects.link(statue)
        statue.rotation_euler, statue.scale = (0, 0, 2.5), scale
        for group in creature.vertex_groups:
            statue.vertex_groups.new(name=group.name)
        statues.append(statue)
    settings.source, settings.n_eigenpairs = "OBJECTS", 150
    select(*statues)
    OPS.learn()
    assert all(sides_are_right(statue, left, 3 - left) for statue in statues)


def test_masked_faces_have_the_side_of_their_neighbors(creature):
    weights = weights_of(creature)
    paws = np.maximum(weights["paw.L"], weights["paw.R"]) > 0.5
    creature.vertex_groups.new(name="Hidden").add(np.flatnonzero(paws).tolist(), 1.0, "REPLACE")
    mask = creature.modifiers.new("Mask", "MASK")
    mask.vertex_group, mask.invert_vertex_group = "Hidden", True
    OPS.learn()
    hidden = np.array([paws[list(polygon.vertices)].any() for polygon in creature.data.polygons])
    left = np.array([polygon.center.x > 0 for polygon in creature.data.polygons])
    sides = part_ids.sides_of(labels_of(creature))
    assert hidden.sum() > 40
    assert set(sides[hidden & left]) == {1}
    assert set(sides[hidden & ~left]) == {2}


def test_report_counts_segments_and_parts(creature, settings, printed):
    printed()
    OPS.learn()
    assert "6 segments in 8 parts" in settings.model_summary
    assert "6 segments in 8 parts" in printed().out


# What has no sides


def test_asymmetric_character_has_no_sides(settings, printed):
    settings.sides = "two"
    obj = limbed()
    select(obj)
    printed()
    assert OPS.learn() == {"FINISHED"}
    assert f"Warning: {NO_SIDES}: does X point to the character's left" in printed().out
    assert labels_of(obj).max() < 4


def test_paper_method_has_no_sides_and_warns(creature, settings, printed):
    settings.preset = "paper"
    printed()
    assert OPS.learn() == {"FINISHED"}
    assert f"Warning: {NOT_IN_PAPER}" in printed().out
    assert labels_of(creature).max() < 6


# Apply to Selected


def test_loaded_model_gives_the_same_sides_on_another_pose_and_meshing(learned, settings, monkeypatch, tmp_path):
    path = tmp_path / "model.json"
    OPS.save_model(filepath=str(path))
    settings.model = ""
    OPS.load_model(filepath=str(path))
    known = labels_of(learned)
    monkeypatch.setattr(builder, "SUBDIVISIONS", 2)
    finer = builder.build_creature(bpy.context.scene)
    # Which way it stands says nothing: the model knows left from right.
    finer.parent.rotation_euler.z = 2.5
    bpy.context.scene.frame_set(40)
    select(finer)
    assert OPS.apply() == {"FINISHED"}
    assert sides_are_right(finer)
    for bone in {*ALONE, "foot.L", "paw.R"} - {"waist"}:  # where the torso is cut
        commonest = [np.bincount(labels).argmax() for labels in (
            labels_of(finer)[polygons_at(finer, bone)], known[polygons_at(learned, bone)]
        )]  # fmt: skip
        assert commonest[0] == commonest[1], bone


# Outputs


def test_colors_of_left_and_right_are_written(learned):
    corners = numbers(learned.data, "wks_segment_color", "color_srgb", 4)[:, :3]
    labels = np.repeat(labels_of(learned), [len(polygon.vertices) for polygon in learned.data.polygons])
    expected = sided_palette()[labels // 1000, labels % 1000]
    np.testing.assert_allclose(corners, expected, atol=1 / 255)
    assert len(np.unique(corners, axis=0)) == 8


def test_materials_are_sorted_by_segment_and_shared():
    meshes = [limbed(name).data for name in ("First", "Second")]
    labels = np.resize([2001, 1, 0, 1001, 7], len(meshes[0].polygons))
    before = snapshot(meshes[0])
    for mesh in meshes:
        write_labels(mesh, labels, OutputOptions(materials=True))
    names = ["Segment 1", "Segment 2", "Segment 2.L", "Segment 2.R", "Segment 8"]
    assert [material.name for material in meshes[0].materials] == names
    assert list(meshes[0].materials) == list(meshes[1].materials)
    for polygon, label in zip(meshes[0].polygons, labels.tolist(), strict=True):
        assert meshes[0].materials[polygon.material_index].name == part_ids.default_name(label)
    linear = np.array(bpy.data.materials["Segment 2.L"].diffuse_color[:3])
    srgb = np.where(linear < 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    np.testing.assert_allclose(srgb, sided_palette()[1, 1], atol=1e-3)
    for mesh in meshes:
        clear_labels(mesh)
    assert not changes(before, snapshot(meshes[0]))
    assert not len(bpy.data.materials)


def test_vertices_get_the_part_of_most_adjacent_faces():
    mesh = limbed().data
    height = np.array([polygon.center.z for polygon in mesh.polygons])
    write_labels(mesh, np.where(height > 0.3, 2003, np.where(height > -0.3, 1003, 3)))
    z, found = coordinates(mesh)[:, 2], numbers(mesh, "wks_segment_vertex")
    assert set(found) == {3, 1003, 2003}
    assert (found[z > 0.6] == 2003).all()
    assert (found[z < -0.6] == 3).all()


def test_hard_groups_have_one_side(learned, settings):
    settings.vertex_groups = "hard"
    OPS.apply()
    groups, labels = ours(learned), labels_of(learned)
    assert list(groups) == [f"WKS {part_ids.default_name(part)}" for part in part_ids.unique_parts(labels)]
    assert {"WKS Segment 1", "WKS Segment 3.L", "WKS Segment 3.R"} < set(groups)
    for part in part_ids.unique_parts(labels):
        corners = [
            polygon.vertices for polygon, label in zip(learned.data.polygons, labels, strict=True) if label == part
        ]
        members = np.flatnonzero(groups[f"WKS {part_ids.default_name(part)}"])
        np.testing.assert_array_equal(members, np.unique(np.concatenate(corners)))


def test_soft_weights_of_parts_sum_to_those_of_the_segment(learned, settings):
    settings.vertex_groups = "soft"
    OPS.apply()
    two = ours(learned)
    settings.sides = "one"
    OPS.apply()
    one = ours(learned)
    assert len(two) == len(one) + 2 == 8
    np.testing.assert_allclose(sum(two.values()), 1, atol=1e-6)
    for name, weights in one.items():
        of_parts = [two[part] for part in two if part.removesuffix(".L").removesuffix(".R") == name]
        np.testing.assert_allclose(sum(of_parts), weights, atol=1e-6)
    x = coordinates(learned.data)[:, 0]
    beside = [name for name in one if name not in two]  # nothing of them is in the middle
    assert beside
    for name in beside:
        left, right = two[f"{name}.L"], two[f"{name}.R"]
        assert left.max() > 0.9 < right.max(), name
        # Where two parts of a segment meet near the middle, a soft weight reaches a vertex across it.
        assert left[x < 0].sum() < 0.01 * left.sum(), name
        assert right[x > 0].sum() < 0.01 * right.sum(), name


@pytest.mark.parametrize("groups", ["hard", "soft"])
def test_clear_restores_everything(learned, settings, groups):
    OPS.clear()
    before, own = scene_snapshot(), weights_of(learned)
    settings.write_materials, settings.vertex_groups = True, groups
    OPS.apply()
    assert len(ours(learned)) == len(learned.data.materials) == 8
    assert OPS.clear() == {"FINISHED"}
    assert not changes(before, scene_snapshot())
    assert list(weights_of(learned)) == list(own)
    np.testing.assert_array_equal(list(weights_of(learned).values()), list(own.values()))


def test_undo_restores_everything(learned):
    OPS.clear()
    bpy.ops.ed.undo_push(message="before")
    before = snapshot(bpy.data.meshes["Creature"])
    OPS.apply()
    written = labels_of(bpy.data.objects["Creature"])
    bpy.ops.ed.undo_push(message="applied")
    assert bpy.ops.ed.undo() == {"FINISHED"}
    assert not changes(before, snapshot(bpy.data.meshes["Creature"]))
    assert read_labels(bpy.data.meshes["Creature"]) is None
    assert bpy.ops.ed.redo() == {"FINISHED"}
    np.testing.assert_array_equal(labels_of(bpy.data.objects["Creature"]), written)
    assert written.max() > 2000


def test_demo_measures_sides(creature, settings, tmp_path, needs_rendering):
    demo = demo_scene.Demo(Character((creature,)), tmp_path / "walk", 4, 1)
    result = demo.run(bpy.context, settings, Run(Report([])))
    assert (result["segments"], len(result["parts"])) == (6, len(np.unique(labels_of(creature))))
    assert result["agreement"] > 0.8
    assert sides_are_right(creature)


def test_agreement_counts_swapped_sides_as_wrong():
    labels = [np.array([0, 1002, 2002])] * 2 + [np.array([0, 2002, 2002])]
    assert demo_scene.agreements(labels, [True, True, False], [np.array([1.0, 1.0, 2.0])] * 3) == [1.0, 1.0, 0.75]


# The command line


@pytest.fixture
def file(creature, tmp_path):
    """The creature, in a scene whose settings ask for two sides."""
    path = tmp_path / "creature.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True)
    return path


def opened(path):
    bpy.ops.wm.open_mainfile(filepath=str(path))
    return bpy.data.objects["Creature"]


def test_segment_and_apply_commands_write_sides(command, file, tmp_path):
    output, model = tmp_path / "out.blend", tmp_path / "model.json"
    segment = ("segment", file, "--frames", 4, *QUICK, "--model", model, "--output", output)
    done = command(*segment, "--sides", "two", "--materials", "--json")
    assert done.code == 0, done
    found = done.result["parts"]
    assert (done.result["segments"], len(found), done.result["warnings"]) == (6, 8, [])
    assert list(found.items())[:3] == [("Segment 1", 0), ("Segment 2", 1), ("Segment 3.L", 1002)]
    obj = opened(output)
    assert sides_are_right(obj)
    assert [material.name for material in obj.data.materials] == list(found)
    assert sorted(found.values()) == np.unique(labels_of(obj)).tolist()

    done = command("apply", file, "--frames", 4, "--model", model, "--output", output, "--sides", "two")
    assert "6 segments in 8 parts" in done.out
    assert sides_are_right(opened(output))

    done = command(*segment, "--json")
    assert list(done.result["parts"].values()) == [0, 1, 2, 3, 4, 5], "the file's own setting was taken"


def test_command_warns_of_the_paper_method(command, file, tmp_path):
    options = ("--preset", "paper", "--sides", "two", "--output", tmp_path / "out.blend", "--json")
    done = command("segment", file, "--frames", 4, *QUICK, *options)
    assert done.code == 0, done
    assert done.result["warnings"] == [NOT_IN_PAPER]
    assert len(done.result["parts"]) == done.result["segments"]


def test_wrong_value_of_the_sides_option(command, file, tmp_path):
    done = command("segment", file, "--output", tmp_path / "out.blend", "--sides", "three")
    assert done.code == 2
    assert "--sides" in done.err
    assert command("learn", file, "--model", tmp_path / "m.json", "--sides", "two").code == 2
