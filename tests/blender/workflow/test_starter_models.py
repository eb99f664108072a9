"""Models that come with the extension: named parts of a mesh by one button."""

import bpy
import numpy as np
import pytest
from builders import changes, labels_of, limbed, scene_snapshot, select

from wks_segment.blender.cli.creature import build_creature
from wks_segment.blender.workflow import model_library

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment
SHIPPED = model_library.STARTER_FOLDER


@pytest.fixture
def starter(settings, starter_folder):
    """A starter model of the ball with limbs, in a scene that knows nothing of it, with an unseen mesh selected."""
    obj = limbed("Taught")
    for name in ("Body", "Limb"):
        obj.data.materials.append(bpy.data.materials.new(name))
    for polygon in obj.data.polygons:
        polygon.material_index = int(polygon.center.x > 1.3)
    settings.parts_from = "MATERIALS"
    select(obj)
    OPS.teach()
    path = starter_folder / "ball.json"
    OPS.save_model(filepath=str(path))
    OPS.remove_model()
    OPS.clear()
    bpy.data.objects.remove(obj)
    settings.n_segments = 4
    select(limbed("Unseen", 0.2))
    return path


def names_of(settings):
    return [item.name for item in settings.segments]


def wide_grid():
    """A shape that no model has seen."""
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=30, y_subdivisions=30)
    grid = bpy.context.object
    grid.scale.x = 5
    select(grid)
    return grid


def test_one_button_gives_named_parts(starter, settings):
    assert OPS.name_parts() == {"FINISHED"}
    assert names_of(settings) == ["Body", "Limb"]
    unseen = bpy.data.objects["Unseen"]
    on_limb = np.array([polygon.center.x > 1.3 for polygon in unseen.data.polygons])
    assert np.mean((labels_of(unseen) == 1) == on_limb) > 0.95
    assert [row.name for row in settings.models] == ["Ball"]
    assert settings.n_segments == 2


def test_the_shipped_file_stays_as_it_is(starter, settings):
    before = starter.read_bytes()
    OPS.name_parts()
    settings.segments[0].name = "Belly"
    settings.models[0].name = "Renamed"
    OPS.name_parts()
    assert starter.read_bytes() == before
    assert [row.name for row in settings.models] == ["Renamed"], "the same model is added once"
    assert names_of(settings) == ["Belly", "Limb"]


def test_undo_restores_everything(starter, settings):
    bpy.ops.ed.undo_push(message="before")
    before = scene_snapshot()
    OPS.name_parts()
    bpy.ops.ed.undo_push(message="named")
    assert changes(before, scene_snapshot())
    bpy.ops.ed.undo()
    assert not changes(before, scene_snapshot())


def test_a_shape_of_another_kind_gets_a_warning(starter, settings, printed):
    wide_grid()
    printed()
    assert OPS.name_parts() == {"FINISHED"}
    assert '"Grid" is unlike all that the starter models (Ball) learned: check the parts' in printed().out
    select(bpy.data.objects["Unseen"])
    OPS.name_parts()
    assert "is unlike" not in printed().out


def test_a_starter_that_fits_is_first_in_the_ranking(starter, settings):
    settings.preset = "default"
    select(*(limbed(f"Own {i}", bend) for i, bend in enumerate((0.0, 0.1, 0.3))))
    OPS.learn()
    select(bpy.data.objects["Unseen"])
    OPS.rank()
    assert settings.ranking[0].name == "Ball"
    assert len(settings.ranking) == 2
    assert OPS.apply_ranked(index=0) == {"FINISHED"}
    assert names_of(settings) == ["Body", "Limb"]
    wide_grid()
    OPS.rank()
    assert not any(item.fits for item in settings.ranking)


def test_the_ranking_needs_no_other_model(starter):
    assert OPS.rank.poll()
    assert OPS.rank() == {"FINISHED"}


def test_an_incomplete_copy_of_the_extension_says_so(settings):
    select(limbed())
    with pytest.raises(RuntimeError, match="has no starter models: install it again"):
        OPS.name_parts()


def test_a_live_setting_changes_named_parts(starter, settings):
    OPS.name_parts()
    settings.smoothness = 0.5
    assert OPS.update() == {"FINISHED"}
    assert names_of(settings) == ["Body", "Limb"]


def test_starters_are_in_the_menu_of_models(starter):
    assert model_library.starters() == {"Ball": starter}


def test_the_shipped_models_name_the_parts_of_the_creature(settings, monkeypatch, printed):
    """The creature of the demo has four legs and a tail, and no model has seen it."""
    monkeypatch.setattr(model_library, "STARTER_FOLDER", SHIPPED)
    body = build_creature(bpy.context.scene)
    settings.source = "OBJECTS"
    select(body)
    assert OPS.name_parts() == {"FINISHED"}
    assert [row.name for row in settings.models] == ["Quadruped"]
    assert {"Head", "Torso", "Tail", "Upper Hind Leg"} <= set(names_of(settings))
