"""Separate by Segments: separated objects look like the original, move with it, and go with Clear."""

from types import SimpleNamespace

import bpy
import numpy as np
import pytest
from builders import (
    changes,
    labels_of,
    limbed,
    limbed_keys,
    limbed_rigged,
    numbers,
    scene_snapshot,
    select,
)
from painted_objects import painted, stripes

from wks_segment.blender.operators import clear as clear_module
from wks_segment.blender.outputs.labels import write_labels
from wks_segment.blender.outputs.options import OutputOptions

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment


def faces_at(obj):
    """Sorted centers of an object's faces as they are seen, in world space."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    seen = obj.evaluated_get(depsgraph)
    centers = [seen.matrix_world @ polygon.center for polygon in seen.to_mesh().polygons]
    return np.array(sorted([tuple(np.round(center, 4)) for center in centers]))


def separated_from(obj):
    separated = [other for other in bpy.data.objects if "wks_segment_piece" in other]
    return [copy for copy in separated if copy["wks_segment_piece"]["of"] == obj]


@pytest.mark.parametrize("make", [limbed, limbed_rigged, lambda: limbed_keys(0.5)], ids=["plain", "rigged", "keyed"])
def test_separated_objects_look_like_the_original_and_move_with_it(settings, make):
    obj = make()
    painted(obj)
    obj.location = (1, 2, 3)
    body = obj.parent or obj
    write_labels(obj.data, stripes(obj.data), OutputOptions(materials=True))
    select(obj)
    assert OPS.separate() == {"FINISHED"}
    separated = separated_from(obj)
    assert sorted(copy.name for copy in separated) == [f"Segment {i}" for i in range(1, 5)]
    assert obj.hide_get()
    assert obj.hide_render
    assert not obj.select_get()
    assert all(copy.select_get() and copy.parent == body for copy in separated)
    for frame, location in ((1, (1, 2, 3)), (11, (5, 0, 0))):
        bpy.context.scene.frame_set(frame)
        obj.location = location
        if obj.data.shape_keys:
            for other in (obj, *separated):
                other.data.shape_keys.key_blocks[1].value = frame / 11
        for copy in separated if obj.parent else []:
            copy.location = location
        bpy.context.view_layer.update()
        together = sorted(map(tuple, np.concatenate([faces_at(copy) for copy in separated]).tolist()))
        np.testing.assert_allclose(together, faces_at(obj), atol=2e-4)
    for copy in separated:
        assert [m.name for m in copy.data.materials] == [m.name for m in obj.data.materials]
        assert list(copy.data.uv_layers.keys()) == ["First", "Second"]
        assert copy.vertex_groups.keys() == obj.vertex_groups.keys()
        assert [m.type for m in copy.modifiers] == [m.type for m in obj.modifiers]
        assert len(np.unique(labels_of(copy))) == 1


def test_separated_objects_keep_uvs_and_material_of_each_face(settings):
    obj = painted(limbed())
    labels = stripes(obj.data)
    write_labels(obj.data, labels)
    select(obj)
    OPS.separate()
    uvs = numbers(obj.data, "First", "vector", 2).reshape(-1, 3, 2)
    for copy in separated_from(obj):
        (part,) = np.unique(labels_of(copy))
        np.testing.assert_array_equal(numbers(copy.data, "First", "vector", 2).reshape(-1, 3, 2), uvs[labels == part])
        np.testing.assert_array_equal(
            numbers(copy.data, "material_index"), numbers(obj.data, "material_index")[labels == part]
        )


@pytest.mark.parametrize("which", ["separated", "original"])
def test_clear_restores_the_original(labeled, which):
    before = scene_snapshot()
    OPS.separate()
    if which == "original":
        labeled.hide_set(False)
        select(labeled)
    OPS.clear()
    clean = scene_snapshot()
    write_labels(labeled.data, stripes(labeled.data))
    assert not changes(before, scene_snapshot())
    assert list(clean["objects"]) == ["Limbed"]


def test_a_separated_object_that_was_changed_stays(labeled, printed):
    OPS.separate()
    first, second = separated_from(labeled)[:2]
    first.data.vertices[0].co.x += 0.5
    second.name = "Arm"
    printed()
    OPS.clear()
    assert 'You have changed these separated objects, they stay: "Arm", "Segment 1"' in printed().out
    assert sorted(obj.name for obj in bpy.data.objects) == ["Arm", "Limbed", "Segment 1"]
    assert not separated_from(labeled)


def question_of_clear(monkeypatch, obj):
    """What Clear asks in a window where one object is selected; None if it asks nothing."""
    asked = []
    monkeypatch.setattr(clear_module._report, "has_window", lambda context: True)
    manager = SimpleNamespace(invoke_confirm=lambda *_, **texts: asked.append(texts["message"]) or {"RUNNING_MODAL"})
    window = SimpleNamespace(
        window_manager=manager, selected_objects=[obj], visible_objects=[obj], scene=bpy.context.scene
    )
    operator = SimpleNamespace(execute=lambda context: {"FINISHED"})
    clear_module.WKS_SEGMENT_OT_clear.invoke(operator, window, None)
    return asked[0] if asked else None


def test_clear_says_which_separated_objects_it_takes(labeled, monkeypatch):
    assert question_of_clear(monkeypatch, labeled) is None
    OPS.separate()
    first, second = separated_from(labeled)[:2]
    told = 'All 4 objects that were separated from "Limbed" are removed, and it is shown again'
    assert question_of_clear(monkeypatch, first) == question_of_clear(monkeypatch, labeled) == told
    second.data.vertices[0].co.x += 0.5
    assert question_of_clear(monkeypatch, first) == (
        '3 objects that were separated from "Limbed" are removed, and it is shown again; those that you have changed '
        f'stay: "{second.name}"'
    )


def test_an_original_is_not_separated_twice(labeled):
    OPS.separate()
    with pytest.raises(RuntimeError, match="is separated already"):
        OPS.separate()


def test_separated_objects_are_removed_though_the_original_is_not_in_the_view_layer(labeled):
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
