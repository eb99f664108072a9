"""The ID map: every pixel has exactly the color of the segment of its face, and nothing else changes."""

from pathlib import Path

import bpy
import numpy as np
import pytest
from builders import changes, limbed, mesh_object, numbers, scene_snapshot, select

from wks_segment.blender.outputs.labels import clear_labels, write_labels
from wks_segment.blender.outputs.part_attributes import labels_on
from wks_segment.blender.parts.part_style import Style

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment
SIZE = 256
NEAR = 0.01
"""In pixels: Blender moves the raster by a thousandth, so that no center of a pixel is on an edge."""
CHARACTERS = Path(__file__).resolve().parents[4] / "shared" / "data" / "characters"


def stripes(mesh, count=4):
    """Labels by height."""
    height = np.array([polygon.center.z for polygon in mesh.polygons])
    return np.digitize(height, np.linspace(height.min(), height.max(), count + 1)[1:-1])


def unwrapped(obj):
    """Give an object a UV map by Smart UV Project, with the rest of the scene as it was."""
    bpy.context.view_layer.update()
    select(obj)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.uv.smart_project(island_margin=0.02)
    bpy.ops.object.mode_set(mode="OBJECT")
    return obj


@pytest.fixture
def labeled(settings):
    obj = unwrapped(limbed())
    write_labels(obj.data, stripes(obj.data))
    settings.bake_size, settings.bake_margin = SIZE, 4
    select(obj)
    return obj


def pixels(image):
    """(height, width, 3) bytes of an image, from the bottom row up."""
    values = np.empty(4 * image.size[0] * image.size[1], dtype=np.float32)
    image.pixels.foreach_get(values)
    values = values.reshape(image.size[1], image.size[0], 4)
    assert (values[..., 3] == 1).all()
    levels = 255 * values[..., :3]
    np.testing.assert_allclose(levels, np.rint(levels), atol=1e-3)
    return np.rint(levels).astype(int)


def colors_of(labels, style):
    """(…, 3) bytes."""
    return np.rint(255 * style.colors_of(labels)).astype(int)


def covering(mesh, size, uv_map=None):
    """For each triangle of a UV map: its polygon, rows and columns of pixels, and how far inside their centers are.

    In pixels; nearer to an edge than NEAR, either side may be seen.
    """
    mesh.calc_loop_triangles()
    layer = mesh.uv_layers.active if uv_map is None else mesh.uv_layers[uv_map]
    uvs = np.empty(2 * len(mesh.loops), dtype=np.float32)
    layer.data.foreach_get("uv", uvs)
    for triangle in mesh.loop_triangles:
        corners = uvs.reshape(-1, 2)[list(triangle.loops)].astype(float) * size - 0.5
        if np.cross(corners[1] - corners[0], corners[2] - corners[0]) < 0:
            corners = corners[::-1]
        low = np.maximum(np.ceil(corners.min(axis=0)), 0).astype(int)
        high = np.minimum(np.floor(corners.max(axis=0)), size - 1).astype(int)
        if (high < low).any():
            continue
        x, y = np.meshgrid(np.arange(low[0], high[0] + 1), np.arange(low[1], high[1] + 1))
        depth = np.full(x.shape, np.inf)
        for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            length = max(np.hypot(*(b - a)), 1e-12)
            depth = np.minimum(depth, ((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])) / length)
        near = depth > -NEAR
        yield triangle.polygon_index, y[near], x[near], depth[near]


def wrong_pixels(image, objects, style):
    """How many pixels whose center a face covers have the color of no such face, and how many pixels these are."""
    seen = pixels(image)
    covered, right = np.zeros((2, *seen.shape[:2]), dtype=bool)
    for obj in objects:
        colors = colors_of(labels_on(obj.data), style)
        for polygon, rows, columns, depth in covering(obj.data, len(seen)):
            covered[rows, columns] |= depth > NEAR
            right[rows, columns] |= (seen[rows, columns] == colors[polygon]).all(axis=1)
    return int((covered & ~right).sum()), int(covered.sum())


def image_of(obj):
    return bpy.data.images[obj.data["wks_segment_note"]["id_map"]]


# What is in the image


