"""The method, without Blender: mesh → surface → laplacian → spectrum → signature → mixture → regions → segmentation."""

from .cache import Cache, DiskCache, MemoryCache, SignatureCache
from .intrinsic import delaunay
from .laplacian import mass_matrix, stiffness_matrix
from .mesh import TriangleMesh
from .mixture import GaussianMixture, fit_mixture
from .model_file import ModelFileError
from .part_notes import PartNotes
from .pose_signature import PoseSignature
from .ranking import Rank, Ranking, Retrieval, described_alike, rank, retrieve
from .segmentation import PoseSegmentation
from .signature import heat_kernel_signature, wave_kernel_signature
from .spectrum import SpectrumError, SpectrumWarning, eigenpairs
from .surface import Connection, Surface, connect, prepare_surface
from .workpiece import Workpiece

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
