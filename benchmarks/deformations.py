"""The same parts under strong deformation: a horse, an elephant and a woman. Part of `benchmarks.quality`."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from benchmarks.pictures import Shape, picture
from benchmarks.speed import table_row
from wks_segment.core import DiskCache, PoseSegmentation, TriangleMesh, connect
from wks_segment.core.mesh.triangle_mesh import FloatArray, IntArray

N_LEARNED = 5
"""Number of learned poses, evenly chosen from all."""
Z_IS_UP = ("victoria",)
"""Shapes whose z axis points up; in the others it is y."""


def table(options: argparse.Namespace, model: Callable[[str], PoseSegmentation], presets: Sequence[str]) -> None:
    """Print the share of the area of unseen poses with the learned label, and draw all poses."""
    print("| shape | vertices | setting | unseen poses | mean | each |\n" + "|---" * 6 + "|")
    means: dict[str, list[float]] = {preset: [] for preset in presets}
    drawings: dict[Path, list[Shape]] = {}
    for path in sorted((options.data / "poses").glob("*.npz")):
        with np.load(path) as arrays:
            poses, faces = arrays["poses"].astype(np.float64), _faces_of_poses(arrays)
        learned = np.linspace(0, len(poses) - 1, N_LEARNED).round().astype(int).tolist()
        unseen = [i for i in range(len(poses)) if i not in learned]
        # The learned poses are one mesh: the faces of the first of them.
        together = [TriangleMesh(poses[i], faces[learned[0]]) for i in learned]
        others = [TriangleMesh(poses[i], faces[i]) for i in unseen]
        connections = [connect(*together)] * len(together) + [connect(mesh) for mesh in others]
        cache = None if options.signatures is None else DiskCache(options.signatures)
        described = PoseSegmentation().describe_all([*together, *others], connections, workers=1, cache=cache)
        for preset in presets:
            fitted = model(preset).fit(described[: len(together)])
            triangles = np.arange(together[0].n_faces)
            known = fitted.segment_polygons(described[: len(together)], [triangles] * len(together))
            shapes = [(f"{path.stem} {i}, learned", m, known) for i, m in zip(learned, together, strict=True)]
            shares = []
            for i, mesh, pose in zip(unseen, others, described[len(together) :], strict=True):
                labels = fitted.segment_polygons([pose], [np.arange(mesh.n_faces)])
                same = labels == known[nearest_faces(poses[learned[0]], mesh.faces, together[0].faces)]
                shares.append(float(np.average(same, weights=mesh.face_areas)))
                shapes.append((f"{path.stem} {i}", mesh, labels))
            means[preset].append(float(np.mean(shares)))
            each = " ".join(f"{share:.3f}" for share in shares)
            cells = [path.stem, f"{poses.shape[1]:,}", preset, str(len(unseen)), f"{means[preset][-1]:.3f}", each]
            print(table_row(cells), flush=True)
            drawings[options.output / f"{path.stem}_{preset}.png"] = shapes
    for preset in presets:
        print(table_row([f"**mean of {len(means[preset])}**", "", preset, "", f"**{np.mean(means[preset]):.3f}**", ""]))
    for target, shapes in drawings.items():
        picture(shapes, target, y_is_up=not target.name.startswith(Z_IS_UP))
    print(f"\npictures: {options.output}")


def nearest_faces(vertices: FloatArray, faces: IntArray, others: IntArray) -> IntArray:
    """For each face the nearest one of other faces on the same vertices, by their centers."""
    nearest = cKDTree(vertices[others].mean(axis=1)).query(vertices[faces].mean(axis=1))[1]
    return np.asarray(nearest)


def _faces_of_poses(arrays: Mapping[str, Any]) -> list[IntArray]:
    """Faces of each pose: their own, or the same for all."""
    count = len(arrays["poses"])
    own = [arrays["faces"] if "faces" in arrays else arrays[f"faces_{i}"] for i in range(count)]
    return [faces.astype(np.int64) for faces in own]