@pytest.mark.parametrize("palette", ["calm", "distinct", "color_blind"])
def test_every_pixel_has_the_color_of_the_face_that_covers_it(labeled, settings, palette):
    settings.palette = palette
    assert OPS.bake() == {"FINISHED"}
    image = image_of(labeled)
    assert (image.name, tuple(image.size)) == ("Limbed ID Map", (SIZE, SIZE))
    assert image.colorspace_settings.name == "Non-Color"
    assert image.packed_file is not None
    wrong, inside = wrong_pixels(image, [labeled], Style(palette=palette))
    assert inside > 0.3 * SIZE**2
    assert wrong == 0


def test_every_pixel_has_a_color_of_the_palette_or_is_black(labeled):
    OPS.bake()
    seen = {tuple(color) for color in pixels(image_of(labeled)).reshape(-1, 3).tolist()}
    assert seen == {(0, 0, 0), *map(tuple, colors_of(np.arange(4), Style()).tolist())}


@pytest.mark.parametrize("margin", [0, 3, 12])
def test_margin_has_the_chosen_width(labeled, settings, margin):
    settings.bake_size, settings.bake_margin = 64, 0
    OPS.bake()
    island = pixels(image_of(labeled)).any(axis=2)
    settings.bake_margin = margin
    OPS.bake()
    grown = pixels(image_of(labeled)).any(axis=2)
    rows, columns = np.nonzero(island)
    away = np.full(island.shape, np.inf)
    for row, column in np.argwhere(~island):
        away[row, column] = np.hypot(rows - row, columns - column).min()
    np.testing.assert_array_equal(grown, island | (away <= margin))


def test_uvs_moved_by_a_modifier_are_baked_as_they_are_seen(labeled):
    labeled.modifiers.new("Smooth", "SUBSURF").levels = 1
    OPS.bake()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    mesh = labeled.evaluated_get(depsgraph).to_mesh(preserve_all_data_layers=True, depsgraph=depsgraph)
    seen = pixels(image_of(labeled))
    colors = colors_of(numbers(mesh, "wks_segment").astype(int), Style())
    for polygon, rows, columns, depth in covering(mesh, SIZE, "UVMap"):
        assert (seen[rows, columns] == colors[polygon])[depth > NEAR].all()


def test_the_image_is_saved_with_the_file(labeled, tmp_path):
    OPS.bake()
    before = pixels(image_of(labeled))
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "saved.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "saved.blend"))
    np.testing.assert_array_equal(pixels(image_of(bpy.data.objects["Limbed"])), before)


# What does not change


def test_nothing_else_changes(labeled):
    bpy.context.scene.render.engine = "BLENDER_WORKBENCH"
    labeled.data.materials.append(bpy.data.materials.new("Skin"))
    before = scene_snapshot()
    assert OPS.bake() == {"FINISHED"}
    assert changes(before, scene_snapshot()) == [
        "/images/Limbed ID Map",
        "/meshes/Limbed/properties/wks_segment_note/id_map",
    ]
    assert OPS.bake() == {"FINISHED"}
    assert list(bpy.data.images.keys()) == ["Limbed ID Map"]


def test_clear_removes_the_image_unless_it_is_used(labeled):
    clear_labels(labeled.data)
    before, labels = scene_snapshot(), stripes(labeled.data)
    for used in (False, True):
        write_labels(labeled.data, labels)
        OPS.bake()
        if used:
            before["images"] = scene_snapshot()["images"]
            material = bpy.data.materials.new("Mask")
            if bpy.app.version < (5, 0, 0):
                material.use_nodes = True
            material.node_tree.nodes.new("ShaderNodeTexImage").image = image_of(labeled)
            before["materials"] = ["Mask"]
        OPS.clear()
        assert not changes(before, scene_snapshot())


def test_new_labels_keep_the_image_until_it_is_baked_again(labeled):
    OPS.bake()
    image, before = image_of(labeled), pixels(image_of(labeled))
    write_labels(labeled.data, 3 - stripes(labeled.data))
    assert image_of(labeled) is image
    np.testing.assert_array_equal(pixels(image), before)
    OPS.bake()
    assert image_of(labeled) is image
    assert wrong_pixels(image, [labeled], Style())[0] == 0


def test_undo_restores_everything(labeled):
    OPS.refresh_segments()
    before = scene_snapshot()
    bpy.ops.ed.undo_push(message="before")
    OPS.bake()
    bpy.ops.ed.undo_push(message="baked")
    assert bpy.ops.ed.undo() == {"FINISHED"}
    assert not changes(before, scene_snapshot())


