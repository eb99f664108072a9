"""Confusion matrix: all text is inside the picture, whatever the names of the classes are."""

import bpy
import numpy as np
import pytest

from wks_segment.blender.render.confusion_matrix import CELL_PIXELS, render_matrix
from wks_segment.core import Retrieval

pytestmark = pytest.mark.usefixtures("scene", "needs_rendering")


@pytest.mark.parametrize("names", [("cat", "dog"), ("W" * 30, "the name of a class, in many words " * 3)])
def test_text_does_not_reach_the_edges(tmp_path, names):
    path = tmp_path / "matrix.png"
    render_matrix(Retrieval(list(names), np.array([[12345678, 1], [0, 2]]), {}), path)
    image = bpy.data.images.load(str(path))
    width, height = image.size
    pixels = np.array(image.pixels[:]).reshape(height, width, -1)[..., :3]
    margin = CELL_PIXELS // 5
    for edge in (pixels[:margin], pixels[-margin:], pixels[:, :margin], pixels[:, -margin:]):
        assert np.ptp(edge.reshape(-1, 3), axis=0).max() < 0.05
    assert (pixels.max(axis=-1) < 0.3).any(), "there is text"
