"""Quality of the parts: `python -m benchmarks.quality STUDY DATA [--output FOLDER]`.

STUDY is one of

consistency  share of the area of unseen poses with the learned label (characters, and MakeHuman's body in motions)
bodies       the same for bodies of other proportions, made from MakeHuman's
choices      the studies `consistency` (MakeHuman's body) and `human` (Princeton humans), with five choices of what is
             learned
human        regions of nine classes compared with segmentations by people (Rand-index error), segments with part names
             (adjusted Rand index), with three choices of what is learned
poses        share of the area of unseen poses with the learned label, under strong deformation
seeds        adjusted Rand index between the labels of models that were learned with five seeds
retrieval    share of shapes for which `rank` finds the right class: Princeton classes and characters
remesh       share of the area that keeps its label when a mesh is resampled to half and to twice its faces
robustness   the same for damaged meshes (as `benchmarks.robustness`)

DATA is a folder with `characters` (files that Blender imports), `makehuman` (its `3dobjs`, `rigs` and motions), `psb`
(the Princeton benchmark as .npz files with its numbers) and `poses` (shapes in many poses as .npz files). Prints
Markdown tables for the default and the paper's preset, and writes pictures.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import agreement, characters, deformations, makehuman, perturbations, princeton, retrieval, robustness
from benchmarks.bodies import other_body
from benchmarks.pictures import picture
from benchmarks.speed import table_row
from wks_segment.core import PoseSegmentation, PoseSignature, connect
from wks_segment.core.mesh.triangle_mesh import FloatArray, IntArray

PRESETS = ("default", "paper")
LEARNED_FRAMES = ("walk1 0", "walk1 7", "zombieWalk1 12", "benchmark 0", "tpose 0")
FRAMES = 6
"""Number of frames of each motion, including the first and the last."""
OTHER_BODIES = range(1, 7)
"""Seeds of the other bodies."""
OTHER_FRAMES = ("zombieWalk1 24", "walk1 5", "dance1 0")
"""Unseen frames for the other bodies. The first is in the picture."""
CHOICES = range(5)
"""Seeds of the choice of learned poses; 0 stands for `princeton.LEARNED_SHAPES` and `LEARNED_FRAMES`."""
SEEDS = range(5)
Described = dict[str, PoseSignature]
Frame = dict[str, FloatArray]
"""Rotation of each bone, see `makehuman.motion`."""


def main() -> None:
    """Run one of the studies."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("study", choices=STUDIES, metavar="STUDY")
    parser.add_argument("data", type=Path, metavar="DATA")
    parser.add_argument("--output", type=Path, default=Path("demo/quality"))
    parser.add_argument("--segments", type=int, default=8)
    parser.add_argument("--presets", nargs="+", choices=PRESETS, default=PRESETS, help="of the studies human and poses")
    parser.add_argument(
        "--choices", type=int, default=princeton.N_CHOICES, help="of learned shapes, in the study human"
    )
    parser.add_argument("--signatures", type=Path, help="folder to keep signatures in, for further runs")
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    STUDIES[options.study](options)


def consistency(options: argparse.Namespace) -> None:
    """Consistency of labels in unseen frames of characters and unseen motions of MakeHuman's body."""
    for preset in PRESETS:
        print(f"\n### {preset}\n\n| character | vertices | CPU s a pose | learned | unseen | worst |\n|{'---|' * 6}")
        settings = ["--segments", str(options.segments), "--preset", preset]
        paths = sorted(p for p in (options.data / "characters").iterdir() if p.suffix in characters.FILES)
        output = options.output / preset
        output.mkdir(exist_ok=True)
        rows = [characters.measure(path, output, settings) for path in paths]
        unseen = [row["unseen"] for row in rows]
        print(
            f"| **mean of {len(rows)}** | | | | **{np.mean(unseen):.3f}** | {min(row['worst'] for row in rows):.3f} |"
        )
        characters.contact_sheet([output / f"{path.stem}.png" for path in paths], output / "sheet.png")
    described = _motions(options.data / "makehuman")
    shares = {}
    for preset in PRESETS:
        found = agreement.with_learned(_model(options, preset), described, LEARNED_FRAMES)
        shares[preset] = found.shares
        pictured = [(name, pose, found.labels.get(name, found.known)) for name, pose in described.items()]
        _picture(pictured, options.output / f"makehuman_{preset}.png")
    _print_shares("MakeHuman's own motions, unseen", shares)


