"""On any mesh, the operators finish, or refuse with a reason and change nothing."""

import bpy
import numpy as np
import pytest
from builders import changes, limbed, mesh_object, scene_snapshot, select
from defects import any_mesh
from hypothesis import given
from tally import count

OPS = bpy.ops.wks_segment


@pytest.fixture(scope="module")
def model_file(extension, tmp_path_factory):
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    settings = bpy.context.scene.wks_segment
    settings.n_segments, settings.n_eigenpairs, settings.n_energies = 3, 20, 20
    select(limbed())
    assert OPS.learn() == {"FINISHED"}
    path = tmp_path_factory.mktemp("models") / "model.json"
    assert OPS.save_model(filepath=str(path)) == {"FINISHED"}
    return path


def ended(operator):
    """How an operator ended, after checking that a refusal has a reason and changes nothing."""
    before = scene_snapshot()
    try:
        operator()
    except RuntimeError as error:
        reason = str(error)
        assert reason.startswith("Error: "), reason
        assert len(reason) > 30, reason
        assert "Traceback" not in reason, reason
        assert not changes(before, scene_snapshot())
        return "refused"
    return "labeled"


@pytest.mark.parametrize("action", ["learn", "apply"])
@given(drawn=any_mesh())
def test_operators_finish_or_refuse_and_clear_restores_everything(model_file, action, drawn):
    vertices, faces, names = drawn
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    settings = bpy.context.scene.wks_segment
    settings.n_segments, settings.n_eigenpairs, settings.n_energies = 3, 20, 20
    with np.errstate(over="ignore"):
        obj = mesh_object(vertices, faces, "Broken")
    select(obj)
    if action == "apply":
        OPS.load_model(filepath=str(model_file))
    untouched = scene_snapshot()["meshes"]
    outcome = ended(getattr(OPS, action))
    if outcome == "labeled":
        values = np.empty(len(obj.data.polygons), dtype=np.int32)
        obj.data.attributes["wks_segment"].data.foreach_get("value", values)
        assert set(values.tolist()) <= {0, 1, 2}
        assert OPS.clear() == {"FINISHED"}
    assert not changes(untouched, scene_snapshot()["meshes"])
    count(f"object, {action}", names, outcome)
