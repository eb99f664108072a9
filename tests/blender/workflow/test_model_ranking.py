"""Which model fits: in the window's list, on the command line, and the paper's protocol on a folder."""

from types import SimpleNamespace
from unittest.mock import MagicMock

import bpy
import numpy as np
import pytest
from builders import changes, labels_of, limbed, limbed_rigged, mesh_object, scene_snapshot, select
from live_settings import click

from wks_segment.blender.operators import save_model
from wks_segment.blender.ui import models_panel
from wks_segment.blender.workflow import model_library, model_ranking
from wks_segment.core import PoseSegmentation

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment
QUICK = ("--eigenpairs", 30, "--energies", 40, "--segments", 4)


def box(name="Box", bend=0.0):
    """Another class: long, with sharp edges, bent a little."""
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=6, y_subdivisions=40)
    grid = bpy.context.object
    points = np.array([vertex.co for vertex in grid.data.vertices]) * (0.3, 3.0, 1.0)
    points[:, 2] = bend * points[:, 1] ** 2
    faces = [list(polygon.vertices) for polygon in grid.data.polygons]
    bpy.data.objects.remove(grid)
    return mesh_object(points, faces, name)


@pytest.fixture
def two(settings):
    """Models of two classes, the boxes' in use; and an unseen shape of the other one, selected."""
    select(*(limbed(f"Limbed {i}", bend) for i, bend in enumerate((0.0, 0.3, 0.6))))
    OPS.learn()
    settings.models[0].name = "Limbed"
    settings.segments[0].name = "Head"
    select(*(box(f"Box {i}", bend) for i, bend in enumerate((0.0, 0.1, 0.2))))
    OPS.learn()
    settings.models[1].name = "Box"
    select(limbed("Unseen", 0.45))
    return settings


def test_models_are_ranked(two):
    assert OPS.rank() == {"FINISHED"}
    assert [item.name for item in two.ranking] == ["Limbed", "Box"]
    assert two.ranking[0].probability > 0.95
    assert two.verdict == "Unseen: Limbed fits, with certainty"
    assert two.models[two.used_model].name == "Box", "only the ranking has changed"


def test_ranking_changes_nothing_else(two):
    before = scene_snapshot()
    OPS.rank()
    assert not changes(before, scene_snapshot())


def test_best_model_is_applied_by_one_click(two):
    OPS.rank()
    select(bpy.data.objects["Box 0"])
    assert OPS.apply_ranked(index=0) == {"FINISHED"}
    assert two.models[two.used_model].name == "Limbed"
    unseen = bpy.data.objects["Unseen"]
    assert len(np.unique(labels_of(unseen))) == 4
    assert "Head" in two.notes().names.values()


def test_applying_a_ranked_model_is_one_undo_step(two):
    OPS.rank()
    click(bpy.data.objects["Unseen"])
    bpy.ops.ed.undo_push(message="ranked")
    before = scene_snapshot()
    OPS.apply_ranked(index=0)
    bpy.ops.ed.undo_push(message="applied")
    assert bpy.context.scene.wks_segment.used_model == 0
    bpy.ops.ed.undo()
    assert bpy.context.scene.wks_segment.used_model == 1
    assert not changes(before, scene_snapshot())


def test_missing_models_and_objects_are_refused(two):
    OPS.rank()
    with pytest.raises(RuntimeError, match="The ranking has only 2 models"):
        OPS.apply_ranked(index=2)
    two.models[0].name = "Renamed"
    with pytest.raises(RuntimeError, match='The model "Limbed" is gone: rank the models again'):
        OPS.apply_ranked(index=0)
    bpy.data.objects.remove(bpy.data.objects["Unseen"])
    with pytest.raises(RuntimeError, match="The ranked objects are gone: rank the models again"):
        OPS.apply_ranked(index=1)
    assert two.models[two.used_model].name == "Box"


def test_buttons_are_gray_without_a_model_or_a_ranking(settings):
    select(limbed())
    assert not OPS.rank.poll()
    assert not OPS.apply_ranked.poll()


