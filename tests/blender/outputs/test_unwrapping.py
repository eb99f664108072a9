"""Unwrap Segments: UV islands end at borders of parts, and each part has a box of its own."""

import bpy
import numpy as np
import pytest
from builders import (
    changes,
    coordinates,
    labels_of,
    limbed,
    mesh_object,
    numbers,
    scene_snapshot,
    select,
)
from painted_objects import stripes

from wks_segment.blender.outputs.labels import write_labels

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment


def islands(mesh, uvs):
    """(corners,) number of the UV island that each corner is in."""
    parent = list(range(len(mesh.polygons)))

    def root(i):
        while parent[i] != i:
            parent[i] = parent[parent[i]]
            i = parent[i]
        return i

    seen = {}
    for polygon in mesh.polygons:
        corners = list(polygon.loop_indices)
        for a, b in zip(corners, corners[1:] + corners[:1], strict=True):
            key = frozenset((mesh.loops[i].vertex_index, *np.round(uvs[i], 5)) for i in (a, b))
            if key in seen:
                parent[root(polygon.index)] = root(seen[key])
            seen[key] = polygon.index
    return np.array([root(polygon.index) for polygon in mesh.polygons])


@pytest.mark.parametrize("method", ["SEAMS", "SMART"])
def test_each_segment_has_a_box_of_its_own(labeled, method):
    before = list(labeled.data.uv_layers.keys())
    assert OPS.unwrap(method=method) == {"FINISHED"}
    mesh, labels = labeled.data, labels_of(labeled)
    assert list(mesh.uv_layers.keys()) == [*before, "WKS Segment"]
    assert mesh.uv_layers.active.name == "WKS Segment"
    assert not before or mesh.uv_layers[0].active_render
    uvs = numbers(mesh, "WKS Segment", "vector", 2)
    assert 0 <= uvs.min() < uvs.max() <= 1
    of_corner = np.repeat(labels, 3)
    boxes = {part: (uvs[of_corner == part].min(axis=0), uvs[of_corner == part].max(axis=0)) for part in range(4)}
    for part, (low, high) in boxes.items():
        for other, (other_low, other_high) in boxes.items():
            assert part == other or (high <= other_low).any() or (other_high <= low).any()
    found = islands(mesh, uvs)
    assert all(len(np.unique(labels[found == island])) == 1 for island in np.unique(found))


def test_islands_have_the_scale_of_the_surface(labeled):
    OPS.unwrap()
    mesh, labels = labeled.data, labels_of(labeled)
    uvs = numbers(mesh, "WKS Segment", "vector", 2).reshape(-1, 3, 2)
    (ux, uy), (vx, vy) = (np.moveaxis(uvs[:, i] - uvs[:, 0], -1, 0) for i in (1, 2))
    in_map, area = np.abs(ux * vy - uy * vx) / 2, np.array([polygon.area for polygon in mesh.polygons])
    shares = [in_map[labels == part].sum() / area[labels == part].sum() for part in range(4)]
    assert max(shares) < 2 * min(shares)


def test_a_closed_segment_is_unwrapped():
    """It has no border along which it could be cut."""
    obj = limbed()
    write_labels(obj.data, np.zeros(len(obj.data.polygons), dtype=int))
    select(obj)
    assert OPS.unwrap() == {"FINISHED"}
    uvs = numbers(obj.data, "WKS Segment", "vector", 2).reshape(-1, 3, 2)
    (ux, uy), (vx, vy) = (np.moveaxis(uvs[:, i] - uvs[:, 0], -1, 0) for i in (1, 2))
    assert (np.abs(ux * vy - uy * vx) > 1e-9).mean() > 0.99
    assert 1 < len(np.unique(islands(obj.data, uvs.reshape(-1, 2)))) < 100


def test_vertices_that_an_importer_split_do_not_split_islands():
    points = coordinates(limbed("Whole").data)
    corners = np.array([list(polygon.vertices) for polygon in bpy.data.objects["Whole"].data.polygons])
    split = mesh_object(points[corners.ravel()], np.arange(corners.size).reshape(-1, 3), "Split")
    found = {}
    for obj in (bpy.data.objects["Whole"], split):
        write_labels(obj.data, stripes(obj.data))
        select(obj)
        OPS.unwrap()
        found[obj.name] = numbers(obj.data, "WKS Segment", "vector", 2)
    np.testing.assert_allclose(found["Split"], found["Whole"], atol=1e-4)


def test_a_mesh_full_of_uv_maps_is_refused(labeled):
    while len(labeled.data.uv_layers) < 8:
        labeled.data.uv_layers.new()
    before = scene_snapshot()
    with pytest.raises(RuntimeError, match="8 UV maps"):
        OPS.unwrap()
    assert not changes(before, scene_snapshot())


def test_unwrapping_changes_nothing_else(labeled):
    other = limbed("Other")
    select(other, labeled)
    before = scene_snapshot()
    OPS.unwrap()
    changed = changes(before, scene_snapshot())
    assert changed
    assert all(path.startswith("/meshes/Limbed/") and ("uv" in path or "WKS Segment" in path) for path in changed), (
        changed
    )
