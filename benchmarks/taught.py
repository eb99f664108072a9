"""Parts that are taught, found on other poses and bodies: `python -m benchmarks.taught DATA [STUDY …] [--output …]`.

STUDY is one or more of

humans      the names of parts of five Princeton humans, on the other fifteen (three choices of the five)
makehuman   the bones of MakeHuman's rig as 16 parts, taught in five poses of one body: own unseen motions, other bodies
strokes     the same, with 2 % of the faces of each part said, in one place, on one mesh
human       the starter model of people: names on the Princeton humans and on characters with a human rig
quadruped   the starter model of animals, taught without the animal itself

DATA is the folder of `benchmarks.quality`, with `rigged` as well. Prints Markdown tables and writes pictures. "Right"
is the share of the area that has the taught part or the name of its bone.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from sklearn.metrics import adjusted_rand_score

from benchmarks import makehuman, princeton, quality, rigs
from benchmarks.bodies import other_body
from benchmarks.pictures import Shape, picture
from benchmarks.speed import table_row
from scripts import make_starter_models as starters
from wks_segment.core import DiskCache, PoseSegmentation, PoseSignature, connect
from wks_segment.core.mesh.triangle_mesh import FloatArray, IntArray
from wks_segment.rigs import split_side
from wks_segment.rigs.dictionary import broader_names

PEOPLE = (
    "characters/Casual", "characters/King", "characters/Leela", "rigged/Knight", "rigged/CesiumMan", "rigged/Voxel",
    "rigged/greenman",
)  # fmt: skip
"""Characters with a human rig."""
PRINCETON_NAMES = {
    "Head": "head", "Torso": "torso", "Hips": "torso", "Upper Arm": "upperarm", "Forearm": "lowerarm", "Hand": "hand",
    "Thigh": "upperleg", "Shin": "lowerleg", "Foot": "foot",
}  # fmt: skip
"""The name of the benchmark for each part; a neck is part of head or torso, on which people do not agree."""
STROKE = 0.02
"""Share of the faces of a part that are said with a stroke."""
Described = Mapping[str, PoseSignature]


def main() -> None:
    """Run the studies."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, metavar="DATA")
    parser.add_argument("studies", nargs="*", metavar="STUDY", default=list(STUDIES))
    parser.add_argument("--output", type=Path, default=Path("demo/taught"))
    parser.add_argument("--choices", type=int, default=princeton.N_CHOICES)
    parser.add_argument("--signatures", type=Path, help="folder to keep signatures in, for further runs")
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    for study in options.studies:
        STUDIES[study](options)


def humans(options: argparse.Namespace) -> None:
    """Names of parts of the Princeton humans."""
    truth, described = princeton.read(options.data / "psb", "human", options.signatures)
    names = sorted({str(name) for arrays in truth.values() for name in arrays["part_names"]})
    labels = {shape: np.searchsorted(names, arrays["part_names"]) for shape, arrays in truth.items()}
    shapes = list(described)
    print("\n| Princeton humans, five taught | adjusted Rand index | right | worst |\n|---|---|---|---|")
    first = [shapes[i] for i in princeton.LEARNED_SHAPES]
    for i, chosen in enumerate(princeton.choices(shapes, first, options.choices)):
        model = PoseSegmentation().fit([described[s] for s in chosen], labels=[labels[s] for s in chosen])
        found = {s: model.segment_faces(described[s]) for s in shapes if s not in chosen}
        index = [adjusted_rand_score(labels[s], each) for s, each in found.items()]
        right = [_share(described[s], each == labels[s]) for s, each in found.items()]
        print(
            table_row([f"choice {i}", f"{np.mean(index):.3f}", f"{np.mean(right):.3f}", f"{min(right):.3f}"]),
            flush=True,
        )
        if i == 0:
            _draw({s: (described[s], each) for s, each in found.items()}, options.output / "humans.png")


def makehuman_bones(options: argparse.Namespace) -> None:
    """Parts by the bones of MakeHuman's rig, all faces said."""
    own, others, part, names = _makehuman(options)
    rest = makehuman.load(options.data / "makehuman").posed(0)
    learned = quality.LEARNED_FRAMES
    model = PoseSegmentation().fit([own[name] for name in learned], labels=[part] * len(learned), rest=rest)
    print(f"\n| MakeHuman, {len(names)} parts by bones | right | without sides | left/right right | worst |")
    print("|---|---|---|---|---|")
    _makehuman_rows(model, own, others, part, names)
    shown = [name for name in others if name.endswith(quality.OTHER_FRAMES[0])]
    _draw({name: (others[name], model.segment_faces(others[name])) for name in shown}, options.output / "bodies.png")