# UV maps that cannot be used, or only in part


def test_without_a_uv_map_bake_is_refused_or_unwraps_if_told_to(settings):
    obj = limbed()
    write_labels(obj.data, stripes(obj.data))
    settings.bake_size = SIZE
    select(obj)
    before = scene_snapshot()
    with pytest.raises(RuntimeError, match='"Limbed" has no UV map: unwrap it'):
        OPS.bake()
    assert not changes(before, scene_snapshot())
    settings.bake_unwrap = True
    assert OPS.bake() == {"FINISHED"}
    assert list(obj.data.uv_layers.keys()) == ["WKS Segment"]
    wrong, inside = wrong_pixels(image_of(obj), [obj], Style())
    assert (wrong, inside > 0.2 * SIZE**2) == (0, True)
    OPS.clear()
    assert not obj.data.uv_layers


def test_a_uv_map_without_area_is_refused(labeled):
    uvs = labeled.data.uv_layers.active.data
    uvs.foreach_set("uv", np.zeros(2 * len(uvs), dtype=np.float32))
    labeled.data.update()
    with pytest.raises(RuntimeError, match="no UV map with faces in it"):
        OPS.bake()


def test_faces_that_overlap_and_faces_outside_are_warned_of(labeled, settings, printed):
    uvs = numbers(labeled.data, "UVMap", "vector", 2)
    layer, middle = labeled.data.uv_layers.active, (uvs.min(axis=0) + uvs.max(axis=0)) / 2
    printed()
    OPS.bake()
    assert "Warning" not in printed().out
    layer.data.foreach_set("uv", (middle - np.abs(uvs - middle)).astype(np.float32).ravel())
    labeled.data.update()
    OPS.bake()
    assert "lies on other faces" in printed().out
    layer.data.foreach_set("uv", (uvs + (0.5, 0)).astype(np.float32).ravel())
    labeled.data.update()
    OPS.bake()
    said = printed().out
    assert "outside of the image" in said
    assert "lies on other" not in said


def test_bake_needs_segments(settings):
    select(unwrapped(limbed()))
    assert not OPS.bake.poll()


def test_cycles_that_is_turned_off_is_named(labeled, monkeypatch):
    from wks_segment.blender.outputs import bake

    monkeypatch.setattr(bake, "BAKE_ENGINE", "NO_SUCH_ENGINE")
    with pytest.raises(RuntimeError, match="Cycles is turned off"):
        OPS.bake()
    assert [scene.name for scene in bpy.data.scenes] == ["Scene"]


# Several objects


