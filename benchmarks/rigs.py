"""Parts compared with the bones of rigged characters: `python -m benchmarks.rigs FOLDER… [--output FOLDER]`.

Of each file in the folders, five frames of the action that moves most are learned and three are unseen. Prints a
Markdown table and writes a picture of each character. The measures:

bones whole       share of the area that has the commonest label of its bone
segments pure     share of the area that belongs to the largest bone of its segment, relative to the most that so many
                  segments could have
border at joints  share of the length of borders that is within 3 % of √area of a border between bones
unseen            share of the area of unseen frames, each labeled as a mesh of its own, with the learned label
left/right        share of the area with another label than its mirror image, where a mesh at rest is symmetric
turning           mean angle in degrees by which borders turn at a vertex

Files are read with Blender once and kept as arrays.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks import part_measures
from benchmarks.pictures import Shape, picture
from benchmarks.speed import table_row
from wks_segment.core import DiskCache, PoseSegmentation, TriangleMesh, connect
from wks_segment.core.mesh.triangle_mesh import FloatArray, IntArray, repeats_a_vertex

FILES = (".glb", ".gltf", ".fbx", ".blend", ".usdz", ".usdc", ".usda", ".usd")
CACHE = Path("demo/rigs/cache")
VERSION = 2
"""Of the cached arrays; counted up when what is read changes."""
LEARNED = (0, 2, 4, 5, 7)
"""Frames that are learned, evenly among the eight as `wks_segment demo` chooses them; the others are unseen."""
READING_LIMIT = 600
"""Seconds for one file, which takes twenty at most on a free machine: bpy may hang."""
MEASURES = {
    "bones whole": ".3f", "segments pure": ".3f", "border at joints": ".3f", "unseen": ".3f", "left/right": ".3f",
    "turning": ".1f",
}  # fmt: skip
"""Names of the columns with means, and how many digits they have."""


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
    part : (m,) int array
        The named part of each face by the bones of its rig, −1 for none.
    part_names : list of str
    """

    name: str
    vertices: FloatArray
    rest: FloatArray
    faces: IntArray
    polygon: IntArray
    bone: IntArray
    bone_names: list[str]
    action: str
    part: IntArray
    part_names: list[str]

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
            raise RuntimeError(done.stderr.strip().splitlines()[-1] if done.stderr.strip() else "Blender has crashed")
        unfinished.replace(target)
    with np.load(target) as arrays:
        return Rig(
            path.stem, arrays["vertices"], arrays["rest"], arrays["faces"], arrays["polygon"], arrays["bone"],
            [str(name) for name in arrays["bone_names"]], str(arrays["action"]),
            arrays["part"], [str(name) for name in arrays["part_names"]],
        )  # fmt: skip


def main() -> int:
    """Measure all characters of some folders; return 1 if one of them failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", type=Path, nargs="+", metavar="FOLDER")
    parser.add_argument("--output", type=Path, default=Path("demo/rigs"))
    parser.add_argument("--segments", default="8", help='number of segments, or "auto"')
    parser.add_argument("--signatures", type=Path, help="folder to keep signatures in, for further runs")
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    paths = files(options.folders)
    print(table_row(["character", "faces", "segments", *MEASURES]) + f"\n|{'---|' * (3 + len(MEASURES))}")
    rows, drawings = [], {}
    for path in paths:
        try:
            row, drawings[f"{path.resolve().parent.name}_{path.stem}"] = measure(
                load(path, options.output / "cache"), options
            )
            rows.append(row)
        except (RuntimeError, ValueError, OSError, subprocess.TimeoutExpired) as error:
            print(f"| {path.stem} | failed: {error} |", flush=True)
    means = [_mean([row[name] for row in rows]) for name in MEASURES]
    print(table_row([f"**mean of {len(rows)}**", "", "", *_cells(means)]), flush=True)
    for name, shapes in drawings.items():  # at the end, since Blender writes lines of its own
        picture(shapes, options.output / f"{name}.png", columns=3, y_is_up=False)
    print(f"\npictures: {options.output}")
    return int(len(rows) < len(paths))


def measure(rig: Rig, options: argparse.Namespace) -> tuple[dict[str, float], list[Shape]]:
    """Learn and label a character, and print its row of the table; gives the measures and what to draw."""
    model = PoseSegmentation("auto" if options.segments == "auto" else int(options.segments))
    cache = None if options.signatures is None else DiskCache(options.signatures)
    learned, unseen, rest = rig.learned, rig.unseen, rig.rest_mesh
    polygon = np.unique(rig.polygon, return_inverse=True)[1].ravel()
    connections = [connect(*learned, rest=rest)] * len(learned) + [connect(mesh, rest=rest) for mesh in unseen]
    described = model.describe_all([*learned, *unseen], connections, workers=1, cache=cache)
    together = described[: len(learned)]
    labels = model.fit(together, rest=rest).segment_polygons(together, [polygon] * len(learned))[polygon]
    shares = [
        float(np.average(model.segment_polygons([pose], [polygon])[polygon] == labels, weights=mesh.face_areas))
        for pose, mesh in zip(described[len(learned) :], unseen, strict=True)
    ]
    welded, used = connections[0].welded[rig.faces], np.unique(labels, return_inverse=True)[1].ravel()
    proper = ~repeats_a_vertex(welded)
    borders = TriangleMesh(rig.rest, welded[proper])
    row = {
        "bones whole": part_measures.bones_whole(used, rig.bone, rest.face_areas),
        "segments pure": part_measures.segments_pure(used, rig.bone, rest.face_areas),
        "border at joints": part_measures.border_at_joints(borders, used[proper], rig.bone[proper]),
        "unseen": float(np.mean(shares)),
        "left/right": part_measures.sides_differ(rest, used, rig.bone),
        "turning": part_measures.turning(borders, used[proper]),
    }
    cells = [rig.name, f"{len(rig.faces):,}", str(used.max() + 1), *_cells([row[name] for name in MEASURES])]
    print(table_row(cells), flush=True)
    action = rig.action.split("|")[-1]
    shapes = [(f"{rig.name}, {action} {i}", mesh, labels) for i, mesh in zip(LEARNED, learned, strict=True)]
    return row, [*shapes, ("bones, at rest", rest, rig.bone)]


def _mean(values: Sequence[float]) -> float:
    """Mean of the values that there are; NaN if there is none."""
    there = [value for value in values if not np.isnan(value)]
    return float(np.mean(there)) if there else float("nan")


def _cells(values: Sequence[float]) -> list[str]:
    """The values of the measures as text, empty for NaN."""
    return ["" if np.isnan(v) else format(v, digits) for v, digits in zip(values, MEASURES.values(), strict=True)]


if __name__ == "__main__":
    code = main()
    sys.stdout.flush()
    os._exit(code)  # some versions of bpy crash at a normal exit