def bodies(options: argparse.Namespace) -> None:
    """Consistency of labels on other bodies in unseen frames, with a model of MakeHuman's body."""
    folder = options.data / "makehuman"
    body, frames, described = makehuman.load(folder), _frames(folder), _motions(folder)
    poses, shown = {name: described[name] for name in LEARNED_FRAMES}, OTHER_FRAMES[0]
    for seed in OTHER_BODIES:
        found = _described(other_body(body, seed), {name: frames[name] for name in OTHER_FRAMES})
        poses |= {f"body {seed}, {name}": pose for name, pose in found.items()}
    shares = {}
    for preset in PRESETS:
        result = agreement.with_learned(_model(options, preset), poses, LEARNED_FRAMES)
        shares[preset] = result.shares
        pictured = [(name, poses[name], labels) for name, labels in result.labels.items() if name.endswith(shown)]
        pictured.insert(0, (f"learned body, {shown}", described[shown], result.known))
        _picture(pictured, options.output / f"bodies_{preset}.png")
    _print_shares(f"{len(OTHER_BODIES)} other bodies in {len(OTHER_FRAMES)} poses each", shares)


def choices(options: argparse.Namespace) -> None:
    """Dependence of the results on the choice of learned poses or shapes."""
    body = _motions(options.data / "makehuman")
    truth, humans = princeton.read(options.data / "psb", "human", options.signatures)
    of_body = princeton.choices(list(body), LEARNED_FRAMES, len(CHOICES))
    of_humans = princeton.choices(list(humans), [list(humans)[i] for i in princeton.LEARNED_SHAPES], len(CHOICES))
    print(f"| {len(CHOICES)} choices | setting | each | mean | spread | worst pose |\n|{'---|' * 6}")
    pairs = []
    for preset in PRESETS:
        model = _model(options, preset)
        shares, errors, named = [], [], []
        labels: dict[str, list[IntArray]] = {"MakeHuman": [], "Princeton humans": []}
        for names in of_body:
            shares.append(agreement.with_learned(model, body, names).shares)
            labels["MakeHuman"].append(_predicted(model, body.values()))
        for names in of_humans:
            found = agreement.with_people(model, humans, names, truth)
            errors.append(found.errors)
            named.append(found.named)
            labels["Princeton humans"].append(_predicted(model, humans.values()))
        print(_choices_row("MakeHuman: area with the learned label", preset, shares, min))
        print(_choices_row("humans: Rand-index error", preset, errors, max))
        print(_choices_row("humans: part names", preset, named, min), flush=True)
        pairs += [_pairs_row(name, preset, each) for name, each in labels.items()]
    print("\n| same parts from all choices | setting | mean of all pairs | lowest |\n|---|---|---|---|")
    print("\n".join(pairs))


def human(options: argparse.Namespace) -> None:
    """Regions and segments of the Princeton classes compared with segmentations and part names by people."""
    princeton.table(options, lambda preset: _model(options, preset), options.presets)


def poses(options: argparse.Namespace) -> None:
    """Consistency of labels in unseen poses of strongly deformed shapes."""
    deformations.table(options, lambda preset: _model(options, preset), options.presets)


def seeds(options: argparse.Namespace) -> None:
    """Agreement of models that differ only in their seed."""
    print("| learned from | setting | mean of all pairs | lowest |\n|---|---|---|---|")
    _, humans = princeton.read(options.data / "psb", "human", options.signatures)
    shapes = list(humans)
    sets = {
        "Princeton humans": ([humans[shapes[i]] for i in princeton.LEARNED_SHAPES], [humans[s] for s in shapes[1::4]])
    }
    body = _motions(options.data / "makehuman")
    sets["MakeHuman"] = [body[n] for n in LEARNED_FRAMES], [d for n, d in body.items() if n not in LEARNED_FRAMES]
    for name, (learned, others) in sets.items():
        for preset in PRESETS:
            labels = []
            for seed in SEEDS:
                model = _model(options, preset)
                model.random_state = seed
                model.fit(learned)
                labels.append(_predicted(model, others))
            print(_pairs_row(name, preset, labels), flush=True)


def which_class(options: argparse.Namespace) -> None:
    """Retrieval (section 5 of the paper) on Princeton classes and characters; exit code 1 below the lower limits."""
    shapes = {
        name: list(princeton.read(options.data / "psb", name, options.signatures)[1].values())
        for name in princeton.NAMED_CLASSES
    }
    rates: dict[str, float] = {}
    chosen = princeton.choices(list(map(str, range(20))), list(map(str, princeton.LEARNED_SHAPES)), len(CHOICES))
    for choice in chosen:
        found = retrieval.retrieved(lambda: _model(options, "default"), shapes, [int(i) for i in choice])
        retrieval.report(f"learned {' '.join(choice)}", found)
        if not rates:
            retrieval.picture(found, options.output / "retrieval_princeton.png")
        rates["Princeton" if not rates else " ".join(choice)] = found.rate
    each = list(rates.values())
    print(f"\nfive choices: mean {np.mean(each):.1%}, spread {np.std(each, ddof=1):.1%}, worst {min(each):.1%}")
    retrieval.report("paper", retrieval.retrieved(lambda: _model(options, "paper"), shapes, princeton.LEARNED_SHAPES))
    found = retrieval.of_characters(options.data / "characters", options.output)
    retrieval.report("characters", found)
    rates["characters"] = found.rate
    failed = [name for name, limit in retrieval.LOWER_LIMITS.items() if rates[name] < limit]
    if failed:
        sys.exit(f"below the lower limit: {', '.join(failed)}")


