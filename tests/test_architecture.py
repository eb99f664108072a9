"""The architecture: layers of packages, what each may import, and what no code of ours does."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / "wks_segment"
BLENDERS_OWN = {"bpy", "bmesh", "mathutils", "bpy_extras", "gpu", "blf", "aud"}
LAYERS = {
    "core": [
        {"mesh"},
        {"spectral"},
        {"geometry"},
        {"poses"},
        {"learning"},
        {"labeling"},
        {"user_labels"},
        {"model_file"},
        {"segmentation"},
        {"ranking"},
    ],
    "blender": [
        {"errors"},
        {"parts"},
        {"props"},
        {"scene"},
        {"outputs"},
        {"workflow"},
        {"render", "ui"},
        {"operators", "cli"},
        {"registration"},
    ],
}
"""Lowest layer first. Packages of one layer do not import each other."""


def imports(path):
    """(package and module, line) of every import of ours in a file, as parts of its absolute name."""
    package = path.relative_to(PACKAGE.parent).with_suffix("").parts[:-1]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            base = package[: len(package) + 1 - node.level] if node.level else ()
            module = (*base, *(node.module.split(".") if node.module else ()))
            for alias in node.names:
                yield (*module, alias.name), node.lineno
        elif isinstance(node, ast.Import):
            for alias in node.names:
                yield tuple(alias.name.split(".")), node.lineno


@pytest.mark.parametrize("name", LAYERS)
def test_imports_point_down(name):
    level = {package: i for i, layer in enumerate(LAYERS[name]) for package in layer}
    wrong = []
    for path in sorted((PACKAGE / name).rglob("*.py")):
        mine = path.relative_to(PACKAGE / name).with_suffix("").parts[0]
        if mine == "__init__":
            continue
        for target, line in imports(path):
            if target[:2] != ("wks_segment", name) or len(target) < 3 or target[2] == mine:
                continue
            if target[2] in level and not level[target[2]] < level[mine]:
                wrong.append(f"{path.relative_to(PACKAGE)}:{line} imports {'.'.join(target[2:])}")
    assert not wrong, "\n".join(wrong)


def test_no_import_circles():
    """Not even behind TYPE_CHECKING or inside a function."""
    graph = {}
    modules = {path.relative_to(PACKAGE.parent).with_suffix("").parts: path for path in PACKAGE.rglob("*.py")}
    for name, path in modules.items():
        if name[-1] != "__init__":
            graph[name] = {
                t for target, _ in imports(path) for t in (target, target[:-1]) if t in modules and t != name
            }
    while leaves := [name for name, used in graph.items() if not used & graph.keys()]:
        for name in leaves:
            del graph[name]
    assert not graph, sorted(".".join(name) for name in graph)


def test_core_uses_neither_blender_nor_other_packages_of_ours():
    for path in sorted((PACKAGE / "core").rglob("*.py")):
        for target, line in imports(path):
            assert target[0] not in BLENDERS_OWN, f"{path}:{line}"
            assert target[0] != "wks_segment" or target[1] == "core", f"{path}:{line}"


def test_batch_uses_core_only():
    """What it runs is a command line."""
    for path in sorted((PACKAGE / "batch").rglob("*.py")):
        for target, line in imports(path):
            assert target[0] not in BLENDERS_OWN, f"{path}:{line}"
            assert target[0] != "wks_segment" or target[1] in ("core", "batch"), f"{path}:{line}"


def test_only_the_command_line_uses_batch():
    for path in (PACKAGE / "blender").rglob("*.py"):
        if "cli" not in path.parts:
            assert not any(target[:2] == ("wks_segment", "batch") for target, _ in imports(path)), path


def test_core_runs_without_bpy():
    code = "import sys; sys.modules['bpy'] = None; import wks_segment.core; print(len(wks_segment.core.__all__))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, cwd=PACKAGE.parent)
    assert done.returncode == 0, done.stderr


def test_no_pickle_eval_or_swallowed_error():
    for path in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ExceptHandler):
                assert node.type is not None, f"{path}:{node.lineno} bare except"
                assert not all(isinstance(s, ast.Pass) for s in node.body), f"{path}:{node.lineno} swallows an error"
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                assert node.func.id not in {"eval", "exec"}, f"{path}:{node.lineno}"
        assert not {target[0] for target, _ in imports(path)} & {"pickle", "shelve", "marshal"}, path


def test_one_module_reads_and_writes_arrays_of_blender():
    """`foreach_get` and `foreach_set` are fast only with an array of the property's type, which the wrappers give."""
    for path in (PACKAGE / "blender").rglob("*.py"):
        if path.relative_to(PACKAGE).as_posix() != "blender/scene/attributes.py":
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.Attribute):
                    assert node.attr not in {"foreach_get", "foreach_set"}, f"{path}:{node.lineno}"
