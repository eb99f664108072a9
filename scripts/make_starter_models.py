"""Make the models that come with the extension: `python -m scripts.make_starter_models DATA [--only human]`.

    human      named parts of people: MakeHuman's base mesh in several bodies and poses, by the bones of its rig
    quadruped  named parts of four-legged animals, by the bones of their rigs

DATA is a folder with `makehuman` (its `3dobjs`, `rigs` and motions) and `characters` (files of rigged animals), of
which only files are read that are in the public domain (CC0). Writes `wks_segment/models/human.json` and
`quadruped.json`, the same bytes from the same files. Needs bpy for the animals.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks import makehuman, rigs
from benchmarks.bodies import other_body
from wks_segment.core import DiskCache, PartNotes, PoseSegmentation, PoseSignature, TriangleMesh, connect
from wks_segment.core.learning.body_plan import SIGNATURE_WEIGHT
from wks_segment.core.learning.taught_mixture import plan_of
from wks_segment.core.mesh.triangle_mesh import IntArray
from wks_segment.core.parts.body_places import surface_at_rest
from wks_segment.rigs import BoneTree, Skeleton, Skin, parts_of_faces, split_side, usual_rows

TARGET = Path(__file__).parents[1] / "wks_segment" / "models"
WIDE_BODIES, LARGEST_FACTOR = 12, 2.5
"""Number of further bodies at rest of which only the plan is learned, and the largest factor of their proportions: from
1 up to it, so that children with large heads and heroes with broad chests are people. Their signatures are not learned:
realistic people would be recognized worse."""
MOTIONS = ("walk1", "dance1", "zombieWalk1", "benchmark", "tpose")
"""MakeHuman's motions, of which each body shows one frame."""
BODIES = 10
"""Number of MakeHuman's bodies: the base mesh and others."""
OF_PEOPLE, OF_ANIMALS = 0.8, 0.1
"""Weight of signatures beside the plan: people are of one kind and their signatures mostly right, animals are as many
kinds as there are files. The best of 0.05, 0.1, 0.2, 0.4 and 0.8 on Princeton's people, and on animals left out."""
ANIMALS = ("Cow", "Fox", "Horse", "Husky", "Stag", "Wolf")
"""Names of the files of four-legged animals (Quaternius, CC0)."""
ANIMAL_FRAMES = 2
"""Number of poses of each animal."""
JOINED = {"Ear": "Head"}
"""Parts that only some of the rigs have, and the part that they belong to."""
DIGITS = 6
"""Significant digits of the numbers in the files, which are read by people and compared with what the script makes."""


@dataclass(frozen=True)
class Lesson:
    """Meshes and their named parts.

    Attributes
    ----------
    owner : list of str
        Name of the body that each mesh is of.
    poses : list of PoseSignature
    labels : list of (m,) int arrays
        Part of each face, −1 for none.
    names : list of str
        Of the parts.
    rest : TriangleMesh, optional
        The first mesh at rest.
    standing : list of (str, TriangleMesh, (m,) int array)
        Bodies at rest of which only the plan is learned: their names, meshes and the part of each face.
    signature_weight : float
        See `BodyPlan`.
    """

    owner: list[str]
    poses: list[PoseSignature]
    labels: list[IntArray]
    names: list[str]
    rest: TriangleMesh | None = None
    standing: Sequence[tuple[str, TriangleMesh, IntArray]] = ()
    signature_weight: float = SIGNATURE_WEIGHT

    def without(self, owner: str) -> Lesson:
        """The lesson without the meshes of a body."""
        kept = [i for i, one in enumerate(self.owner) if one != owner]
        return replace(
            self,
            owner=[self.owner[i] for i in kept],
            poses=[self.poses[i] for i in kept],
            labels=[self.labels[i] for i in kept],
            rest=None,
            standing=[one for one in self.standing if one[0] != owner],
        )

    def taught(self) -> PoseSegmentation:
        """A model that has learned the parts, with their names."""
        model = PoseSegmentation().fit(self.poses, labels=self.labels, unlabeled="ignore", rest=self.rest)
        assert model.taught_ is not None
        surfaces = [surface_at_rest(mesh) for _, mesh, _ in self.standing]
        plan = plan_of(surfaces, [of_faces for *_, of_faces in self.standing], model.taught_)
        model.plan_ = None if plan is None else replace(plan, signature_weight=self.signature_weight)
        model.part_notes_ = PartNotes(names=dict(enumerate(self.names)))
        return model