def strokes(options: argparse.Namespace) -> None:
    """Parts by a stroke on each, on one pose of MakeHuman's body."""
    own, others, part, names = _makehuman(options)
    pose = own[quality.LEARNED_FRAMES[-1]]
    said = stroke(pose, part)
    model = PoseSegmentation().fit([pose], labels=[said], unlabeled="ignore")
    print("\n| MakeHuman, a stroke on each part | right | without sides | left/right right | worst |")
    print("|---|---|---|---|---|")
    _makehuman_rows(model, own, others, part, names)


def human(options: argparse.Namespace) -> None:
    """The starter model of people."""
    cache = None if options.signatures is None else DiskCache(options.signatures)
    model = PoseSegmentation.load(starters.TARGET / "human.json")
    names = [model.part_notes_.names[part] for part in range(model.taught_.n_parts)]  # type: ignore[union-attr]
    truth, described = princeton.read(options.data / "psb", "human", options.signatures)
    print("\n| *Human* on | right | left/right right |\n|---|---|---|")
    each, drawn = [], {}
    for shape, pose in described.items():
        found = model.segment_faces(pose)
        each.append(named_right(pose, found, names, truth[shape]["part_names"]))
        drawn[f"{shape} {each[-1]:.2f}"] = pose, found
    print(table_row([f"Princeton humans (worst {min(each):.3f})", f"{np.mean(each):.3f}", ""]), flush=True)
    characters, shapes = [], dict(drawn)
    for name in PEOPLE:
        path = next(options.data.glob(f"{name}.*"))
        row, pose, found = on_rig(model, names, rigs.load(path, options.output / "rigs"), cache)
        characters.append(row)
        print(table_row([name, *(f"{value:.3f}" for value in row)]), flush=True)
        shapes[f"{name} {row[0]:.2f}"] = pose, found
    print(table_row(["**mean of the characters**", *(f"{v:.3f}" for v in np.nanmean(characters, axis=0))]), flush=True)
    _draw(shapes, options.output / "human.png")


def quadruped(options: argparse.Namespace) -> None:
    """The starter model of animals, each animal left out."""
    cache = None if options.signatures is None else DiskCache(options.signatures)
    lesson = starters.quadruped_lesson(options.data / "characters", cache, options.output / "rigs")
    rows, shapes = [], {}
    print("\n| *Quadruped* without | right | left/right right |\n|---|---|---|")
    for animal in starters.ANIMALS:
        rig = rigs.load(options.data / "characters" / f"{animal}.glb", options.output / "rigs")
        row, pose, found = on_rig(lesson.without(animal).taught(), lesson.names, rig, cache)
        rows.append(row)
        print(table_row([animal, *(f"{value:.3f}" for value in row)]), flush=True)
        shapes[f"{animal} {row[0]:.2f}"] = pose, found
    print(table_row(["**mean**", *(f"{value:.3f}" for value in np.nanmean(rows, axis=0))]), flush=True)
    _draw(shapes, options.output / "quadruped.png", y_is_up=False)


STUDIES = {
    "humans": humans, "makehuman": makehuman_bones, "strokes": strokes, "human": human, "quadruped": quadruped,
}  # fmt: skip


def stroke(pose: PoseSignature, part: IntArray) -> IntArray:
    """(m,) part of each face of a stroke in the middle of each part, −1 for all others."""
    mesh = pose.surface.original
    said = np.full(len(part), -1)
    for each in np.unique(part[part >= 0]):
        inside = np.flatnonzero(part == each)
        middle = np.median(mesh.face_centers[inside], axis=0)
        near = np.linalg.norm(mesh.face_centers[inside] - middle, axis=1)
        said[inside[np.argsort(near)[: max(3, round(STROKE * len(inside)))]]] = each
    return said


def named_right(pose: PoseSignature, found: IntArray, names: Sequence[str], known: IntArray) -> float:
    """Share of the area of a Princeton human whose part has the name that people gave it.

    Parameters
    ----------
    pose : PoseSignature
    found : (m,) int array
        Part of each face, of `names`.
    names : list of str
    known : (m,) str array
        Name of the benchmark for each face.
    """
    plain = np.array([split_side(name)[0] for name in names])
    of_names = np.array([PRINCETON_NAMES.get(name, "") for name in plain])[found]
    neck = (plain[found] == "Neck") & np.isin(known, ["head", "torso"])
    return _share(pose, (of_names == known) | neck)


