"""Transfer: an object gets the segments of the nearest surface of another one."""

import bpy
import numpy as np
import pytest
from builders import (
    labels_of,
    limbed,
    limbed_rigged,
    select,
)
from painted_objects import painted, stripes, undone

from wks_segment.blender.outputs.labels import write_labels

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment


def test_a_coat_gets_the_segments_of_the_nearest_surface(settings):
    body, coat = limbed("Body", 0.4), limbed("Coat", 0.4, subdivisions=5)
    coat.data.transform(coat.matrix_world.Scale(1.03, 4))
    coat.location = body.location = (3, 0, 0)
    write_labels(body.data, stripes(body.data))
    select(body, coat)
    assert OPS.transfer() == {"FINISHED"}
    assert (labels_of(coat) == stripes(coat.data)).mean() > 0.95
    np.testing.assert_array_equal(labels_of(body), stripes(body.data))


def test_transfer_uses_both_objects_as_they_are_posed(settings):
    body, coat = limbed_rigged("Body"), limbed("Coat")
    bpy.context.scene.frame_set(11)
    seen = body.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
    points = np.array([vertex.co for vertex in seen.vertices])
    coat.data.vertices.foreach_set("co", points.ravel().astype(np.float32))
    coat.data.update()
    write_labels(body.data, stripes(body.data))
    select(body, coat)
    assert OPS.transfer() == {"FINISHED"}
    np.testing.assert_array_equal(labels_of(coat), stripes(body.data))


def test_transfer_writes_the_chosen_outputs_and_can_be_undone(settings):
    body, coat = limbed("Body"), painted(limbed("Coat"))
    write_labels(body.data, stripes(body.data))
    settings.write_face_sets = settings.write_seams = settings.write_materials = True
    settings.vertex_groups = "hard"
    select(body, coat)
    OPS.refresh_segments()
    done, left = undone(OPS.transfer)
    assert all("/Body/" not in path for path in done)
    assert any("wks_segment_seam" in path for path in done)
    assert not left


def test_transfer_needs_labels_on_the_active_object(settings):
    select(limbed("One"), limbed("Two"))
    assert not OPS.transfer.poll()