def makehuman_parts(body: makehuman.MakeHuman) -> tuple[IntArray, list[str]]:
    """Part of each face of MakeHuman's body by its rig, and the names of the parts."""
    faces = body.faces[body.group_of == makehuman.BODY]
    skeleton = Skeleton.of({bone: parent for bone, (parent, _) in body.bones.items()})
    order = [list(body.bones).index(bone) for bone in skeleton.bones]
    tree = BoneTree.of(skeleton, Skin.of_triangles(body.vertices, faces, body.weights[:, order]))
    own, names = usual_rows(tree.rows)
    found = parts_of_faces([tree], [own], names=[names])
    return found.labels[0], [part.full_name for part in found.parts]


def human_lesson(folder: Path, cache: DiskCache | None = None) -> Lesson:
    """MakeHuman's bodies, one pose each."""
    base = makehuman.load(folder)
    part, names = makehuman_parts(base)
    motions = [makehuman.motion(next(folder.rglob(f"{name}.bvh"))) for name in MOTIONS]
    owner, poses = [], []
    for seed in range(BODIES):
        frames = motions[seed % len(motions)]
        body = base if seed == 0 else other_body(base, 100 + seed)
        mesh = body.turned(frames[(seed * len(frames)) // BODIES])
        connection = connect(mesh, rest=body.posed(0))
        poses.append(PoseSegmentation().describe(mesh, connection, cache=cache))
        owner.append(f"body {seed}")
    standing = []
    for seed in range(WIDE_BODIES):
        factor = LARGEST_FACTOR ** (seed / (WIDE_BODIES - 1))
        body = other_body(base, 200 + seed, factor)
        standing.append((f"wide {seed}", body.posed(0) if seed % 2 else body.turned(motions[-1][0]), part))
    return Lesson(owner, poses, [part] * BODIES, names, base.posed(0), standing, OF_PEOPLE)


def quadruped_lesson(folder: Path, cache: DiskCache | None = None, rig_cache: Path = rigs.CACHE) -> Lesson:
    """The animals, some poses each; their parts have the numbers of the first animal that has them."""
    owner: list[str] = []
    poses: list[PoseSignature] = []
    labels: list[IntArray] = []
    names: list[str] = []
    standing: list[tuple[str, TriangleMesh, IntArray]] = []
    for animal in ANIMALS:
        rig = rigs.load(folder / f"{animal}.glb", rig_cache)
        # Left and right are one part: the legs of animals that differ so much do not show which is which.
        plain = [split_side(name)[0] for name in rig.part_names]
        of_rig = [JOINED.get(name, name) for name in plain]
        names += [name for name in dict.fromkeys(of_rig) if name not in names]
        number = np.array([*(names.index(name) for name in of_rig), -1])
        meshes = rig.learned[:: len(rig.learned) // ANIMAL_FRAMES][:ANIMAL_FRAMES]
        connection = connect(*meshes, rest=rig.rest_mesh)
        standing.append((animal, rig.rest_mesh, number[rig.part]))
        for mesh in meshes:
            owner.append(animal)
            poses.append(PoseSegmentation().describe(mesh, connection, cache=cache))
            labels.append(number[rig.part])
    return Lesson(owner, poses, labels, names, None, standing, OF_ANIMALS)


def rounded(model: PoseSegmentation) -> PoseSegmentation:
    """The model with numbers of few digits, as they are written."""
    text = json.dumps(json.loads(model.to_json(), parse_float=lambda number: float(f"{float(number):.{DIGITS}g}")))
    content = json.loads(text)
    del content["digest"]  # of the numbers before they were rounded
    return PoseSegmentation.from_json(json.dumps(content))


def main(arguments: Sequence[str] | None = None) -> None:
    """Write the files."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, metavar="DATA")
    parser.add_argument("--only", choices=("human", "quadruped"))
    parser.add_argument("--target", type=Path, default=TARGET, help="folder to write to")
    parser.add_argument("--signatures", type=Path, help="folder to keep signatures in, for further runs")
    options = parser.parse_args(arguments)
    cache = None if options.signatures is None else DiskCache(options.signatures)
    lessons = {
        "human": lambda: human_lesson(options.data / "makehuman", cache),
        "quadruped": lambda: quadruped_lesson(options.data / "characters", cache),
    }
    options.target.mkdir(parents=True, exist_ok=True)
    for name in [options.only] if options.only else lessons:
        path = options.target / f"{name}.json"
        rounded(lessons[name]().taught()).save(path)
        print(f"{path}: {path.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
    sys.stdout.flush()
    os._exit(0)  # some versions of bpy crash at a normal exit
