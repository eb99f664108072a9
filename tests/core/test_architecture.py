"""The rooms and their doors: `blender` uses `core`, `core` uses nothing of ours."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[2] / "wks_segment"
BLENDERS_OWN = {"bpy", "bmesh", "mathutils", "bpy_extras", "gpu", "blf", "aud"}
CHAIN = [
    "memory",
    "mesh",
    "repair",
    "pieces",
    "refine",
    "surface",
    "laplacian",
    "intrinsic",
    "factor",
    "dense",
    "coarse",
    "hierarchy",
    "lanczos",
    "spectrum",
    "signature",
    "mixture",
    "explained",
    "smoothing",
    "regions",
    "shape",
    "cut",
    "pose_signature",
    "cache",
    "description",
    "workpiece",
    "posed_mesh",
    "parts",
    "grouping",
    "layout",
    "learning",
    "region_atlas",
    "labeller",
    "part_notes",
    "model_file",
    "segmentation",
    "ranking",
]


def imports(path):
    """(level, module) of every import in a file."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from ((0, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            names = [node.module] if node.module else [alias.name for alias in node.names]
            yield from ((node.level, name) for name in names)


@pytest.mark.parametrize("path", sorted((PACKAGE / "core").glob("*.py")), ids=lambda path: path.stem)
def test_core_knows_neither_blender_nor_the_other_rooms(path):
    for level, module in imports(path):
        assert module.split(".")[0] not in BLENDERS_OWN | {"wks_segment"}, f"{path.name} imports {module}"
        assert level <= 1, f"{path.name} reaches out of core for {module}"


@pytest.mark.parametrize("path", sorted((PACKAGE / "batch").glob("*.py")), ids=lambda path: path.stem)
def test_batch_uses_core_only(path):
    """What it runs is a command line."""
    for level, module in imports(path):
        assert module.split(".")[0] not in BLENDERS_OWN | {"wks_segment"}, f"{path.name} imports {module}"
        assert level <= 1 or (level == 2 and module.split(".")[0] == "core"), f"{path.name} imports {module}"


def test_only_the_command_line_uses_batch():
    for path in (PACKAGE / "blender").rglob("*.py"):
        if path.parent.name != "commands":
            assert not any(module.split(".")[0] == "batch" for _, module in imports(path)), path


@pytest.mark.parametrize("name", CHAIN)
def test_core_points_one_way(name):
    """A module uses only those that come before it on the way from mesh to segments."""
    earlier = set(CHAIN[: CHAIN.index(name)])
    for level, module in imports(PACKAGE / "core" / f"{name}.py"):
        if level == 1:
            assert module.split(".")[0] in earlier, f"{name} imports {module}"


def test_every_core_module_is_on_the_chain():
    assert {path.stem for path in (PACKAGE / "core").glob("*.py")} - {"__init__"} == set(CHAIN)


def test_core_runs_without_bpy():
    code = "import sys; sys.modules['bpy'] = None; import wks_segment.core; print(len(wks_segment.core.__all__))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, cwd=PACKAGE.parent)
    assert done.returncode == 0, done.stderr


def test_no_pickle_eval_or_swallowed_error():
    for path in PACKAGE.rglob("*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        for node in ast.walk(tree):
            if isinstance(node, ast.ExceptHandler):
                assert node.type is not None, f"{path}:{node.lineno} bare except"
                assert not all(isinstance(s, ast.Pass) for s in node.body), f"{path}:{node.lineno} swallows an error"
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                assert node.func.id not in {"eval", "exec"}, f"{path}:{node.lineno}"
        assert not {module for _, module in imports(path)} & {"pickle", "shelve", "marshal"}, path
