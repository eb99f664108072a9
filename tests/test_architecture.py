"""The architecture: layers of packages, what each may import, how large things are, and what no code of ours does."""

import ast
import functools
import io
import re
import subprocess
import sys
import tokenize
from collections import defaultdict
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / "wks_segment"
BLENDERS_OWN = {"bpy", "bmesh", "mathutils", "bpy_extras", "gpu", "blf", "aud"}
LAYERS = {
    "core": [
        {"files", "user_labels"},
        {"mesh"},
        {"uv"},
        {"spectral"},
        {"geometry"},
        {"poses"},
        {"parts"},
        {"learning"},
        {"labeling"},
        {"model_file"},
        {"segmentation"},
        {"draft", "ranking"},
    ],
    "blender": [
        {"errors", "streams"},
        {"parts"},
        {"props"},
        {"scene"},
        {"outputs"},
        {"workflow"},
        {"render", "ui"},
        {"operators", "cli"},
        {"registration", "poses", "characters"},
    ],
}
"""Lowest layer first. Packages of one layer do not import each other."""


@functools.cache
def tree_of(path):
    return ast.parse(path.read_text(encoding="utf-8"))


def imports(path):
    """(package and module, line) of every import of ours in a file, as parts of its absolute name."""
    package = path.relative_to(PACKAGE.parent).with_suffix("").parts[:-1]
    for node in ast.walk(tree_of(path)):
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


def test_rigs_use_core_only():
    for path in sorted((PACKAGE / "rigs").rglob("*.py")):
        for target, line in imports(path):
            assert target[0] not in BLENDERS_OWN, f"{path}:{line}"
            assert target[0] != "wks_segment" or target[1] in ("core", "rigs"), f"{path}:{line}"


def test_batch_uses_core_only():
    """What it runs is a command line."""
    for path in sorted((PACKAGE / "batch").rglob("*.py")):
        for target, line in imports(path):
            assert target[0] not in BLENDERS_OWN, f"{path}:{line}"
            assert target[0] != "wks_segment" or target[1] in ("core", "batch", "interruption"), f"{path}:{line}"


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
        for node in ast.walk(tree_of(path)):
            if isinstance(node, ast.ExceptHandler):
                assert node.type is not None, f"{path}:{node.lineno} bare except"
                assert not all(isinstance(s, ast.Pass) for s in node.body), f"{path}:{node.lineno} swallows an error"
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                assert node.func.id not in {"eval", "exec"}, f"{path}:{node.lineno}"
        assert not {target[0] for target, _ in imports(path)} & {"pickle", "shelve", "marshal"}, path


WRITERS = {
    "core/files/whole_file.py",
    "blender/scene/file_formats.py",  # within a whole file
    "batch/results_log.py",  # appends lines, each of them whole
    "batch/child_main.py",  # answers, in a temporary folder
    "batch/child_process.py",  # what a child prints, in a temporary folder
}


def test_files_are_written_by_one_module():
    """So that a full disk leaves what was there before."""
    for path in PACKAGE.rglob("*.py"):
        if path.relative_to(PACKAGE).as_posix() in WRITERS:
            continue
        for node in ast.walk(tree_of(path)):
            if not isinstance(node, ast.Call):
                continue
            name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            modes = {each.value for each in node.args if isinstance(each, ast.Constant)} & {"w", "x", "a", "wb", "xb"}
            assert name not in {"write_text", "write_bytes"}, f"{path}:{node.lineno}"
            assert name != "open" or not modes, f"{path}:{node.lineno}"


def test_one_module_reads_and_writes_arrays_of_blender():
    """`foreach_get` and `foreach_set` are fast only with an array of the property's type, which the wrappers give."""
    for path in (PACKAGE / "blender").rglob("*.py"):
        if path.relative_to(PACKAGE).as_posix() != "blender/scene/attributes.py":
            for node in ast.walk(tree_of(path)):
                if isinstance(node, ast.Attribute):
                    assert node.attr not in {"foreach_get", "foreach_set"}, f"{path}:{node.lineno}"


# Size and names


def trees():
    """(path below the package, syntax tree) of every module."""
    for path in sorted(PACKAGE.rglob("*.py")):
        yield path.relative_to(PACKAGE), tree_of(path)


@pytest.mark.parametrize(("name", "most"), [("core", 8), ("blender", 6)])
def test_modules_live_in_packages_by_topic(name, most):
    assert len(list((PACKAGE / name).glob("*.py"))) <= most


