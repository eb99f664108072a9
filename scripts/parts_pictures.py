"""Make pictures of parts on other bodies: `python -m scripts.parts_pictures DATA [--signatures FOLDER]`.

    parts_human      the starter model *Human* on five people of the Princeton benchmark
    parts_quadruped  five animals, each by a model that was taught on the others as *Quadruped* is
    bodies           ten people, five of whom were learned together, without any name

The first two are in docs/parts.md: none of their meshes was taught, and below each is the share of its area whose name
is right. The last one is in docs/gallery.md. DATA is the folder of `benchmarks.taught`. Needs bpy and Pillow (`make`
installs both in .venv).
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from benchmarks import princeton, rigs
from benchmarks.pictures import Shape, picture
from benchmarks.taught import named_right, on_rig
from scripts import make_starter_models as starters
from scripts._pictures import FOLDER, run
from scripts.parameter_pictures import N_COLORS
from wks_segment.core import DiskCache, PoseSegmentation, TriangleMesh, connect

PEOPLE = {3: "walking", 14: "on one leg", 15: "sitting", 6: "long hair", 18: "broad, sitting"}
"""Number of each person in the benchmark, and how they are. The last two are among the three that fail most."""
ANIMALS = ("Fox", "Wolf", "Horse", "Husky", "Cow")
"""The animals that are shown."""
PIXELS = 1600
"""Width of a picture."""


def main() -> None:
    """Make the pictures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, metavar="DATA")
    parser.add_argument("--signatures", type=Path, help="folder to keep signatures in, for further runs")
    options = parser.parse_args()
    cache = None if options.signatures is None else DiskCache(options.signatures)
    save("parts_human", people(options.data / "psb", cache))
    save("bodies", bodies(options.data / "psb", options.signatures), columns=5)
    with tempfile.TemporaryDirectory() as rig_cache:
        save("parts_quadruped", animals(options.data / "characters", cache, Path(rig_cache)), y_is_up=False)


def people(folder: Path, cache: DiskCache | None) -> list[Shape]:
    """The starter model on people."""
    model = PoseSegmentation.load(starters.TARGET / "human.json")
    names = [model.part_notes_.names[part] for part in range(model.n_segments_)]
    shapes: list[Shape] = []
    for number, how in PEOPLE.items():
        arrays = np.load(folder / f"{number}.npz")
        mesh = TriangleMesh(arrays["vertices"], arrays["faces"])
        pose = model.describe(mesh, connect(mesh), cache=cache)
        found = model.segment_faces(pose)
        right = named_right(pose, found, names, arrays["part_names"])
        shapes.append((f"{how}: {right:.2f}", mesh, found))
    return shapes


def bodies(folder: Path, signatures: Path | None) -> list[Shape]:
    """People who were learned together, and others, with the segments that all of them share."""
    described = list(princeton.read(folder, "human", signatures)[1].values())
    model = PoseSegmentation().fit([described[i] for i in princeton.LEARNED_SHAPES])
    numbers = {i: "learned" if i in princeton.LEARNED_SHAPES else "not learned" for i in range(10)}
    return [(how, described[i].surface.original, model.segment_faces(described[i])) for i, how in numbers.items()]


def animals(folder: Path, cache: DiskCache | None, rig_cache: Path) -> list[Shape]:
    """Each animal by a model of the others."""
    lesson = starters.quadruped_lesson(folder, cache, rig_cache)
    shapes: list[Shape] = []
    for animal in ANIMALS:
        rig = rigs.load(folder / f"{animal}.glb", rig_cache)
        (right, _), pose, found = on_rig(lesson.without(animal).taught(), lesson.names, rig, cache)
        shapes.append((f"{animal}: {right:.2f}", pose.surface.original, found))
    return shapes


def save(name: str, shapes: Sequence[Shape], y_is_up: bool = True, columns: int | None = None) -> None:
    """Render meshes to a small file of the docs, side by side if no number of columns is given."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "picture.png")
        picture(shapes, path, columns=columns or len(shapes), y_is_up=y_is_up)
        with Image.open(path) as large:
            size = (PIXELS, PIXELS * large.height // large.width)
            small = large.convert("RGB").resize(size, Image.Resampling.LANCZOS)
    reduced = small.quantize(N_COLORS, Image.Quantize.FASTOCTREE, kmeans=2, dither=Image.Dither.NONE)
    reduced.save(FOLDER / f"{name}.png", optimize=True)
    print(FOLDER / f"{name}.png", flush=True)


if __name__ == "__main__":
    run(main)