def test_empty_model_folder_is_reported(settings, tmp_path, monkeypatch):
    from wks_segment.blender.operators import rank as operator

    for module in (model_ranking, operator):
        monkeypatch.setattr(module, "model_folder", lambda context: str(tmp_path))
    select(limbed())
    assert OPS.rank.poll()
    with pytest.raises(RuntimeError, match="No model yet: learn one, import one, or set Model Folder"):
        OPS.rank()


def test_models_of_the_folder_are_ranked_and_added_when_applied(two, tmp_path, monkeypatch):
    two.active_model = 0
    OPS.save_model(filepath=str(tmp_path / "folder limbed.json"))
    (tmp_path / "broken.json").write_text("{}")
    for _ in range(2):
        OPS.remove_model()
    for module in (model_ranking, models_panel):
        monkeypatch.setattr(module, "model_folder", lambda context: str(tmp_path))
    from wks_segment.blender.operators import rank as operator

    monkeypatch.setattr(operator, "model_folder", lambda context: str(tmp_path))
    assert OPS.rank() == {"FINISHED"}
    assert [item.name for item in two.ranking] == ["folder limbed"]
    assert OPS.apply_ranked() == {"FINISHED"}
    assert [row.name for row in two.models] == ["folder limbed"]
    assert two.notes().names == {0: "Head"}
    assert two.ranking[0].path == ""
    assert OPS.apply_ranked() == {"FINISHED"}
    assert len(two.models) == 1


def test_panel_shows_the_ranking(two):
    OPS.rank()
    layout = MagicMock()
    models_panel.draw_ranking(layout, two)
    column = layout.column.return_value
    assert column.label.call_args_list[0].kwargs["text"] == "Unseen: Limbed fits, with certainty"
    row = column.row.return_value
    assert [call.kwargs["text"] for call in row.label.call_args_list] == ["Limbed", "Box"]
    assert [call.kwargs["text"] for call in row.operator.call_args_list] == ["Use", "Use"]
    first, second = [call.kwargs["text"] for call in row.row.return_value.label.call_args_list]
    assert first.endswith(" %")
    assert second == "does not fit"


# Command line


@pytest.fixture
def folder(two, tmp_path):
    """A folder of two models and a broken one."""
    folder = tmp_path / "models"
    folder.mkdir()
    for row in list(two.models):
        OPS.use_model(name=row.name)
        OPS.save_model(filepath=str(folder / f"{row.name}.json"))
    (folder / "broken.json").write_text("[]")
    return folder


def save(path, *objects):
    select(*objects)
    bpy.ops.wm.obj_export(filepath=str(path), export_selected_objects=True)
    return path


