"""What is known of one pose: its surface and the signature of each of its vertices."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..mesh.surface import Surface
from ..mesh.triangle_mesh import FloatArray, TriangleMesh
from ..spectral.intrinsic_delaunay import Laplacian

_MAPS = ("vertex_of", "face_of", "welded_faces")


@dataclass(frozen=True)
class PoseSignature:
    """One pose, described: what takes the time, to be computed once and used for learning and labeling.

    Attributes
    ----------
    surface : Surface
        The welded and refined surface, with n' vertices.
    signature : (n', n_energies) array of float
    n_eigenpairs : int
        What it was computed from.
    laplacian : "cotangent" or "delaunay"
        The triangles that it was computed on.
    """

    surface: Surface
    signature: FloatArray
    n_eigenpairs: int
    laplacian: Laplacian = "cotangent"

    def arrays(self) -> dict[str, NDArray[Any]]:
        """What a file keeps; see `of_arrays`."""
        return {
            **{f"original_{name}": array for name, array in self.surface.original.arrays().items()},
            **{f"surface_{name}": array for name, array in self.surface.mesh.arrays().items()},
            **{name: getattr(self.surface, name) for name in _MAPS},
            "signature": self.signature,
            "n_eigenpairs": np.array(self.n_eigenpairs),
            "delaunay": np.array(self.laplacian == "delaunay"),
        }

    @classmethod
    def of_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> PoseSignature:
        """From what `arrays` gave; KeyError or ValueError if it is not that."""
        original, surface = (
            TriangleMesh.of_arrays({
                name.removeprefix(f"{which}_"): array for name, array in arrays.items() if name.startswith(f"{which}_")
            })
            for which in ("original", "surface")
        )  # fmt: skip
        signature = arrays["signature"]
        if signature.ndim != 2 or len(signature) != surface.n_vertices:
            raise ValueError(f"the signature has the shape {signature.shape}, for {surface.n_vertices} vertices")
        return cls(
            Surface(original, surface, *(arrays[name] for name in _MAPS)),
            signature,
            int(arrays["n_eigenpairs"]),
            "delaunay" if arrays["delaunay"] else "cotangent",
        )
