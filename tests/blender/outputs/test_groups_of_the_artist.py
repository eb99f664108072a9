"""Vertex groups of the artist stay as they are; ours are replaced by new labels and removed by Clear."""

import bpy
import numpy as np
import pytest
from builders import (
    changes,
    limbed,
    numbers,
    scene_snapshot,
    select,
)
from group_checks import groups_of, learned, ours, weights_of

from wks_segment.blender.outputs.labels import clear_labels

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment


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


def test_the_artists_active_group_stays_active_if_added_after_ours(settings, rigged):
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


def test_our_active_group_stays_active_until_it_is_removed(settings, rigged):
    learned(settings, "soft", rigged)
    rigged.vertex_groups.active_index = rigged.vertex_groups["WKS Segment 3"].index
    OPS.learn()
    assert rigged.vertex_groups.active.name == "WKS Segment 3"
    OPS.clear()
    assert rigged.vertex_groups.active.name == "limb"


def test_our_first_group_is_active_if_there_was_none(settings):
    obj = limbed()
    learned(settings, "soft", obj)
    assert obj.vertex_groups.active.name == "WKS Segment 1"
    OPS.clear()
    assert obj.vertex_groups.active_index == -1


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


def test_our_groups_are_recognized_after_saving_and_renaming(settings, rigged, tmp_path):
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


def test_clearing_a_copy_leaves_the_original(settings):
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
    with pytest.raises(RuntimeError, match="nothing to clear"):
        OPS.clear()
    with pytest.raises(RuntimeError, match="linked from another file"):
        OPS.learn()
    assert len(before) == 4
    assert groups_of(linked) == before


def test_undo_restores_the_groups(settings, rigged):
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


def test_groups_stay_if_learning_is_refused(settings):
    obj = limbed()
    learned(settings, "soft", obj)
    obj.modifiers.new("Remesh", "REMESH")
    before, groups = scene_snapshot(), groups_of(obj)
    with pytest.raises(RuntimeError, match="modifier"):
        OPS.learn()
    assert not changes(before, scene_snapshot())
    assert groups_of(obj) == groups
