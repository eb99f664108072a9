"""Segments from face sets, materials and vertex groups that an artist has corrected."""

import bpy
import numpy as np
import pytest
from builders import (
    changes,
    labels_of,
    limbed,
    scene_snapshot,
    select,
)
from painted_objects import FACE_SETS, painted, stripes

from wks_segment.blender.outputs.labels import write_labels
from wks_segment.blender.outputs.options import OutputOptions

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment


def test_corrected_face_sets_become_segments(obj):
    labels = stripes(obj.data)
    write_labels(obj.data, labels, OutputOptions(face_sets=True))
    sets = obj.data.attributes[FACE_SETS].data
    sets[0].value, sets[1].value, sets[2].value = sets[len(sets) - 1].value, 90, 95
    expected = labels.copy()
    expected[:3] = labels[-1], 500, 501
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
    expected[:2] = labels[-1], 500
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
    # Beside the corrected face, a face inside a segment keeps it; on a border it may get the other one.
    at_vertex = [set() for _ in obj.data.vertices]
    for polygon in obj.data.polygons:
        for vertex in polygon.vertices:
            at_vertex[vertex].add(labels[polygon.index])
    inside = [
        p.index
        for p in obj.data.polygons
        if all(len(at_vertex[v]) == 1 for v in p.vertices) and not set(p.vertices) & set(corners)
    ]
    assert len(inside) > len(found) / 2
    assert (found == labels)[inside].mean() > 0.98
    assert [name for name in obj.vertex_groups.keys() if name == "Mine"] == ["Mine"] * ("Mine" in obj.vertex_groups)  # noqa: SIM118


def test_objects_of_a_character_share_the_segment_of_a_material(settings):
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
def test_a_missing_source_is_named(settings, source):
    select(limbed())
    before = scene_snapshot()
    with pytest.raises(RuntimeError, match=r'"Limbed" has no (face sets|materials|vertex groups)'):
        OPS.segments_from(source=source)
    assert not changes(before, scene_snapshot())
