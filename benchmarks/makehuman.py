"""MakeHuman's base mesh in any pose, read from a copy of its `3dobjs` and `rigs` folders."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from wks_segment.core import TriangleMesh
from wks_segment.core.mesh.triangle_mesh import FloatArray, IntArray

BEND = {
    "upperarm01": 50, "lowerarm01": 60, "wrist": 25, "upperleg01": 40, "lowerleg01": 55, "foot": 20, "finger": 30,
    "spine0": 8, "neck0": 10, "head": 15, "clavicle": 10, "toe": 10, "jaw": 6,
}  # fmt: skip
"""Bones that are rotated, by the beginning of their names, and the largest angle about each axis in degrees."""
BODY = "body"
JOINTS = {
    "Root": "root", "Spine1": "spine04", "Spine2": "spine03", "Spine3": "spine01", "Neck": "neck01", "Head": "head",
    "Clavicle": "clavicle", "UpArm": "upperarm01", "LoArm": "lowerarm01", "Hand": "wrist", "UpLeg": "upperleg01",
    "LoLeg": "lowerleg01", "Foot": "foot",
}  # fmt: skip
"""Bone of the rig for each joint of older motion files, without the side."""


@dataclass(frozen=True)
class MakeHuman:
    """The base mesh, its groups of faces and its rig.

    Attributes
    ----------
    vertices : (n, 3) array
        Points in the rest pose.
    faces : (m, 3) int array
        Triangles; each quadrilateral is split in two.
    group_of : (m,) array of str
        Face group of each triangle: "body", "joint-l-eye", …
    bones : dict
        Name of each bone to its parent and the position of its head; parents come first.
    weights : (n, len(bones)) array
        Rows sum to 1.
    """

    vertices: FloatArray
    faces: IntArray
    group_of: NDArray[np.str_]
    bones: dict[str, tuple[str | None, FloatArray]]
    weights: FloatArray

    def posed(self, seed: int, body_only: bool = True) -> TriangleMesh:
        """The mesh with randomly rotated joints; seed 0 is the rest pose."""
        generator = np.random.default_rng(seed)
        turns: dict[str, FloatArray] = {}
        for name, (parent, _) in self.bones.items():
            most = next((angle for prefix, angle in BEND.items() if name.startswith(prefix)), 0) * (seed > 0)
            turn = Rotation.from_euler("xyz", generator.uniform(-most, most, 3), degrees=True).as_matrix()
            turns[name] = turns[parent] @ turn if parent else turn
        return self.turned(turns, body_only)

    def turned(self, turns: dict[str, FloatArray], body_only: bool = True) -> TriangleMesh:
        """The mesh with bones rotated from rest by (3, 3) matrices in world axes; others follow their parents."""
        vertices = self._moved(turns)[0]
        faces = self.faces[self.group_of == BODY] if body_only else self.faces
        used, compact = np.unique(faces, return_inverse=True)
        return TriangleMesh(vertices[used], compact.reshape(-1, 3))

    def reshaped(self, scales: dict[str, FloatArray]) -> MakeHuman:
        """Another body in rest pose, with bones scaled by (3, 3) matrices; others follow their parents."""
        vertices, places = self._moved(scales)
        heads = {name: place[:3, :3] @ self.bones[name][1] + place[:3, 3] for name, place in places.items()}
        bones = {name: (parent, heads[name]) for name, (parent, _) in self.bones.items()}
        return replace(self, vertices=vertices, bones=bones)

    def _moved(self, matrices: dict[str, FloatArray]) -> tuple[FloatArray, dict[str, FloatArray]]:
        """Vertices, and the (4, 4) matrix of each bone, after applying (3, 3) matrices to bones about their heads."""
        world: dict[str, FloatArray] = {}
        for name, (parent, head) in self.bones.items():
            before = world[parent] if parent else np.eye(4)
            local = np.eye(4)
            local[:3, :3] = matrices.get(name, before[:3, :3])
            local[:3, 3] = before[:3, :3] @ head + before[:3, 3] - local[:3, :3] @ head
            world[name] = local
        blended = np.einsum("nb,bij->nij", self.weights, np.stack(list(world.values())))
        return np.einsum("nij,nj->ni", blended[:, :3, :3], self.vertices) + blended[:, :3, 3], world


def load(folder: Path) -> MakeHuman:
    """Read mesh, rig and weights from a folder; OSError if a file is missing."""
    vertices, faces, group_of, group = [], [], [], ""
    for line in (folder / "3dobjs" / "base.obj").read_text(encoding="utf-8").splitlines():
        kind, *rest = line.split() or [""]
        if kind == "v":
            vertices.append([float(number) for number in rest[:3]])
        elif kind == "g":
            group = rest[0]
        elif kind == "f":
            corners = [int(corner.split("/")[0]) - 1 for corner in rest]
            for i in range(1, len(corners) - 1):
                faces.append((corners[0], corners[i], corners[i + 1]))
                group_of.append(group)
    points = np.array(vertices)
    rig = json.loads((folder / "rigs" / "default.mhskel").read_text(encoding="utf-8"))
    bones: dict[str, tuple[str | None, FloatArray]] = {}
    while len(bones) < len(rig["bones"]):
        for name, bone in rig["bones"].items():
            if name not in bones and (not bone["parent"] or bone["parent"] in bones):
                bones[name] = bone["parent"], points[rig["joints"][bone["head"]]].mean(axis=0)
    place = {name: i for i, name in enumerate(bones)}
    weights = np.zeros((len(points), len(bones)))
    weights_of_bones = json.loads((folder / "rigs" / "default_weights.mhw").read_text(encoding="utf-8"))["weights"]
    for name, pairs in weights_of_bones.items():
        indices, values = np.array(pairs).T
        weights[indices.astype(int), place[name]] = values
    weights[weights.sum(axis=1) == 0, place["root"]] = 1
    weights /= weights.sum(axis=1, keepdims=True)
    return MakeHuman(points, np.array(faces), np.array(group_of), bones, weights)


def motion(path: Path) -> list[dict[str, FloatArray]]:
    """Frames of a BVH file: for each bone of the rig its rotation from rest, in the axes of the mesh."""
    joints: list[tuple[str, int, list[str]]] = []
    open_joints: list[int] = []
    lines = iter(path.read_text(encoding="utf-8").splitlines())
    skipping, offset = False, np.zeros(3)
    for words in map(str.split, lines):
        if words[0] in ("ROOT", "JOINT"):
            joints.append((words[1], open_joints[-1] if open_joints else -1, []))
            open_joints.append(len(joints) - 1)
        elif words[0] == "End":
            skipping = True
        elif words[0] == "}":
            skipping = False if skipping else not open_joints.pop()
        elif words[0] == "OFFSET" and len(joints) == 1:
            offset = np.array(words[1:], dtype=float)
        elif words[0] == "CHANNELS":
            joints[-1][2].extend(words[2:])
        elif words[0] == "Frame":
            break
    # In some files the vertical axis is z; in the mesh it is y.
    upright = Rotation.from_euler("x", -90, degrees=True).as_matrix() if offset[2] > offset[1] else np.eye(3)
    return [_turns(joints, np.array(line.split(), dtype=float), upright) for line in lines if line.strip()]


def _turns(joints: list[tuple[str, int, list[str]]], numbers: FloatArray, upright: FloatArray) -> dict[str, FloatArray]:
    turns: dict[str, FloatArray] = {}
    so_far: list[FloatArray] = []
    begin = 0
    for name, parent, channels in joints:
        turn = so_far[parent] if parent >= 0 else np.eye(3)
        for channel, angle in zip(channels, numbers[begin : begin + len(channels)], strict=True):
            if channel.endswith("rotation"):
                turn = turn @ Rotation.from_euler(channel[0].lower(), angle, degrees=True).as_matrix()
        begin += len(channels)
        so_far.append(turn)
        base, _, side = name.partition("_")
        bone = f"{JOINTS[base]}{'.' * bool(side)}{side}" if base in JOINTS else name
        turns[bone] = upright @ turn @ upright.T
    return turns
