"""Objects with parts by height, as a model would give them, and checks that all outputs agree with the labels."""

import bpy
import numpy as np
from builders import (
    labels_of,
    numbers,
)

from wks_segment.blender.outputs.origin import Origin, origin_of
from wks_segment.blender.parts import part_ids
from wks_segment.blender.props.label_set import style_of
from wks_segment.blender.scene.characters import Character
from wks_segment.blender.workflow import pipeline
from wks_segment.blender.workflow.report import Report

RED = (1.0, 0.0, 0.0)


def bands(obj):
    """A part by height: 0 below and at the end of a limb, 1 in the middle, 1002 and 2002 above, by side."""
    centers = np.array([polygon.center for polygon in obj.data.polygons])
    above = np.where(centers[:, 0] > 0, 1002, 2002)
    above = np.where(centers[:, 0] > 2.2, 0, above)
    return np.where(centers[:, 2] > 0.4, above, np.where(centers[:, 2] > -0.2, 1, 0))


def write(settings, *objects):
    """Write bands to objects, as Apply to Selected would."""
    report = Report([])
    write_labels(settings, {Character((obj,)): bands(obj) for obj in objects}, report)
    return report


def write_labels(settings, labels, report=None, of="bands/3"):
    """Write parts of polygons, as a model would give them, of a label set."""
    request, origin = pipeline.LabelRequest.of(settings, labels), Origin(of)
    pipeline.write_outputs(settings, labels, request, report or Report([]), origin=origin)


def style_on(obj):
    """Names and colors of the parts on an object."""
    return style_of(origin_of(obj.data).labels)


def activate(settings, part):
    settings.active_segment = [item.number for item in settings.segments].index(part)
    return settings.segments[settings.active_segment]


def colors_at(obj, part):
    """The different colors, in 0 to 255, at the corners of a part's faces."""
    at = np.repeat(labels_of(obj) == part, [len(polygon.vertices) for polygon in obj.data.polygons])
    return np.unique(np.rint(255 * numbers(obj.data, "wks_segment_color", "color_srgb", 4)[at, :3]), axis=0).tolist()


def material_at(obj, part):
    """Names of the materials on a part's faces."""
    where = np.flatnonzero(labels_of(obj) == part).tolist()
    return {obj.data.materials[obj.data.polygons[i].material_index].name for i in where}


def groups_of(obj):
    return [group.name for group in obj.vertex_groups]


def members(obj, group):
    index = obj.vertex_groups[group].index
    return {vertex.index for vertex in obj.data.vertices if any(g.group == index and g.weight for g in vertex.groups)}


def corners_of(obj, part):
    where = np.flatnonzero(labels_of(obj) == part).tolist()
    return {vertex for i in where for vertex in obj.data.polygons[i].vertices}


def all_agrees(obj, settings):
    """Colors, materials, groups and the vertices' attribute say what the faces' labels and the list say."""
    style, found = style_on(obj), part_ids.unique_parts(labels_of(obj))
    for part in found:
        expected = np.rint(255 * style.colors_of(np.array(part)))
        np.testing.assert_allclose(colors_at(obj, part), [expected], atol=1)
        assert material_at(obj, part) == {style.name_of(part)}
        assert members(obj, f"WKS {style.name_of(part)}") == corners_of(obj, part)
    assert groups_of(obj) == [f"WKS {style.name_of(part)}" for part in found]
    assert set(numbers(obj.data, "wks_segment_vertex")) <= set(found)
    assert {item.number for item in settings.segments} >= set(found)
    return True


def in_object_mode(read, *arguments):
    bpy.ops.object.mode_set(mode="OBJECT")
    return read(*arguments)


def coordinates_of_faces(obj):
    return np.array([polygon.center for polygon in obj.data.polygons])
