"""Unwrap Segments: a map that can be painted on, with islands that end at borders of parts."""

import re
from pathlib import Path

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
from wks_segment.blender.scene.topology import polygon_mesh
from wks_segment.core.uv.quality import UvQuality, covered_pixels, densities, overlaps

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment
CHARACTERS = Path(__file__).resolve().parents[4] / "shared" / "data" / "characters"
SIZE = 1024


def islands(mesh, uvs):
    """(corners,) number of the UV island that each corner is in."""
    parent = list(range(len(mesh.polygons)))

    def root(i):
        while parent[i] != i:
            parent[i] = parent[parent[i]]
            i = parent[i]
        return i

    seen = {}
    places = [tuple(round(x, 4) for x in vertex.co) for vertex in mesh.vertices]
    for polygon in mesh.polygons:
        corners = list(polygon.loop_indices)
        for a, b in zip(corners, corners[1:] + corners[:1], strict=True):
            key = frozenset((places[mesh.loops[i].vertex_index], *np.round(uvs[i], 5)) for i in (a, b))
            if key in seen:
                parent[root(polygon.index)] = root(seen[key])
            seen[key] = polygon.index
    return np.array([root(polygon.index) for polygon in mesh.polygons])


def figures(mesh, labels):
    """What a painter asks of a map of a mesh with these labels, at 1024 pixels."""
    uvs = numbers(mesh, "WKS Segment", "vector", 2).astype(float)
    made = polygon_mesh(mesh)
    triangles = uvs[made.triangles]
    density = densities(made, uvs)
    island = islands(mesh, uvs)
    pixel, triangle = covered_pixels(triangles, SIZE)
    image = np.full(SIZE * SIZE, -1)
    image[pixel] = island[made.triangle_polygon[triangle]]
    return {
        "worst segment": min(np.median(density[labels == part]) for part in np.unique(labels)),
        "even": np.mean((density > 1 / 4) & (density < 4)),
        "overlap": len(overlaps(triangles, np.zeros(len(triangles), dtype=int), SIZE)) / len(np.unique(pixel)),
        "margin": margin(image.reshape(SIZE, SIZE)),
        "mixed": max(len(np.unique(labels[island == i])) for i in np.unique(island)) - 1,
        "islands": len(np.unique(island)),
    }


def margin(island):
    """Most pixels, up to six, that lie between the pixels of any two islands, given the island of each, -1 for none."""
    for gap in range(1, 8):
        for shift in range(gap + 1):
            for dx, dy in {(gap, shift), (gap, -shift), (shift, gap), (-shift, gap)}:
                here = island[max(0, -dy) : SIZE - max(0, dy), max(0, -dx) : SIZE - max(0, dx)]
                there = island[max(0, dy) : SIZE + min(0, dy), max(0, dx) : SIZE + min(0, dx)]
                if ((here != there) & (here >= 0) & (there >= 0)).any():
                    return gap - 1
    return 6


def assert_paintable(found):
    assert found["mixed"] == 0
    assert found["worst segment"] > 0.5, found
    assert found["even"] >= 0.99, found
    assert found["overlap"] < 1e-3, found
    assert found["margin"] >= 3, found


@pytest.mark.parametrize("method", ["SEAMS", "SMART"])
def test_islands_end_at_borders_and_have_an_even_density(labeled, method):
    before = list(labeled.data.uv_layers.keys())
    assert OPS.unwrap(method=method) == {"FINISHED"}
    mesh = labeled.data
    assert list(mesh.uv_layers.keys()) == [*before, "WKS Segment"]
    assert mesh.uv_layers.active.name == "WKS Segment"
    assert not before or mesh.uv_layers[0].active_render
    uvs = numbers(mesh, "WKS Segment", "vector", 2)
    assert 0 <= uvs.min() < uvs.max() <= 1
    assert_paintable(figures(mesh, labels_of(labeled)))


def test_a_limb_is_one_island_with_a_seam():
    obj = limbed()
    labels = (np.linalg.norm([polygon.center for polygon in obj.data.polygons], axis=1) > 1.15).astype(int)
    write_labels(obj.data, labels)
    select(obj)
    assert OPS.unwrap() == {"FINISHED"}
    found = figures(obj.data, labels)
    assert_paintable(found)
    assert found["islands"] < 8


def test_a_closed_segment_is_unwrapped():
    """It has no border along which it could be cut."""
    obj = limbed()
    labels = np.zeros(len(obj.data.polygons), dtype=int)
    write_labels(obj.data, labels)
    select(obj)
    assert OPS.unwrap() == {"FINISHED"}
    found = figures(obj.data, labels)
    assert_paintable(found)
    assert found["islands"] < 8


def test_the_image_of_a_material_does_not_stretch_islands(labeled):
    """Blender takes the width and height of the active image of a material for those of the map."""
    material = bpy.data.materials.new("Wide")
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = True
    node = material.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = bpy.data.images.new("Wide", 512, 64)
    material.node_tree.nodes.active = node
    labeled.data.materials.clear()
    labeled.data.materials.append(material)
    OPS.unwrap()
    mesh = labeled.data
    assert UvQuality.of(polygon_mesh(mesh), numbers(mesh, "WKS Segment", "vector", 2)).stretch < 1.3


def test_figures_are_reported(labeled, printed):
    OPS.unwrap()
    assert re.search(r'Unwrapped "Limbed": (99|100).* of the faces .* stretched by 1\.\d\d', printed().out)


def labels_of_bones(obj):
    """(polygons,) the bone of most weight, with few bones: each eighth is one part."""
    bone = np.array([max(v.groups, key=lambda g: g.weight).group if v.groups else 0 for v in obj.data.vertices])
    return np.array([np.bincount(bone[list(polygon.vertices)]).argmax() // 8 for polygon in obj.data.polygons])


@pytest.mark.parametrize(("name", "most"), [("Cow", 60), ("Casual", 40), ("Snake", 20)])
def test_a_real_character_can_be_painted_on(name, most):
    """With bones as segments: tubes, limbs, hands and heads with horns, ears and a mouth."""
    path = CHARACTERS / f"{name}.glb"
    if not path.exists():
        pytest.skip(f"{path} is absent")
    bpy.ops.import_scene.gltf(filepath=str(path))
    meshes = [obj for obj in bpy.context.scene.objects if obj.type == "MESH" and obj.vertex_groups]
    for obj in meshes:
        labels = labels_of_bones(obj)
        write_labels(obj.data, labels)
        select(obj)
        OPS.unwrap()
        found = figures(obj.data, labels)
        assert_paintable(found)
        assert found["islands"] <= most


def test_vertices_that_an_importer_split_do_not_split_islands():
    points = coordinates(limbed("Whole").data)
    corners = np.array([list(polygon.vertices) for polygon in bpy.data.objects["Whole"].data.polygons])
    split = mesh_object(points[corners.ravel()], np.arange(corners.size).reshape(-1, 3), "Split")
    found = {}
    for obj in (bpy.data.objects["Whole"], split):
        write_labels(obj.data, stripes(obj.data))
        select(obj)
        OPS.unwrap()
        island = islands(obj.data, numbers(obj.data, "WKS Segment", "vector", 2))
        found[obj.name] = np.unique(island, return_counts=True)[1]
    np.testing.assert_array_equal(np.sort(found["Split"]), np.sort(found["Whole"]))


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
