"""A described pose: a surface and the signature of each of its vertices."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..mesh.mirror import Mirror
from ..mesh.surface import Surface
from ..mesh.triangle_mesh import FloatArray, TriangleMesh
from ..message import Message
from ..spectral.intrinsic_delaunay import Laplacian

_SURFACE_MAPS = ("vertex_of", "face_of", "welded_faces")


@dataclass(frozen=True)
class PoseSignature:
    """A described pose: what takes long to compute, to be computed once and used for learning and labeling.

    Attributes
    ----------
    surface : Surface
        The welded and refined surface, with n' vertices.
    signature : (n', n_energies) array of float
        Wave kernel signature at each vertex of the surface.
    n_eigenpairs : int
        Number of eigenpairs that the signature was computed from.
    laplacian : "cotangent" or "delaunay"
        The triangles that the Laplacian was computed on.

    Examples
    --------
    >>> from examples.tube import tube
    >>> from wks_segment.core import PoseSegmentation
    >>> [described] = PoseSegmentation(n_eigenpairs=40).describe_all([tube(0.5)])
    >>> described.signature.shape[1]  # energies
    100
    """

    surface: Surface
    signature: FloatArray
    n_eigenpairs: int
    laplacian: Laplacian = "cotangent"

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Arrays by name, to be written to a file; `of_arrays` reads them."""
        mirror = self.surface.mirror
        return {
            **({} if mirror is None else {"mirror_image": mirror.image, "mirror_side": mirror.side}),
            **{f"original_{name}": array for name, array in self.surface.original.arrays().items()},
            **{f"surface_{name}": array for name, array in self.surface.mesh.arrays().items()},
            **{name: getattr(self.surface, name) for name in _SURFACE_MAPS},
            "signature": self.signature,
            "n_eigenpairs": np.array(self.n_eigenpairs),
            "delaunay": np.array(self.laplacian == "delaunay"),
        }

    @classmethod
    def of_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> PoseSignature:
        """The described pose in arrays that `arrays` made; KeyError or ValueError if they are none."""
        original, surface = (
            TriangleMesh.of_arrays({
                name.removeprefix(f"{which}_"): array for name, array in arrays.items() if name.startswith(f"{which}_")
            })
            for which in ("original", "surface")
        )  # fmt: skip
        signature = arrays["signature"]
        if signature.ndim != 2 or len(signature) != surface.n_vertices:
            raise ValueError(
                Message(
                    "the signature has the shape {shape}, for {n_vertices} vertices",
                    shape=signature.shape, n_vertices=surface.n_vertices,
                )
            )  # fmt: skip
        mirror = Mirror(arrays["mirror_image"], arrays["mirror_side"]) if "mirror_image" in arrays else None
        return cls(
            Surface(original, surface, **{name: arrays[name] for name in _SURFACE_MAPS}, mirror=mirror),
            signature,
            int(arrays["n_eigenpairs"]),
            "delaunay" if arrays["delaunay"] else "cotangent",
        )


def of_one_mesh(poses: Sequence[PoseSignature]) -> bool:
    """Whether these are several poses with the same faces."""
    faces = [pose.surface.original.faces for pose in poses]
    return len(poses) > 1 and all(np.array_equal(faces[0], other) for other in faces[1:])
