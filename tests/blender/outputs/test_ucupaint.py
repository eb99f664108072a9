"""The output Ucupaint: the color attribute that its Color ID masks read, as its own code reads it."""

import bpy
import numpy as np
import pytest
from painted_objects import stripes

from wks_segment.blender.outputs.color_attribute import PART_COLORS
from wks_segment.blender.outputs.labels import clear_labels, write_labels
from wks_segment.blender.outputs.options import OutputOptions
from wks_segment.blender.outputs.ucupaint import COLOR_IDS
from wks_segment.blender.parts.palette import RECIPES
from wks_segment.blender.parts.part_style import Style
from wks_segment.core.message import Message

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment
TOLERANCE = 1 / 256
"""Of Ucupaint's masks, in linear colors."""


def linear(srgb):
    srgb = np.asarray(srgb, dtype=float)
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def mask(mesh, color):
    """(p,) whether faces are white in a mask of this linear color; all corners of a face agree."""
    attribute = mesh.color_attributes[COLOR_IDS]
    corners = np.array([value.color[:3] for value in attribute.data])
    white = (np.abs(corners - color) < TOLERANCE).all(axis=1)
    faces = [white[list(polygon.loop_indices)] for polygon in mesh.polygons]
    assert all(face.all() == face.any() for face in faces), "a face is not of one color"
    return np.array([face.all() for face in faces])


@pytest.mark.parametrize("palette", RECIPES)
def test_a_mask_with_the_color_of_the_list_shows_the_part(obj, palette):
    style = Style(palette=palette)
    labels = stripes(obj.data, 8) + 1000 * (np.arange(len(obj.data.polygons)) % 3)
    write_labels(obj.data, labels, OutputOptions(ucupaint=True, style=style))
    for part in np.unique(labels):
        [color] = style.colors_of(np.array([part]))
        np.testing.assert_array_equal(mask(obj.data, linear(color)), labels == part)


def test_what_is_shown_and_rendered_stays(obj):
    mesh = obj.data
    write_labels(mesh, stripes(mesh), OutputOptions(ucupaint=True))
    assert mesh.color_attributes.active_color_name == PART_COLORS
    own = mesh.color_attributes.render_color_index
    write_labels(mesh, stripes(mesh), OutputOptions())
    assert COLOR_IDS not in mesh.attributes
    assert mesh.color_attributes.render_color_index == own


def test_without_colors_nothing_is_shown_or_rendered(obj, capfd):
    mesh = obj.data
    write_labels(mesh, stripes(mesh), OutputOptions(ucupaint=True, colors=False))
    shown = [mesh.attributes.active_color_name, mesh.attributes.default_color_name]
    assert (shown, mesh.color_attributes.render_color_index) == (["", ""], -1)
    assert "error" not in "".join(capfd.readouterr()), "Blender complains on the terminal"


def test_color_ids_of_the_artist_stay(obj):
    mesh = obj.data
    mesh.color_attributes.new(COLOR_IDS, "BYTE_COLOR", "CORNER").data[0].color_srgb = (0.2, 0.4, 0.6, 1.0)
    warnings = []
    write_labels(mesh, stripes(mesh), OutputOptions(ucupaint=True), warnings=warnings)
    clear_labels(mesh)
    assert [message.template for message in warnings] == [
        '"{mesh}" has color IDs of Ucupaint already, they stay as they are'
    ]
    assert all(isinstance(message, Message) for message in warnings)
    np.testing.assert_allclose(mesh.color_attributes[COLOR_IDS].data[0].color_srgb, (0.2, 0.4, 0.6, 1.0), atol=0.01)


def test_faces_that_the_artist_filled_stay(obj):
    mesh, warnings = obj.data, []
    write_labels(mesh, stripes(mesh), OutputOptions(ucupaint=True))
    for corner in mesh.polygons[3].loop_indices:
        mesh.color_attributes[COLOR_IDS].data[corner].color = (1.0, 0.0, 1.0, 1.0)
    clear_labels(mesh, warnings)
    assert COLOR_IDS in mesh.attributes
    assert "they stay" in warnings[0]
    assert mask(mesh, (1.0, 0.0, 1.0)).tolist() == [i == 3 for i in range(len(mesh.polygons))]


def test_clear_takes_color_ids_back(obj):
    before = sorted(obj.data.attributes.keys())
    write_labels(obj.data, stripes(obj.data), OutputOptions(ucupaint=True))
    assert COLOR_IDS in obj.data.attributes
    clear_labels(obj.data)
    assert sorted(obj.data.attributes.keys()) == before


def test_a_new_color_in_the_list_is_written_at_once(settings, obj):
    settings.write_ucupaint = True
    OPS.learn()
    row = settings.segments[0]
    row.color = (0.1, 0.9, 0.3)
    labels = np.array([value.value for value in obj.data.attributes["wks_segment"].data])
    np.testing.assert_array_equal(mask(obj.data, linear((0.1, 0.9, 0.3))), labels == row.number)
    assert OPS.clear() == {"FINISHED"}
    assert COLOR_IDS not in obj.data.attributes