def fits(name: str, bone: str, of_rig: Sequence[str]) -> bool:
    """Whether a plain name is that of a bone's part, or of a finer one that the rig does not have."""
    return name == bone or (name not in of_rig and bone in broader_names(name))


def _makehuman(options: argparse.Namespace) -> tuple[Described, Described, IntArray, list[str]]:
    """MakeHuman's body in motions, other bodies, and parts by bones with their names."""
    folder = options.data / "makehuman"
    body, frames = makehuman.load(folder), quality._frames(folder)
    cache = None if options.signatures is None else DiskCache(options.signatures)

    def described(one: makehuman.MakeHuman, chosen: Sequence[str]) -> dict[str, PoseSignature]:
        meshes = [one.turned(frames[name]) for name in chosen]
        connection = connect(*meshes, rest=one.posed(0))
        poses = PoseSegmentation().describe_all(meshes, [connection] * len(meshes), cache=cache)
        return dict(zip(chosen, poses, strict=True))

    others: dict[str, PoseSignature] = {}
    for seed in quality.OTHER_BODIES:
        found = described(other_body(body, seed), quality.OTHER_FRAMES)
        others |= {f"body {seed}, {name}": pose for name, pose in found.items()}
    return described(body, list(frames)), others, *starters.makehuman_parts(body)


def _makehuman_rows(
    model: PoseSegmentation, own: Described, others: Described, part: IntArray, names: Sequence[str]
) -> None:
    """Print the rows of own unseen motions and of other bodies."""
    unseen = {name: pose for name, pose in own.items() if name not in quality.LEARNED_FRAMES}
    for title, poses in ("own unseen motions", unseen), ("six other bodies", others):
        rows = [_right(pose, model.segment_faces(pose), part, names, names) for pose in poses.values()]
        exact = [row[0] for row in rows]
        mean = [f"{value:.4f}" for value in np.mean(rows, axis=0)]
        print(table_row([title, *mean, f"{min(exact):.3f}"]), flush=True)


def _right(
    pose: PoseSignature, found: IntArray, part: IntArray, names: Sequence[str], of_rig: Sequence[str]
) -> tuple[float, float, float]:
    """Shares of the area that has the name and side of its bone, the name alone, and the side where the name is right.

    Parameters
    ----------
    pose : PoseSignature
    found, part : (m,) int arrays
        Found part, of `names`; part by the rig, of `of_rig`, −1 for none.
    names, of_rig : list of str
    """
    known = part >= 0
    ours, theirs = ([split_side(name) for name in some] for some in (names, of_rig))
    plain = [name for name, _ in theirs]
    table = np.array([[fits(a, b, plain) for b, _ in theirs] for a, _ in ours])
    sides = np.array([[not a or not b or a == b for _, b in theirs] for _, a in ours])
    sided = np.array([[bool(a) and bool(b) for _, b in theirs] for _, a in ours])
    areas = pose.surface.original.face_areas * known
    right, same, both = table[found, part], sides[found, part], sided[found, part]
    exact = float(np.average(right & same, weights=areas))
    with_side = areas * (right & both)
    of_sides = float(np.average(same, weights=with_side)) if with_side.sum() else np.nan
    return exact, float(np.average(right, weights=areas)), of_sides


def on_rig(
    model: PoseSegmentation, names: Sequence[str], rig: rigs.Rig, cache: DiskCache | None
) -> tuple[tuple[float, float], PoseSignature, IntArray]:
    """Share of the area with a name that fits the bone, and with the right side; the mesh at rest, and its parts."""
    mesh = rig.rest_mesh
    pose = PoseSegmentation().describe(mesh, connect(mesh), cache=cache)
    found = model.segment_faces(pose)
    _, right, sides = _right(pose, found, rig.part, names, rig.part_names)
    return (right, sides), pose, found


def _share(pose: PoseSignature, right: FloatArray | IntArray) -> float:
    return float(np.average(right, weights=pose.surface.original.face_areas))


def _draw(shapes: Mapping[str, tuple[PoseSignature, IntArray]], path: Path, y_is_up: bool = True) -> None:
    drawn: list[Shape] = [(name, pose.surface.original, found) for name, (pose, found) in shapes.items()]
    picture(drawn, path, columns=5, y_is_up=y_is_up)
    print(f"\npicture: {path}", flush=True)


if __name__ == "__main__":
    main()
    sys.stdout.flush()
    os._exit(0)  # some versions of bpy crash at a normal exit