def test_rank_a_file(command, folder, tmp_path):
    path = save(tmp_path / "unseen.obj", bpy.data.objects["Unseen"])
    other = save(tmp_path / "other.obj", box("Other", 0.15))
    done = command("rank", path, other, "--models", folder, "--json")
    assert done.code == 0, done.err
    first, second = done.result["rankings"]
    assert [model["name"] for model in first["models"]] == ["Limbed", "Box"]
    assert first["verdict"] == "sure"
    assert second["models"][0]["name"] == "Box"
    (warning,) = done.result["warnings"]
    assert "broken.json" in warning
    text = command("rank", path, "--models", folder).out
    assert "Limbed fits, with certainty" in text
    assert text.index("Limbed") < text.index("Box")


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        ((), 2, "give FILE and --models DIR, or --evaluate DIR"),
        (("a.obj",), 2, "give FILE and --models DIR"),
        (("a.obj", "--evaluate", "."), 2, "neither FILE nor --models"),
        (("--evaluate", ".", "--frames", "1:20:5"), 2, "takes only a COUNT"),
        (("--evaluate", "missing"), 1, "missing: there is no such folder"),
        (("a.obj", "--models", "missing"), 1, "missing: there is no such folder"),
        (("a.obj", "--models", "."), 1, "no model in this folder that can be used"),
    ],
)
def test_wrong_usage_is_reported(command, arguments, code, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = command("rank", *arguments)
    assert done.code == code
    assert message in done.err


@pytest.fixture
def classes(scene, tmp_path):
    """Two classes with a file a shape, one of an animated file, one too small, and what is no shape."""
    root = tmp_path / "classes"
    for name, make in (("limbed", limbed), ("box", box)):
        (root / name).mkdir(parents=True)
        for i in range(5):
            save(root / name / f"{i}.obj", make(f"{name} {i}", 0.1 * i))
    (root / "box" / "broken.glb").write_bytes(b"no glb")
    (root / "lonely").mkdir()
    save(root / "lonely" / "0.obj", bpy.data.objects["box 0"])
    (root / "notes.txt").write_text("no class")
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    limbed_rigged()
    bpy.ops.wm.save_as_mainfile(filepath=str(root / "walker.blend"), copy=True)
    return root


def test_evaluate_runs_the_papers_retrieval(command, classes, tmp_path, needs_rendering):
    picture = tmp_path / "matrix.png"
    arguments = ("rank", "--evaluate", classes, "--learned", 3, "--frames", 5, *QUICK, "--picture", picture, "--json")
    done = command(*arguments)
    assert done.code == 0, done.err
    assert done.result["classes"] == ["box", "limbed", "walker"]
    confusion = np.array(done.result["confusion"])
    assert confusion.shape == (3, 3)
    assert (confusion.sum(axis=1) == 2).all()
    assert confusion[0, 0] == 2, "nothing else is like a box"
    assert done.result["asked"] == 6
    assert done.result["right"] == np.trace(confusion)
    assert any("broken.glb" in warning for warning in done.result["warnings"])
    assert any("lonely" in warning for warning in done.result["warnings"])
    image = bpy.data.images.load(str(picture))
    assert min(image.size) > 200
    assert len(np.unique(np.array(image.pixels).reshape(-1, 4)[:, :3].round(1), axis=0)) > 3


def test_evaluate_needs_two_classes(command, classes):
    for name in ("box", "lonely"):
        for path in (classes / name).iterdir():
            path.unlink()
    (classes / "walker.blend").unlink()
    done = command("rank", "--evaluate", classes, "--learned", 3, *QUICK)
    assert done.code == 1
    assert "there are 1 classes that can be used, and at least two are needed" in done.err


def test_unreadable_model_is_left_out(two):
    two.models[0].model = "{}"
    OPS.rank()
    assert [item.name for item in two.ranking] == ["Box"]
    assert PoseSegmentation.from_json(two.model)
    assert dict(model_library.all_of(two)).keys() == {"Limbed", "Box"}


def test_copies_of_a_model_count_once(two):
    two.active_model = 0
    for _ in range(2):
        OPS.duplicate_model()
        two.n_segments = 3
        OPS.apply()
    click(bpy.data.objects["Unseen"])
    assert OPS.rank() == {"FINISHED"}
    assert [item.name for item in two.ranking] == ["Limbed", "Box"]
    assert two.ranking[0].probability > 0.95


def test_applying_a_model_that_does_not_fit_says_so(two, printed):
    printed()
    assert OPS.apply() == {"FINISHED"}
    assert '"Box" does not fit "Unseen": "Limbed" fits better' in printed().out
    two.active_model = 0
    assert OPS.apply() == {"FINISHED"}
    assert "fit" not in printed().out


def test_missing_segments_of_an_applied_model_are_explained(two, printed):
    two.active_model = 0
    two.min_share = 20.0
    printed()
    assert OPS.apply() == {"FINISHED"}
    assert "of the model's 4 segments are not on these objects" in printed().out


def test_export_proposes_the_name_of_the_model(two, monkeypatch):
    two.models[1].name = "Long Box/2"
    operator = SimpleNamespace(filepath="", filename_ext=".json")
    cls = save_model.WKS_SEGMENT_OT_save_model
    monkeypatch.setattr(
        save_model, "super", lambda: SimpleNamespace(invoke=lambda *_: {"RUNNING_MODAL"}), raising=False
    )
    assert cls.invoke(operator, bpy.context, None) == {"RUNNING_MODAL"}
    assert operator.filepath == "Long_Box_2.json"
