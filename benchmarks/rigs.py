"""Rigged characters to measure on: read once with Blender, then kept as arrays."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wks_segment.core import TriangleMesh
from wks_segment.core.mesh.triangle_mesh import FloatArray, IntArray

FILES = (".glb", ".gltf", ".fbx", ".blend", ".usdz", ".usdc", ".usda", ".usd")
CACHE = Path("demo/rigs/cache")
VERSION = 1
"""Of the cached arrays; counted up when what is read changes."""
LEARNED = (0, 2, 4, 5, 7)
"""Frames that are learned, evenly among the eight as `wks_segment demo` chooses them; the others are unseen."""
READING_LIMIT = 300
"""Seconds for one file: bpy may hang."""


@dataclass(frozen=True)
class Rig:
    """A rigged character: all its meshes as one, in frames of the action that moves most.

    Attributes
    ----------
    name : str
    vertices : (frames, n, 3) array
        Positions in eight frames; without an animation, with bones rotated at random.
    rest : (n, 3) array
        Positions with the armature at rest.
    faces : (m, 3) int array
        Triangles, the same in all frames.
    polygon : (m,) int array
        The polygon that each triangle comes from.
    bone : (m,) int array
        The bone with most weight on each face; left and right are one, small bones count as their parents.
    bone_names : list of str
    action : str
        What the frames are from.
    """

    name: str
    vertices: FloatArray
    rest: FloatArray
    faces: IntArray
    polygon: IntArray
    bone: IntArray
    bone_names: list[str]
    action: str

    @property
    def rest_mesh(self) -> TriangleMesh:
        """The mesh at rest."""
        return TriangleMesh(self.rest, self.faces)

    @property
    def learned(self) -> list[TriangleMesh]:
        """The mesh in the frames to learn from."""
        return [TriangleMesh(self.vertices[i], self.faces) for i in LEARNED]

    @property
    def unseen(self) -> list[TriangleMesh]:
        """The mesh in the other frames."""
        return [TriangleMesh(points, self.faces) for i, points in enumerate(self.vertices) if i not in LEARNED]


def files(folders: Iterable[Path]) -> list[Path]:
    """Files of characters in folders; a path may also be a file."""
    found = []
    for folder in folders:
        found += sorted(p for p in folder.iterdir() if p.suffix.lower() in FILES) if folder.is_dir() else [folder]
    return found


def load(path: Path, cache: Path = CACHE) -> Rig:
    """The character in a file, from the cache if it is there; RuntimeError if Blender cannot read it."""
    target = cache / f"{path.resolve().parent.name}_{path.name}.{VERSION}.npz"
    if not target.exists() or target.stat().st_mtime < path.stat().st_mtime:
        cache.mkdir(parents=True, exist_ok=True)
        unfinished = target.with_suffix(".part.npz")
        command = [sys.executable, "-m", "benchmarks.rig_reader", str(path), str(unfinished)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=READING_LIMIT, env={**os.environ})
        if done.returncode:
            raise RuntimeError(f"{path}: {done.stderr.strip()[-500:]}")
        unfinished.replace(target)
    with np.load(target) as arrays:
        return Rig(
            path.stem, arrays["vertices"], arrays["rest"], arrays["faces"], arrays["polygon"], arrays["bone"],
            [str(name) for name in arrays["bone_names"]], str(arrays["action"]),
        )  # fmt: skip