def quad(name, left, labels=(0, 1)):
    """Two triangles that fill a quarter of the image, from a corner on the left."""
    obj = mesh_object([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [(0, 1, 2), (0, 2, 3)], name)
    corners = np.array([(0, 0), (1, 0), (1, 1), (0, 0), (1, 1), (0, 1)])
    obj.data.uv_layers.new(name="UV").data.foreach_set("uv", (0.45 * corners + (left, 0.1)).ravel())
    write_labels(obj.data, np.array(labels))
    return obj


@pytest.mark.parametrize(("second", "names"), [(0.5, ["Body ID Map"]), (0.2, ["Body ID Map", "Hat ID Map"])])
def test_objects_of_a_character_share_an_image_if_their_islands_do_not_overlap(settings, second, names):
    settings.bake_size = 64
    body, hat = quad("Body", 0.02), quad("Hat", second, (2, 3))
    hat.parent = body
    select(body, hat)
    assert OPS.bake() == {"FINISHED"}
    assert sorted(bpy.data.images.keys()) == names
    for obj in (body, hat):
        together = [other for other in (body, hat) if image_of(other) is image_of(obj)]
        assert wrong_pixels(image_of(obj), together, Style())[0] == 0
    OPS.clear()
    assert not bpy.data.images


def test_characters_have_an_image_each(settings):
    settings.bake_size = 64
    select(quad("One", 0.02), quad("Two", 0.5))
    OPS.bake()
    assert sorted(bpy.data.images.keys()) == ["One ID Map", "Two ID Map"]


# Characters as artists make them


@pytest.mark.parametrize(("name", "unwrap"), [("Leela", False), ("Fox", True), ("King", True)])
def test_every_pixel_of_a_real_character_has_the_color_of_its_face(command, tmp_path, name, unwrap):
    path, model = CHARACTERS / f"{name}.glb", tmp_path / "model.json"
    if not path.is_file():
        pytest.skip(f"{path.name} is not here")
    quick = ("--frames", 2, "--eigenpairs", 60)
    assert command("learn", path, *quick, "--model", model).code == 0
    blend, output = tmp_path / "baked.blend", tmp_path / "map.png"
    options = ("--model", model, "--size", 1024, "--blend", blend, "--output", output, "--json")
    if unwrap:
        refused = command("bake", path, *options)
        assert (refused.code, "--unwrap" in refused.err, list(tmp_path.iterdir())) == (1, True, [model])
    done = command("bake", path, *options, *["--unwrap"] * unwrap)
    assert done.code == 0, done
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    baked = [obj for obj in bpy.data.objects if obj.type == "MESH" and labels_on(obj.data) is not None]
    total = 0
    for image in bpy.data.images:
        if image.name not in done.result["files"]:
            continue
        saved = bpy.data.images.load(done.result["files"][image.name])
        saved.colorspace_settings.name = "Non-Color"
        np.testing.assert_array_equal(pixels(saved), pixels(image))
        wrong, inside = wrong_pixels(saved, [obj for obj in baked if image_of(obj) is image], Style())
        assert wrong == 0
        total += inside
    assert total > 0.1 * 1024**2


# Command line


@pytest.fixture
def file(labeled, tmp_path):
    """A file with a labeled object that has a UV map."""
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "labeled.blend"))
    return tmp_path / "labeled.blend"


def test_command_bakes_labels_in_the_file(file, command, tmp_path):
    output = tmp_path / "map.png"
    done = command("bake", file, "--output", output, "--size", 128, "--palette", "color_blind", "--json")
    assert done.code == 0, done
    assert done.result["files"] == {"Limbed ID Map": str(output)}
    assert list(done.result["parts"]) == [f"Segment {i}" for i in range(1, 5)]
    saved = bpy.data.images.load(str(output))
    saved.colorspace_settings.name = "Non-Color"
    assert tuple(saved.size) == (128, 128)
    wrong, inside = wrong_pixels(saved, [bpy.data.objects["Limbed"]], Style(palette="color_blind"))
    assert (wrong, inside > 0.2 * 128**2) == (0, True)


def test_command_writes_an_image_for_each_object_if_uv_maps_overlap(settings, command, tmp_path):
    body, hat = quad("Body", 0.02), quad("Hat", 0.2, (2, 3))
    hat.parent = body
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "two.blend"))
    done = command("bake", tmp_path / "two.blend", "--output", tmp_path / "map.png", "--size", 64, "--json")
    assert sorted(done.result["files"].values()) == [str(tmp_path / f"map_{name}.png") for name in ("Body", "Hat")]
    assert sorted(path.name for path in tmp_path.glob("*.png")) == ["map_Body.png", "map_Hat.png"]


def test_command_without_segments_or_model_is_refused(command, tmp_path):
    unwrapped(limbed())
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "plain.blend"))
    done = command("bake", tmp_path / "plain.blend", "--output", tmp_path / "map.png")
    assert (done.code, "with --model" in done.err) == (1, True)
    done = command("bake", tmp_path / "plain.blend", "--output", tmp_path / "map.jpg")
    assert (done.code, ".png" in done.err) == (1, True)
    assert [path.name for path in tmp_path.iterdir()] == ["plain.blend"]


def test_the_id_map_opens_in_an_image_editor(labeled):
    with pytest.raises(RuntimeError, match="No ID map yet: use Bake ID Map"):
        OPS.show_id_map()
    OPS.bake()
    image = bpy.data.images["Limbed ID Map"]
    before = scene_snapshot()
    window = bpy.context.window_manager.windows[0]
    area = next(area for area in window.screen.areas if area.type == "VIEW_3D")
    with bpy.context.temp_override(window=window, screen=window.screen, area=area):
        area.type = "IMAGE_EDITOR"
        assert OPS.show_id_map() == {"FINISHED"}
        assert area.spaces.active.image == image
        area.type = "VIEW_3D"
    assert not changes(before, scene_snapshot())
