"""Characters as artists make them: loose parts, seams, bone shapes, several meshes on one armature."""

from pathlib import Path

import bpy
import numpy as np
import pytest

CHARACTERS = Path(__file__).resolve().parents[4] / "shared" / "data" / "characters"


@pytest.mark.parametrize("name", ["Fox", "RobotExpressive"])
def test_real_character_is_segmented(command, tmp_path, name):
    path, output = CHARACTERS / f"{name}.glb", tmp_path / "out.blend"
    if not path.is_file():
        pytest.skip(f"{path.name} is not here")
    done = command("segment", path, "--frames", 3, "--eigenpairs", 60, "--output", output, "--json")
    assert done.code == 0, done
    assert len(done.result["poses"]) == 3
    assert not any("the same" in warning for warning in done.result["warnings"])
    assert 4 <= done.result["segments"] <= 8
    bpy.ops.wm.open_mainfile(filepath=str(output))
    labeled = [obj for obj in bpy.data.objects if obj.type == "MESH" and "wks_segment" in obj.data.attributes]
    assert labeled
    seen = set()
    for obj in labeled:
        values = np.empty(len(obj.data.polygons), dtype=np.int32)
        obj.data.attributes["wks_segment"].data.foreach_get("value", values)
        seen |= set(values.tolist())
    assert len(seen) == done.result["segments"]
