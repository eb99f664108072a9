"""The method without Blender: learns the segments of a character from poses, and labels any pose with them.

In the order of use:

- `TriangleMesh` is a pose. `connect` decides once how a mesh is connected in all of its poses; `prepare_surface` makes
  the welded and refined `Surface` that everything is computed on.
- `delaunay`, `mass_matrix` and `stiffness_matrix` make the Laplacian, `eigenpairs` solves it, and
  `heat_kernel_signature` and `wave_kernel_signature` describe each vertex.
- `PoseSegmentation` does all of this: `describe_all` gives a `PoseSignature` for each pose, `fit` learns segments, and
  `segment_faces`, `segment_polygons`, `segment_regions` and others label poses. A `Workpiece` is a described pose that
  is labeled several times. `PartNotes` are names and colors that a user gave, kept with the model.
- `MemoryCache` and `DiskCache` keep what takes long to compute.
- `fit_mixture` fits the `GaussianMixture` below it.
- `rank` tells which of several models fits a shape; `described_alike` groups models that share signatures, and
  `retrieve` measures a ranking.

A name is imported when it is first used, because SciPy takes a second to import, and Blender imports this package when
it starts.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # the same as in MODULES, for readers of code that do not run it
    from .learning.gaussian_mixture import GaussianMixture, fit_mixture
    from .mesh.surface import Connection, Surface, connect, prepare_surface
    from .mesh.triangle_mesh import TriangleMesh
    from .model_file import ModelFileError
    from .poses.pose_cache import Workpiece
    from .poses.pose_signature import PoseSignature
    from .poses.signature_cache import Cache, DiskCache, MemoryCache, SignatureCache
    from .ranking import Rank, Ranking, Retrieval, described_alike, rank, retrieve
    from .segmentation import PoseSegmentation
    from .spectral.eigenpairs import SpectrumError, SpectrumWarning, eigenpairs
    from .spectral.intrinsic_delaunay import delaunay
    from .spectral.laplacian import mass_matrix, stiffness_matrix
    from .spectral.signature import heat_kernel_signature, wave_kernel_signature
    from .user_labels import PartNotes

__all__ = [
    "Cache",
    "Connection",
    "DiskCache",
    "GaussianMixture",
    "MemoryCache",
    "ModelFileError",
    "PartNotes",
    "PoseSegmentation",
    "PoseSignature",
    "Rank",
    "Ranking",
    "Retrieval",
    "SignatureCache",
    "SpectrumError",
    "SpectrumWarning",
    "Surface",
    "TriangleMesh",
    "Workpiece",
    "connect",
    "delaunay",
    "described_alike",
    "eigenpairs",
    "fit_mixture",
    "heat_kernel_signature",
    "mass_matrix",
    "prepare_surface",
    "rank",
    "retrieve",
    "stiffness_matrix",
    "wave_kernel_signature",
]

MODULES = {
    "learning.gaussian_mixture": ("GaussianMixture", "fit_mixture"),
    "mesh.surface": ("Connection", "Surface", "connect", "prepare_surface"),
    "mesh.triangle_mesh": ("TriangleMesh",),
    "model_file": ("ModelFileError",),
    "poses.pose_cache": ("Workpiece",),
    "poses.pose_signature": ("PoseSignature",),
    "poses.signature_cache": ("Cache", "DiskCache", "MemoryCache", "SignatureCache"),
    "ranking": ("Rank", "Ranking", "Retrieval", "described_alike", "rank", "retrieve"),
    "segmentation": ("PoseSegmentation",),
    "spectral.eigenpairs": ("SpectrumError", "SpectrumWarning", "eigenpairs"),
    "spectral.intrinsic_delaunay": ("delaunay",),
    "spectral.laplacian": ("mass_matrix", "stiffness_matrix"),
    "spectral.signature": ("heat_kernel_signature", "wave_kernel_signature"),
    "user_labels": ("PartNotes",),
}
"""Public names by the module that defines them."""
_MODULE_OF = {name: module for module, names in MODULES.items() for name in names}


def __getattr__(name: str) -> Any:
    """Called by Python for a name that is not imported yet."""
    if name not in _MODULE_OF:
        raise AttributeError(name, name=name)
    value = getattr(importlib.import_module(f".{_MODULE_OF[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
