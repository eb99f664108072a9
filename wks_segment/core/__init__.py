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
"""

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
