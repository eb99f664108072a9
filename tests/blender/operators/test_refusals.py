"""Errors: the operator says what is wrong, and nothing in the file changes."""

import bpy
import pytest
from builders import (
    changes,
    error_of,
    labels_of,
    limbed,
    limbed_poses,
    limbed_rigged,
    mesh_object,
    refuses,
    scene_snapshot,
    select,
)

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment


def test_not_finite_coordinate(learned):
    broken = limbed("Broken")
    broken.data.vertices[3].co.z = float("nan")
    broken.data.update()
    select(learned[0], broken)
    refuses(OPS.learn, '"Broken".*vertex 3 .*not finite')
    refuses(OPS.apply, '"Broken".*vertex 3 .*not finite')


def test_object_without_faces(learned):
    select(learned[0], mesh_object([(0, 0, 0), (1, 0, 0)], [], "Wire"))
    refuses(OPS.learn, '"Wire" has no faces')
    refuses(OPS.apply, '"Wire" has no faces')


def test_linked_object(tmp_path):
    limbed("Foreign")
    path = tmp_path / "library.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True)
    bpy.data.objects.remove(bpy.data.objects["Foreign"])
    with bpy.data.libraries.load(str(path), link=True) as (source, target):
        target.objects = source.objects
    bpy.context.scene.collection.objects.link(target.objects[0])
    select(target.objects[0])
    refuses(OPS.learn, '"Foreign" is linked from another file')


def test_clear_where_the_segments_are_in_another_file(learned, tmp_path):
    path = tmp_path / "library.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True)
    with bpy.data.libraries.load(str(path), link=True) as (_, target):
        target.objects = [learned[0].name]
    linked = target.objects[0]
    bpy.context.scene.collection.objects.link(linked)
    select(linked)
    refuses(OPS.clear, "nothing to clear.*in another file")
    select(linked, learned[0])
    assert OPS.clear() == {"FINISHED"}
    assert "wks_segment" not in learned[0].data.attributes


def test_several_characters_for_frames(settings):
    settings.source = "FRAMES"
    select(*limbed_poses(0, 0.5))
    bpy.context.view_layer.objects.active = None
    refuses(OPS.learn, "2 characters are selected")


def test_frame_range_that_ends_before_it_begins(settings):
    settings.source, settings.use_frame_range, settings.frame_first, settings.frame_last = "FRAMES", True, 20, 10
    select(limbed_rigged())
    refuses(OPS.learn, r"ends \(10\) before it begins \(20\)")


def test_object_without_shape_keys(settings):
    settings.source = "SHAPE_KEYS"
    select(limbed())
    refuses(OPS.learn, '"Limbed" has no shape keys')


def test_active_character_gives_the_frames(settings):
    settings.source = "FRAMES"
    obj, other = limbed_rigged(), limbed("Other")
    select(obj, other)
    for active in (obj, obj.parent):
        bpy.context.view_layer.objects.active = active
        assert OPS.learn() == {"FINISHED"}
        assert labels_of(obj) is not None
        assert "wks_segment" not in other.data.attributes


def test_modifier_that_hides_the_origin_of_faces(learned):
    learned[2].modifiers.new("Remesh", "REMESH")
    refuses(OPS.learn, '"Pose 2".*modifier')


def test_surface_that_the_core_refuses_is_named(learned):
    """A needle whose short edge is none."""
    speck = mesh_object([(0, 0, 0), (1, 0, 0), (1, 1e-7, 0)], [(0, 1, 2)], "Speck")
    select(learned[0], speck)
    refuses(OPS.learn, '"Speck": every face of the mesh collapses')
    refuses(OPS.apply, '"Speck": every face of the mesh collapses')


def test_single_triangle_is_refused(settings):
    triangle = mesh_object([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)], "Triangle")
    select(triangle)
    refuses(OPS.learn, r"too few faces \(1\) for")


def test_more_segments_than_distinct_signatures(settings):
    """All signatures of a regular tetrahedron's refined surface repeat 24 times."""
    corners = [(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)]
    solid = mesh_object(corners, [(0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2)], "Solid")
    settings.n_segments, settings.n_eigenpairs = 64, 20
    select(solid)
    before = scene_snapshot()
    refused = error_of(OPS.learn)
    if refused:  # either outcome is right, a traceback is not
        assert "segments" in refused
        assert "Traceback" not in refused
        assert not changes(before, scene_snapshot())
    else:
        assert labels_of(solid).max() < 64


def test_damaged_model_in_the_scene(learned, settings):
    settings.model = settings.model[: len(settings.model) // 2]
    refuses(OPS.apply, "The model in this file cannot be used")