def remesh(options: argparse.Namespace) -> None:
    """Labels of MakeHuman's body resampled to half and to twice its faces."""
    body = makehuman.load(options.data / "makehuman")
    clean = [body.posed(seed) for seed in robustness.TESTED_SEEDS]
    print("| resampled to | default | paper |\n|---|---|---|")
    kinds = {"half the faces": ("sampling", 2.0), "twice the faces, on one side four times": ("finer on one side", 1.0)}
    rows: dict[str, list[str]] = {kind: [] for kind in kinds}
    for preset in PRESETS:
        model = _model(options, preset).fit([body.posed(seed) for seed in robustness.LEARNED_SEEDS])
        expected = [model.segment_faces(mesh) for mesh in clean]
        for kind, (name, strength) in kinds.items():
            resampled = perturbations.PERTURBATIONS[name][0], (strength,)
            rows[kind].append(f"{robustness.agreements(model, resampled, clean, expected)[0]:.3f}")
    for kind, shares in rows.items():
        print(table_row([kind, *shares]))


def damage(options: argparse.Namespace) -> None:
    """The table of `benchmarks.robustness` for both presets."""
    for preset in PRESETS:
        print(f"\n### {preset}\n")
        robustness.table(options.data / "makehuman", _model(options, preset))


STUDIES: dict[str, Callable[[argparse.Namespace], None]] = {
    "consistency": consistency, "bodies": bodies, "choices": choices, "human": human, "poses": poses, "seeds": seeds,
    "retrieval": which_class, "remesh": remesh, "robustness": damage,
}  # fmt: skip


def _model(options: argparse.Namespace, preset: str) -> PoseSegmentation:
    return PoseSegmentation(options.segments, preset=preset)  # type: ignore[arg-type]


def _frames(folder: Path) -> dict[str, Frame]:
    """Some frames of each of MakeHuman's motions."""
    frames = {}
    for path in sorted(folder.rglob("*.bvh")):
        motion = makehuman.motion(path)
        for i in np.unique(np.linspace(0, len(motion) - 1, FRAMES).astype(int)):
            frames[f"{path.stem} {i}"] = motion[i]
    return frames


def _motions(folder: Path) -> Described:
    """MakeHuman's body described in some frames of each motion."""
    return _described(makehuman.load(folder), _frames(folder))


def _described(body: makehuman.MakeHuman, frames: Mapping[str, Frame]) -> Described:
    """A body described in some frames, with one connection of its islands for all frames."""
    meshes = [body.turned(frame) for frame in frames.values()]
    connection = connect(*meshes, rest=body.posed(0))
    found = PoseSegmentation().describe_all(meshes, [connection] * len(meshes))
    return dict(zip(frames, found, strict=True))


def _predicted(model: PoseSegmentation, described: Iterable[PoseSignature]) -> IntArray:
    return np.concatenate([model.predict(one) for one in described])


def _print_shares(title: str, shares: Mapping[str, Sequence[float]]) -> None:
    """Print a table of the shares of area of each preset."""
    print(f"\n| {title} | mean | worst |\n|---|---|---|")
    for preset, each in shares.items():
        print(table_row([preset, f"{np.mean(each):.4f}", f"{min(each):.3f}"]))


def _choices_row(what: str, preset: str, of_choices: Sequence[Sequence[float]], worst: Callable[[Any], float]) -> str:
    """Row with the mean of a measure for each choice, mean and standard deviation of these, and the worst value."""
    each = [float(np.mean(one)) for one in of_choices]
    return table_row([
        what, preset, " ".join(f"{mean:.3f}" for mean in each), f"{np.mean(each):.3f}", f"{np.std(each, ddof=1):.3f}",
        f"{worst(map(worst, of_choices)):.3f}",
    ])  # fmt: skip


def _pairs_row(what: str, preset: str, labels: Sequence[IntArray]) -> str:
    """Row with the agreement of all pairs of labelings."""
    pairs = agreement.of_pairs(labels)
    return table_row([what, preset, f"{np.mean(pairs):.3f}", f"{min(pairs):.3f}"])


def _picture(shapes: Sequence[tuple[str, PoseSignature, IntArray]], path: Path) -> None:
    """Draw described shapes in the colors of their labels."""
    picture([(name, shape.surface.original, labels) for name, shape, labels in shapes], path)
    print(f"\npicture: {path}\n", flush=True)


if __name__ == "__main__":
    main()
    sys.stdout.flush()
    os._exit(0)  # some versions of bpy crash at a normal exit
