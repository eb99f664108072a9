"""Settings, the automatic number of segments, and the panel."""

from unittest.mock import MagicMock

import bpy
import pytest
from builders import (
    labels_of,
    limbed,
    limbed_poses,
    mesh_object,
    refuses,
    select,
)

from wks_segment.blender.ui import main_panel, models_panel
from wks_segment.core import PoseSegmentation

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment
BENDS = (0.0, 0.3, 0.6)


def test_every_setting_has_a_tooltip_and_numbers_have_limits(settings):
    own = [prop for prop in settings.bl_rna.properties if prop.identifier not in ("rna_type", "name")]
    assert len(own) >= 15
    for prop in own:
        assert len(prop.description) > 10, prop.identifier
        if prop.type in ("INT", "FLOAT") and prop.identifier not in ("frame_first", "frame_last", "random_state"):
            assert -1e6 < prop.hard_min < prop.hard_max < 1e6, prop.identifier


def test_settings_reach_the_model(settings):
    settings.n_segments, settings.n_eigenpairs, settings.n_energies = 5, 77, 33
    settings.covariance_type, settings.scaling, settings.random_state = "diag", "raw", 9
    model = settings.new_model()
    assert (model.n_segments, model.n_eigenpairs, model.n_energies) == (5, 77, 33)
    assert (model.covariance_type, model.scaling, model.random_state) == ("diag", "raw", 9)


def test_defaults_equal_those_of_core(scene):
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    model = bpy.context.scene.wks_segment.new_model()
    assert vars(model) == vars(PoseSegmentation())
    assert (model.n_eigenpairs, model.n_energies) == (300, 100)


def test_automatic_number_reports_certainty(settings, printed):
    settings.auto_segments = True
    select(*limbed_poses(*BENDS))
    printed()
    assert OPS.learn() == {"FINISHED"}
    model = PoseSegmentation.from_json(settings.model)
    assert (model.n_segments, 2 <= model.n_segments_ <= 16) == ("auto", True)
    (line,) = [line for line in settings.model_summary.splitlines() if line.startswith("Certainty")]
    assert line.startswith("Certainty by segments: 2 0.")
    assert line.endswith(f" ({model.n_segments_} taken)")
    assert f"{model.n_segments_} {model.grouping_.curve()[model.n_segments_ - 1]:.2f} " in line
    assert line.count("·") == 14
    said = printed().out
    assert said.index(line) < said.index("Learned: 3 poses")


def test_automatic_number_is_kept_by_export_and_apply(settings, tmp_path):
    settings.auto_segments = True
    first, other = limbed_poses(*BENDS[:2])
    select(first)
    OPS.learn()
    line = settings.model_summary.splitlines()[-1]
    OPS.save_model(filepath=str(tmp_path / "model.json"))
    settings.auto_segments = False
    OPS.load_model(filepath=str(tmp_path / "model.json"))
    assert settings.model_summary.splitlines()[-1] == line
    select(other)
    assert OPS.apply() == {"FINISHED"}
    assert labels_of(other).max() < 16


def test_fixed_number_reports_no_certainty(learned, settings):
    assert "Certainty" not in settings.model_summary


def test_automatic_number_needs_the_robust_method(settings):
    settings.auto_segments, settings.preset = True, "paper"
    select(limbed())
    refuses(OPS.learn, "needs a fixed number of segments")


def test_automatic_number_fits_a_mesh_of_few_faces(settings):
    """Eight segments would be too many for a cube; two are not."""
    settings.auto_segments, settings.n_segments = True, 8
    corners = [(x, y, z) for x in (0, 1) for y in (0, 1.5) for z in (0, 4)]
    cube = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    select(mesh_object(corners, cube))
    assert OPS.learn() == {"FINISHED"}


def drawn(panel):
    """The layout that a panel was drawn on."""
    layout = MagicMock()
    shown = type("Shown", (panel.__bases__[0],), {"layout": layout})()
    panel.draw(shown, bpy.context)
    return layout


@pytest.mark.parametrize("automatic", [False, True])
def test_number_is_gray_when_automatic(settings, automatic):
    settings.auto_segments = automatic
    column = drawn(main_panel.WKS_SEGMENT_PT_main).column.return_value
    column.prop.assert_any_call(settings, "auto_segments")
    number = column.column.return_value
    number.prop.assert_called_once_with(settings, "n_segments")
    assert number.enabled is not automatic


def test_sides_can_be_chosen_in_the_panel(settings):
    shown = drawn(main_panel.WKS_SEGMENT_PT_main).column.return_value.prop.call_args_list
    assert (settings, "sides") in [call.args for call in shown]


@pytest.mark.parametrize("materials", [False, True])
def test_outputs_can_be_chosen_in_the_panel(settings, materials):
    settings.write_materials = materials
    column = drawn(main_panel.WKS_SEGMENT_PT_outputs).column.return_value
    shown = [call.args[1] for call in column.prop.call_args_list]
    expected = {
        "palette",
        "write_colors",
        "write_ucupaint",
        "vertex_groups",
        "write_face_sets",
        "write_seams",
        "material_template",
    }
    assert expected < set(shown)
    assert column.active is materials, "the template is gray without materials"
    used = {call.args[0] for call in column.operator.call_args_list}
    assert used == {f"wks_segment.{name}" for name in ("unwrap", "separate", "transfer")}
    column = drawn(main_panel.WKS_SEGMENT_PT_bake).column.return_value
    used = {call.args[0] for call in column.operator.call_args_list}
    assert used == {"wks_segment.bake", "wks_segment.show_id_map"}


def test_panel_wraps_lines_and_keeps_pairs_together(settings):
    settings.model = "{}"
    settings.model_summary = "From Fox\nCertainty by segments: " + " · ".join(f"{i} 0.91" for i in range(2, 17))
    labels = drawn(models_panel.WKS_SEGMENT_PT_models).column.return_value.label.call_args_list
    lines = [call.kwargs["text"] for call in labels]
    assert lines[0] == "From Fox"
    assert max(map(len, lines)) <= main_panel.SIDEBAR_LETTERS
    assert all(line.count("\N{NO-BREAK SPACE}") == line.count("0.91") for line in lines)


def test_panel_has_its_own_tab_in_the_sidebar():
    main = main_panel.CLASSES[0]
    assert (main.bl_space_type, main.bl_region_type, main.bl_category) == ("VIEW_3D", "UI", "WKS")
    for child in main_panel.CLASSES[1:]:
        assert child.bl_parent_id == main.bl_idname


def test_extension_can_be_disabled_and_enabled_again(extension):
    extension.unregister()
    try:
        assert not hasattr(bpy.types.Scene, "wks_segment")
        assert not hasattr(bpy.types, "WKS_SEGMENT_OT_learn")
    finally:
        extension.register()
    assert bpy.context.scene.wks_segment.n_segments >= 2