def test_no_file_has_more_than_400_lines():
    """Other than tables of texts."""
    long = {
        str(path.relative_to(PACKAGE)): count
        for path in PACKAGE.rglob("*.py")
        if (count := len(path.read_text(encoding="utf-8").splitlines())) > 400
        and not (path.parent.name == "ui" and path.stem.startswith(("german", "translations")))
    }
    assert not long


SET_BY_BLENDER = {"draw_item"}
"""Functions that Blender calls, with the parameters that it has chosen."""


def test_no_function_has_more_than_seven_parameters():
    """Other than constructors."""
    many = [
        f"{path}:{node.lineno} {node.name}: {len(names)}"
        for path, tree in trees()
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef)
        and node.name not in {"__init__", *SET_BY_BLENDER}
        and len(names := parameters(node) - {"self", "cls"}) > 7
    ]
    assert not many, "\n".join(many)


def parameters(function):
    given = function.args
    return {each.arg for each in (*given.posonlyargs, *given.args, *given.kwonlyargs)}


REPORTS = {"progress", "report", "tick", "step"}
"""What a function is called that is told how far a computation is."""


def inner_functions(tree):
    """Lambdas, and functions within functions."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Lambda):
            yield node
        elif isinstance(node, ast.FunctionDef):
            yield from (inner for inner in ast.walk(node) if isinstance(inner, ast.FunctionDef) and inner is not node)


def passes_progress_on(function):
    """Whether a function does nothing but hand the share that it is called with to another one."""
    body = [function.body] if isinstance(function, ast.Lambda) else function.body
    calls = [node for statement in body for node in ast.walk(statement) if isinstance(node, ast.Call)]
    for call in calls:
        called = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
        used = {node.id for each in call.args for node in ast.walk(each) if isinstance(node, ast.Name)}
        if called in REPORTS and used & parameters(function):
            return True
    return False


def test_progress_is_handed_on_by_its_class_only():
    """Neither a lambda nor an inner function rescales or renames it."""
    found = [
        f"{path}:{node.lineno}"
        for path, tree in trees()
        if path.parts != ("core", "progress.py")
        for node in inner_functions(tree)
        if passes_progress_on(node)
    ]
    assert not found, "\n".join(sorted(set(found)))


def constants(tree):
    """Names in upper case that a module gives a value."""
    for node in tree.body:
        targets = (
            node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
        )
        for target in targets:
            for name in ast.walk(target):
                if isinstance(name, ast.Name) and re.fullmatch(r"[A-Z][A-Z0-9_]+", name.id):
                    yield name.id


SHARED_NAMES = {"CLASSES"}
"""With one meaning: the classes of a module that Blender registers."""


def test_public_constants_have_names_of_their_own():
    modules = defaultdict(set)
    for path, tree in trees():
        for name in constants(tree):
            modules[name].add(str(path))
    shared = {name: sorted(paths) for name, paths in modules.items() if len(paths) > 1 and name not in SHARED_NAMES}
    assert not shared


OTHERS_SPELL_SO = {"centre", "cancelled"}
"""A key of model files and the attribute that it holds; Blender's and Python's word for what was canceled."""


def test_names_in_the_code_are_spelled_as_in_the_us():
    """codespell, in `make lint`, does not look into names with underscores."""
    codespell = pytest.importorskip("codespell_lib")
    table = Path(codespell.__file__).parent / "data" / "dictionary_en-GB_to_en-US.txt"
    british = {line.split("->")[0].lower() for line in table.read_text(encoding="utf-8").splitlines()}
    assert {"colour", "neighbour", "labelled", "centre"} <= british  # codespell:ignore
    found = []
    for folder in ("wks_segment", "tests", "scripts", "benchmarks", "examples"):
        for path in sorted((PACKAGE.parent / folder).rglob("*.py")):
            for token in tokenize.generate_tokens(io.StringIO(path.read_text(encoding="utf-8")).readline):
                if token.type == tokenize.NAME:
                    words = re.findall(r"[A-Z]?[a-z]+|[A-Z]+", token.string)
                    if {word.lower() for word in words} & british - OTHERS_SPELL_SO:
                        found.append(f"{path.relative_to(PACKAGE.parent)}:{token.start[0]} {token.string}")
    assert not found, "\n".join(found)
