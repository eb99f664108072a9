"""The code blocks of docs/recipes.md run in their order, and print the text that follows them on the page."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import bpy
import pytest
from builders import limbed, rig

ROOT = Path(__file__).resolve().parents[3]
PAGE = ROOT / "docs" / "recipes.md"
BLOCK = re.compile(r"^```(sh|python)\n(.*?)^```\n(?:```text\n(.*?)^```\n)?", re.MULTILINE | re.DOTALL)
HEADING = re.compile(r"^## (.*)", re.MULTILINE)
BENDS = (0.0, 0.3, 0.6)
"""Of the processes: models that are good enough are learned in a fraction of the time."""


class Recipe(NamedTuple):
    """A code block, and the output that the page shows for it, if any."""

    language: str
    code: str
    printed: str | None


def recipes():
    page = PAGE.read_text(encoding="utf-8")
    for block in BLOCK.finditer(page):
        title = HEADING.findall(page[: block.start()])[-1]
        recipe = Recipe(block[1], block[2], block[3])
        yield pytest.param(recipe, id=re.sub(r"\W+", "_", title.lower()))


def test_all_blocks_of_the_page_are_found():
    page = PAGE.read_text(encoding="utf-8")
    assert len(list(recipes())) == len(re.findall(r"^```(?!text)\w+$", page, re.MULTILINE)) > 0


@pytest.fixture(scope="module")
def recipe_folder(extension, tmp_path_factory):
    """Folder with the files that the page mentions, and this Python as `python`."""
    folder = tmp_path_factory.mktemp("recipes")
    (folder / "characters").mkdir()
    (folder / "bin").mkdir()
    python = folder / "bin" / "python"
    python.write_text(f'#!/bin/sh\nexec "{sys.executable}" "$@"\n')
    python.chmod(0o755)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    rig([limbed("Walker", subdivisions=4)])
    bpy.ops.export_scene.gltf(filepath=str(folder / "walk.glb"))
    for name in ("knight", "thief"):
        shutil.copy(folder / "walk.glb", folder / "characters" / f"{name}.glb")
    (folder / "characters" / "broken.glb").write_text("no glTF")
    for i, bend in enumerate(BENDS, start=1):
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        limbed(f"Pose {i}", bend, subdivisions=3)
        bpy.ops.wm.obj_export(filepath=str(folder / f"pose_{i}.obj"))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    return folder


@pytest.mark.skipif(shutil.which("bash") is None, reason="the recipes are for a Unix shell")
@pytest.mark.parametrize("recipe", recipes())
def test_recipe(recipe, recipe_folder, needs_rendering):
    shell = ["bash", "-e", "-o", "pipefail", "-c"] if recipe.language == "sh" else [sys.executable, "-c"]
    paths = {"PATH": f"{recipe_folder / 'bin'}{os.pathsep}{os.environ['PATH']}", "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [*shell, recipe.code], cwd=recipe_folder, env=os.environ | paths, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    if recipe.printed is not None:
        assert done.stdout == recipe.printed
