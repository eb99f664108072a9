"""Pictures of labels for the benchmarks."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np

from wks_segment.core import TriangleMesh
from wks_segment.core.mesh.triangle_mesh import IntArray

Shape = tuple[str, TriangleMesh, IntArray]
"""Caption, mesh and labels of its faces."""


def picture(shapes: Sequence[Shape], path: Path, columns: int = 4, y_is_up: bool = True) -> None:
    """Render meshes, each as large as its tile, in the colors of their labels; data sets mostly have y up."""
    from wks_segment.blender.render.contact_sheet import Tile, render_poses
    from wks_segment.blender.scene.poses import Pose

    tiles: list[Tile] = []
    for name, mesh, labels in shapes:
        upright = mesh.vertices[:, [0, 2, 1]] * (1, -1, 1) if y_is_up else mesh.vertices
        # Each mesh is a character of its own, which the sheet scales to its tile.
        pose = SimpleNamespace(
            mesh=TriangleMesh(upright, mesh.faces), polygon_of=np.arange(mesh.n_faces), character=len(tiles)
        )
        tiles.append(Tile(cast(Pose, pose), labels, name))
    render_poses(tiles, path, columns)
