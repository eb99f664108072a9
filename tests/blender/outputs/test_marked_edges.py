"""Edges that the artist has marked: the polygons on their two sides, and borders that snap to them."""

import bpy
import numpy as np
import pytest
from builders import labels_of, limbed, limbed_surface, mesh_object, select

from wks_segment.blender.outputs.labels import write_labels
from wks_segment.blender.outputs.marked_edges import marked_pairs
from wks_segment.blender.outputs.options import OutputOptions
from wks_segment.blender.scene.characters import Character
from wks_segment.core import PoseSegmentation

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment
ALL = {"sharp", "seams", "materials"}


def strip(name="Strip", left=0.0):
    """Four squares in a row, 0 to 3."""
    points = [(left + x, y, 0) for x in range(5) for y in (0, 1)]
    return mesh_object(points, [(2 * i, 2 * i + 2, 2 * i + 3, 2 * i + 1) for i in range(4)], name)


def split_strip():
    """The same squares with vertices of their own, as importers split them where the material changes."""
    points = [corner for x in range(4) for corner in ((x, 0, 0), (x + 1, 0, 0), (x + 1, 1, 0), (x, 1, 0))]
    return mesh_object(points, np.arange(16).reshape(4, 4))


def edge_between(mesh, first, second):
    """The edge that two polygons share, or two at the same place."""
    (key,) = set(mesh.polygons[first].edge_keys) & set(mesh.polygons[second].edge_keys)
    return next(edge for edge in mesh.edges if edge.key == key)


def pairs(*objects, kinds=ALL):
    found = marked_pairs(Character(objects), kinds)
    assert found.shape[1:] == (2,)
    return {tuple(pair) for pair in np.sort(found, axis=1).tolist()}


@pytest.fixture
def marked():
    """A strip with a sharp edge, a seam and two materials: three different borders."""
    obj = strip()
    edge_between(obj.data, 0, 1).use_edge_sharp = True
    edge_between(obj.data, 1, 2).use_seam = True
    for name in ("Skin", "Cloth"):
        obj.data.materials.append(bpy.data.materials.new(name))
    obj.data.polygons[3].material_index = 1
    return obj


@pytest.mark.parametrize(("kind", "pair"), [("sharp", (0, 1)), ("seams", (1, 2)), ("materials", (2, 3))])
def test_each_kind_of_mark_is_found_by_itself(marked, kind, pair):
    assert pairs(marked, kinds={kind}) == {pair}


def test_several_kinds_together(marked):
    assert pairs(marked) == {(0, 1), (1, 2), (2, 3)}


def test_without_kinds_there_are_no_pairs(marked):
    assert marked_pairs(Character((marked,)), set()) is None


def test_unmarked_mesh_has_no_pairs():
    assert pairs(strip()) == set()


def test_a_mark_on_an_open_border_has_no_pair():
    obj = strip()
    for edge in obj.data.edges:
        edge.use_seam = len([p for p in obj.data.polygons if edge.key in p.edge_keys]) == 1
    assert pairs(obj) == set()


def test_polygons_of_several_objects_are_numbered_one_after_another(marked):
    assert pairs(strip("First", -9.0), marked) == {(4, 5), (5, 6), (6, 7)}


def test_polygons_are_neighbors_across_split_vertices():
    obj = split_strip()
    obj.data.polygons[2].material_index = 1
    right_of_0 = next(edge for edge in obj.data.edges if edge.key == (1, 2))
    right_of_0.use_seam = True
    assert pairs(obj) == {(0, 1), (1, 2), (2, 3)}
    assert pairs(obj, kinds={"seams"}) == {(0, 1)}


def test_all_polygons_at_an_edge_of_three_are_neighbors():
    fan = mesh_object([(0, 0, 0), (0, 0, 1), (1, 0, 0), (0, 1, 0), (-1, 0, 0)], [(0, 1, 2), (0, 1, 3), (0, 1, 4)])
    next(edge for edge in fan.data.edges if edge.key == (0, 1)).use_edge_sharp = True
    assert pairs(fan) == {(0, 1), (0, 2), (1, 2)}


def test_materials_of_segments_are_not_marks(marked):
    write_labels(marked.data, np.array([0, 1, 1, 1]), OutputOptions(materials=True))
    assert pairs(marked, kinds={"materials"}) == {(2, 3)}


def test_a_mesh_with_all_polygons_at_one_place_is_read():
    heap = mesh_object(np.zeros((300, 3)), np.arange(300).reshape(100, 3))
    for edge in heap.data.edges:
        edge.use_seam = True
    assert len(pairs(heap)) < 100 * 100 / 2


def neighbors_of(mesh):
    """(q, 2) polygons at each edge, and the edge, of a closed mesh."""
    edge = np.empty(len(mesh.loops), dtype=np.int32)
    mesh.loops.foreach_get("edge_index", edge)
    return np.argsort(edge, kind="stable").reshape(-1, 2) // 3, np.sort(edge)[::2]


def ring_beside_a_border(obj):
    """Mark the edges around the part at the tip of the longest limb, grown by a face; gives their number."""
    beside, edge = neighbors_of(obj.data)
    inside = labels_of(obj) == labels_of(obj)[np.argmax([p.center.x for p in obj.data.polygons])]
    grown = inside.copy()
    grown[beside[inside[beside].any(axis=1)]] = True
    ring = grown[beside[:, 0]] != grown[beside[:, 1]]
    for i in edge[ring].tolist():
        obj.data.edges[i].use_seam = True
    return int(ring.sum())


def marked_border(obj):
    """Number of marked edges that lie on a border."""
    beside, edge = neighbors_of(obj.data)
    seams = np.empty(len(obj.data.edges), dtype=bool)
    obj.data.edges.foreach_get("use_seam", seams)
    labels = labels_of(obj)[beside]
    return int((seams[edge] & (labels[:, 0] != labels[:, 1])).sum())


def test_border_moves_to_a_seam_nearby(settings):
    creature = limbed(subdivisions=6)
    select(creature)
    assert OPS.learn() == {"FINISHED"}
    ring = ring_beside_a_border(creature)
    assert OPS.apply() == {"FINISHED"}
    before = marked_border(creature)
    settings.snap_to = {"seams"}
    assert OPS.apply() == {"FINISHED"}
    assert before < 0.2 * ring
    assert marked_border(creature) > 0.6 * ring
    settings.snap_to = {"sharp"}
    assert OPS.apply() == {"FINISHED"}
    assert marked_border(creature) == before


def test_pairs_reach_the_core_for_each_mesh(settings, monkeypatch):
    seen = []
    segment = PoseSegmentation.segment_polygons

    def watched(self, *arguments, marked=None):
        seen.append(marked)
        return segment(self, *arguments, marked=marked)

    monkeypatch.setattr(PoseSegmentation, "segment_polygons", watched)
    plain, seamed = limbed("A"), mesh_object(limbed_surface(0.3)[0], limbed_surface()[1], "B")
    seamed.data.edges[0].use_seam = True
    select(plain, seamed)
    OPS.learn()
    settings.snap_to = {"seams"}
    OPS.learn()
    assert [None if each is None else len(each) for each in seen] == [None, None, 0, 1]
