"""Every operator on outputs: Undo and Clear give back exactly what was there."""

import bpy
import pytest
from builders import (
    changes,
    limbed,
    scene_snapshot,
    select,
)
from painted_objects import FACE_SETS, painted, undone

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment


@pytest.mark.parametrize(
    ("operator", "options"),
    [
        ("bake", {}),
        ("unwrap", {"method": "SEAMS"}),
        ("unwrap", {"method": "SMART"}),
        ("separate", {}),
        ("segments_from", {"source": "FACE_SETS"}),
        ("segments_from", {"source": "MATERIALS"}),
        ("segments_from", {"source": "VERTEX_GROUPS"}),
        ("clear", {}),
    ],
    ids=str,
)
@pytest.mark.parametrize("who", ["plain", "painted"])
def test_undo_restores_everything(settings, who, operator, options):
    obj = limbed()
    if who == "painted":
        painted(obj)
    select(obj)
    settings.write_materials = settings.write_face_sets = settings.write_seams = settings.bake_unwrap = True
    settings.write_ucupaint = True
    settings.vertex_groups, settings.bake_size, settings.source = "hard", 64, "OBJECTS"
    settings.n_segments = 2  # each is packed by itself, for seconds
    assert OPS.learn() == {"FINISHED"}
    OPS.unwrap()
    # Segments From changes something only after a correction.
    obj.data.attributes[FACE_SETS].data[5].value = 77
    obj.data.polygons[6].material_index = 0
    obj.vertex_groups.new(name="New").add(list(obj.data.polygons[7].vertices), 9.0, "REPLACE")
    obj.data.update()
    done, left = undone(getattr(OPS, operator), **options)
    assert done
    assert not left


def test_clear_after_all_outputs_restores_everything(obj, settings):
    before = scene_snapshot()
    settings.write_materials = settings.write_face_sets = settings.write_seams = settings.bake_unwrap = True
    settings.write_ucupaint = True
    settings.vertex_groups, settings.bake_size = "soft", 64
    for _ in range(2):
        for operator in (OPS.learn, OPS.unwrap, OPS.bake, OPS.separate, OPS.clear):
            assert operator() == {"FINISHED"}
        before["model"] = scene_snapshot()["model"]
        assert not changes(before, scene_snapshot())


def test_new_labels_take_back_outputs_that_are_turned_off(obj, settings):
    select(obj)
    OPS.learn()
    without = scene_snapshot()
    settings.write_materials = settings.write_face_sets = settings.write_seams = True
    OPS.learn()
    assert changes(without, scene_snapshot())
    settings.write_materials = settings.write_face_sets = settings.write_seams = False
    OPS.learn()
    assert not changes(without, scene_snapshot())
