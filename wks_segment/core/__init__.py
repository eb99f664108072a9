"""The method, without Blender: mesh → surface → laplacian → spectrum → signature → mixture → regions → segmentation."""

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
