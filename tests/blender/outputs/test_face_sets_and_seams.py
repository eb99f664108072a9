"""Face sets and seams: written, taken back, the artist's own kept."""

import bpy
import numpy as np
import pytest
from builders import (
    labels_of,
    numbers,
)
from painted_objects import FACE_SETS, seams_of, stripes

from wks_segment.blender.outputs.labels import clear_labels, write_labels
from wks_segment.blender.outputs.options import OutputOptions

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment


def test_each_segment_is_a_face_set(obj):
    labels = stripes(obj.data) + 1000 * (np.arange(len(obj.data.polygons)) % 3)
    write_labels(obj.data, labels, OutputOptions(face_sets=True))
    sets = numbers(obj.data, FACE_SETS)
    assert sets.min() > 0
    assert len(np.unique(sets)) == len(np.unique(np.stack([sets, labels]), axis=1).T) == len(np.unique(labels))


def test_face_sets_drawn_after_ours_stay(obj):
    own = numbers(obj.data, FACE_SETS) if FACE_SETS in obj.data.attributes else np.ones(len(obj.data.polygons))
    write_labels(obj.data, stripes(obj.data), OutputOptions(face_sets=True))
    obj.data.attributes[FACE_SETS].data[3].value = 500
    clear_labels(obj.data)
    own[3] = 500
    np.testing.assert_array_equal(numbers(obj.data, FACE_SETS), own)


def test_seams_are_on_borders_of_segments_and_where_they_were(obj):
    before = seams_of(obj.data)
    labels = stripes(obj.data)
    write_labels(obj.data, labels, OutputOptions(seams=True))
    around = {}
    for polygon in obj.data.polygons:
        for key in polygon.edge_keys:
            around.setdefault(key, set()).add(labels[polygon.index])
    expected = [len(around[edge.key]) > 1 for edge in obj.data.edges]
    np.testing.assert_array_equal(seams_of(obj.data), before | expected)


def test_seams_marked_after_ours_stay(obj):
    before = seams_of(obj.data)
    write_labels(obj.data, stripes(obj.data), OutputOptions(seams=True))
    late = int(np.flatnonzero(~seams_of(obj.data))[0])
    obj.data.edges[late].use_seam = True
    clear_labels(obj.data)
    before[late] = True
    np.testing.assert_array_equal(seams_of(obj.data), before)


def test_borders_do_not_snap_to_our_seams(settings, obj):
    settings.snap_to = {"seams"}
    OPS.learn()
    first = labels_of(obj)
    settings.write_seams = True
    OPS.learn()
    OPS.learn()
    np.testing.assert_array_equal(labels_of(obj), first)
