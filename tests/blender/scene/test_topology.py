"""How corners, edges and polygons of a mesh belong together."""

import numpy as np
import pytest
from builders import (
    mesh_object,
)

from wks_segment.blender.outputs.part_attributes import labels_on
from wks_segment.blender.scene.topology import border_edges

pytestmark = pytest.mark.usefixtures("scene")


def test_borders_of_labels():
    mesh = mesh_object([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [(0, 1, 2), (0, 2, 3)]).data
    found = {edge.key for edge, border in zip(mesh.edges, border_edges(mesh, np.array([4, 2])), strict=True) if border}
    assert found == {(0, 2)}
    assert not border_edges(mesh, np.array([1, 1])).any()
    assert labels_on(mesh) is None
