"""Parts as people cut them, on nine classes of the Princeton benchmark. Part of `benchmarks.quality`."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import agreement
from benchmarks.pictures import Shape, picture
from benchmarks.speed import table_row
from wks_segment.core import DiskCache, PoseSegmentation, PoseSignature, TriangleMesh, connect
from wks_segment.core.mesh.triangle_mesh import IntArray

NAMED_CLASSES = {"human": 1, "chair": 101, "octopus": 121, "plier": 201, "fish": 221}
"""Number of the first of the twenty shapes of each class whose parts have names."""
CLASSES = NAMED_CLASSES | {"airplane": 61, "teddy": 161, "hand": 181, "bird": 241}
"""The same for all classes."""
LEARNED_SHAPES = (0, 4, 8, 12, 16)
"""Indices of the shapes of a class that are learned: the first of the choices."""
PICTURED_SHAPES = (1, 3, 6, 10, 14, 18)
"""Indices of unseen shapes that are drawn below people's cuts of them."""
N_CHOICES = 3
"""Number of choices of learned shapes: one is luck."""
Described = dict[str, PoseSignature]
Model = Callable[[str], PoseSegmentation]
"""Makes a model with a preset."""


def read(folder: Path, name: str, signatures: Path | None = None) -> tuple[dict[str, Any], Described]:
    """Arrays and signatures of a class; all presets share the signatures, which have the same eigenpairs."""
    numbers = [CLASSES[name] + i for i in range(20)]
    truth = {f"{name} {number}": dict(np.load(folder / f"{number}.npz")) for number in numbers}
    meshes = [TriangleMesh(arrays["vertices"], arrays["faces"]) for arrays in truth.values()]
    cache = None if signatures is None else DiskCache(signatures)
    found = PoseSegmentation().describe_all(meshes, [connect(mesh) for mesh in meshes], cache=cache)
    return truth, dict(zip(truth, found, strict=True))


def choices(names: Sequence[str], first: Sequence[str], count: int) -> list[Sequence[str]]:
    """The given first choice, and for each further seed a random choice of as many names."""
    drawn = (np.random.default_rng(seed).permutation(len(names))[: len(first)] for seed in range(1, count))
    return [first, *([names[i] for i in sorted(chosen)] for chosen in drawn)]


def table(options: argparse.Namespace, model: Model, presets: Sequence[str]) -> None:
    """Print regions and segments of all classes against segmentations and part names by people, and draw them."""
    print(
        table_row([
            "class", "setting", "error: first choice", f"mean of {options.choices}", "each", "regions",
            "people against each other", "their parts", "part names: first choice", f"mean of {options.choices}",
        ])
        + f"\n|{'---|' * 10}"
    )  # fmt: skip
    errors: dict[str, dict[str, list[float]]] = {preset: {} for preset in presets}
    names: dict[str, dict[str, list[float]]] = {preset: {} for preset in presets}
    of_people: dict[str, float] = {}
    drawings: dict[Path, list[Shape]] = {}
    for name in CLASSES:
        truth, described = read(options.data / "psb", name, options.signatures)
        shapes = list(described)
        of_people[name] = float(np.mean([agreement.of_people(t["human_segmentations"]) for t in truth.values()]))
        n_parts = np.mean([len(np.unique(one)) for t in truth.values() for one in t["human_segmentations"]])
        for preset in presets:
            errors[preset][name], names[preset][name], n_regions = [], [], []
            for learned in choices(shapes, [shapes[i] for i in LEARNED_SHAPES], options.choices):
                fitted = model(preset)
                found = agreement.with_people(fitted, described, learned, truth)
                errors[preset][name].append(float(np.mean(found.errors)))
                names[preset][name].append(float(np.mean(found.named or [np.nan])))
                n_regions.append(np.mean([len(np.unique(region)) for region in found.regions.values()]))
                if len(n_regions) == 1:
                    regions = found.regions | {shape: fitted.segment_regions(described[shape]) for shape in learned}
                    drawings |= _drawings(truth, described, regions, options.output / f"{name}_{preset}")
            print(
                table_row([
                    name, preset, *_numbers(errors[preset][name]), f"{n_regions[0]:.1f}", f"{of_people[name]:.3f}",
                    f"{n_parts:.1f}", *_numbers(names[preset][name])[:2],
                ]),
                flush=True,
            )  # fmt: skip
    for title, classes in ("the five with part names", list(NAMED_CLASSES)), ("all nine", list(CLASSES)):
        for preset in presets:
            error, named = (np.mean([of[preset][name] for name in classes], axis=0) for of in (errors, names))
            people = np.mean([of_people[name] for name in classes])
            cells = [*_numbers(error), "", f"{people:.3f}", "", *_numbers(named)[:2]]
            print(table_row([f"**mean of {title}**", preset, *cells]), flush=True)
    for target, drawn in drawings.items():
        picture(drawn, target, columns=len(PICTURED_SHAPES) if target.stem.endswith("_people") else 4)
    print(f"\npictures: {options.output}")


def _numbers(of_choices: Sequence[float]) -> list[str]:
    """The first choice, the mean of all, and each, as text; empty where there is no number."""
    if np.isnan(of_choices).any():
        return ["", "", ""]
    return [f"{of_choices[0]:.3f}", f"{np.mean(of_choices):.3f}", " ".join(f"{each:.3f}" for each in of_choices)]


def _drawings(
    truth: dict[str, Any], described: Described, regions: dict[str, IntArray], path: Path
) -> dict[Path, list[Shape]]:
    """What to draw: all shapes, and in a second picture some of them, with people's cuts above ours."""
    meshes = {shape: pose.surface.original for shape, pose in described.items()}
    chosen = [list(described)[i] for i in PICTURED_SHAPES]
    people = [(f"{s}, people", meshes[s], _usual_cut(truth[s]["human_segmentations"])) for s in chosen]
    ours = [(f"{s}, ours", meshes[s], regions[s]) for s in chosen]
    return {
        path.with_name(f"{path.name}.png"): [(shape, meshes[shape], regions[shape]) for shape in meshes],
        path.with_name(f"{path.name}_people.png"): people + ours,
    }


def _usual_cut(segmentations: Sequence[Any]) -> IntArray:
    """The segmentation that is nearest to those of all other people."""
    labelings = [np.unique(one, return_inverse=True)[1].ravel() for one in segmentations]
    errors = [np.mean([agreement.rand_index_error(one, other) for other in labelings]) for one in labelings]
    return np.asarray(labelings[int(np.argmin(errors))])
