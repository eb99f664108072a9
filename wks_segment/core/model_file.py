"""Models as JSON: data only, readable by a person, the same bytes on every machine."""

from __future__ import annotations

import json
import os
from os import PathLike
from pathlib import Path
from typing import Any, get_args

import numpy as np

from .labeling.region_atlas import FIELDS, PLANES
from .learning.gaussian_mixture import CovarianceType
from .mesh.triangle_mesh import FloatArray, IntArray
from .user_labels import PartNotes

FORMAT = "wks_segment model"
VERSION = 4
PARAMETERS = (
    "n_segments", "covariance_type", "n_eigenpairs", "n_energies", "accuracy", "random_state", "scaling",
    "pieces", "laplacian", "smoothness", "preset",
)  # fmt: skip
LARGEST = {"n_segments": 1000, "n_eigenpairs": 5000, "n_energies": 1000}
"""A file that asks for more would have a mesh refined until the memory is full."""
LEAST, MOST = 1e-6, 1e6
"""Sizes of numbers in a model: spreads lie between them, their squares bound variances. Beyond, single precision would
lose a signature's digits, or overflow."""
MOST_COMPONENTS, MOST_REGIONS, MOST_POSES = 1100, 400, 10_000
KINDS = ("region", "sided")
"""Of regions: wholes, and segments by which left and right are told."""
MAX_BYTES = 20 * 2**20
"""A file above this is not read, nor written: what is in there could take longer than a second. 64 segments with
diagonal covariances take 300 kB, 8 with full ones 2 MB."""


class ModelFileError(ValueError):
    """The file or text is not a model that this version can read; the message says why."""


def encode(
    parameters: dict[str, Any], arrays: dict[str, FloatArray | IntArray], covariance_type: CovarianceType,
    notes: PartNotes,
) -> str:  # fmt: skip
    """JSON text of a model."""
    content = {
        "format": FORMAT,
        "version": VERSION,
        "parameters": parameters,
        "mixture_covariance_type": covariance_type,
        **notes.as_json(),
        **{name: array.tolist() for name, array in arrays.items()},
    }
    return json.dumps(content, default=_plain, allow_nan=False)


def decode(text: str) -> tuple[dict[str, Any], dict[str, FloatArray], CovarianceType, PartNotes]:
    """Parameters, arrays, covariance type and notes of a model, all checked; ModelFileError if anything is off."""
    try:
        content = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ModelFileError(f"this is not a model of WKS Segment: it is no JSON ({error})") from error
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise ModelFileError("this is not a model of WKS Segment")
    if content.get("version") != VERSION:
        older = isinstance(content.get("version"), int) and content["version"] < VERSION
        raise ModelFileError(
            f"the model has version {content.get('version')!r}, this program reads {VERSION}: "
            f"{'learn it anew' if older else 'update WKS Segment'}"
        )
    parameters = content.get("parameters")
    if not isinstance(parameters, dict) or set(parameters) != set(PARAMETERS):
        raise ModelFileError(f"the model is damaged: its parameters are not {', '.join(PARAMETERS)}")
    covariance_type: CovarianceType = content.get("mixture_covariance_type")  # type: ignore[assignment]  # checked below
    for name, most in LARGEST.items():
        if isinstance(parameters[name], int) and parameters[name] > most:
            raise ModelFileError(f"the model is damaged: {name} is {parameters[name]}, more than {most}")
    k, d = _n_components(content, parameters["n_segments"]), parameters["n_energies"]
    grouped: dict[str, tuple[int, ...]] = {}
    if parameters["preset"] != "paper":
        grouped = {"joins": (k - 1, 2), "certainties": (k,), "by_chance": (k,), "cuts": (k,)}
        for kind in KINDS:
            r = _length(content, f"{kind}_segment", MOST_REGIONS)
            of_regions = {
                "segment": (r,), "side": (r,), "area": (r,), "distance": (r, r), "signature": (r, FIELDS),
                "handedness": (r, PLANES), "groups": (), "noise": (4,),
            }  # fmt: skip
            grouped |= {f"{kind}_{name}": shape for name, shape in of_regions.items()}
    n_poses = _length(content, "usual_scores", MOST_POSES)
    if not n_poses:
        raise ModelFileError("the model is damaged: usual_scores is empty")
    shapes = {"shared": (d,), "diag": (k, d), "spherical": (k,), "tied": (d, d), "full": (k, d, d)}
    if covariance_type not in get_args(CovarianceType):
        raise ModelFileError(f"the model is damaged: unknown covariance type {covariance_type!r}")
    arrays = {
        name: _array(content, name, shape)
        for name, shape in {
            "centre": (d,), "spread": (d,), "weights": (k,), "means": (k, d), "covariances": shapes[covariance_type],
            "usual_scores": (n_poses,), **grouped,
        }.items()
    }  # fmt: skip
    if grouped:
        _check_joins(arrays["joins"], k)
        for kind in KINDS:
            _check_regions(arrays, kind, k)
    for name, array in arrays.items():
        if np.abs(array).max(initial=0) > (MOST**2 if name == "covariances" else MOST):
            raise ModelFileError(f"the model is damaged: {name} has a number of {np.abs(array).max():.3g}, too large")
    variances = arrays["covariances"]
    if covariance_type in ("tied", "full"):
        variances = np.diagonal(variances, axis1=-2, axis2=-1)
    if arrays["spread"].min() < LEAST or variances.min() < LEAST**2:
        raise ModelFileError("the model is damaged: a spread or a variance is not positive, or far too small")
    if covariance_type in ("tied", "full"):
        positive = bool((np.linalg.eigvalsh(arrays["covariances"]) > 0).all())
    else:
        positive = bool((arrays["covariances"] > 0).all())
    if not (positive and (arrays["spread"] > 0).all() and (arrays["weights"] > 0).all()):
        raise ModelFileError("the model is damaged: a variance or a weight is not positive")
    if abs(arrays["weights"].sum() - 1) > 1e-6:
        raise ModelFileError("the model is damaged: the weights do not sum to 1")
    try:
        notes = PartNotes.of_json(content)
    except ValueError as error:
        raise ModelFileError(f"the model is damaged: {error}") from error
    return parameters, arrays, covariance_type, notes


def _n_components(content: dict[str, Any], n_segments: Any) -> int:
    """Components of the mixture: as many as weights."""
    count = _length(content, "weights", MOST_COMPONENTS)
    if n_segments != "auto" and (not isinstance(n_segments, int) or n_segments > count):
        raise ModelFileError(f"the model is damaged: {n_segments} segments of {count} components")
    return count


def _length(content: dict[str, Any], name: str, most: int) -> int:
    numbers = content.get(name)
    if not isinstance(numbers, list) or len(numbers) > most:
        raise ModelFileError(f"the model is damaged: {name} is missing, or has too many numbers")
    return len(numbers)


def _check_joins(joins: FloatArray, n_components: int) -> None:
    """Each join is of two groups that are there, named by the larger one's name in it."""
    alive = set(range(n_components))
    for i, j in joins.tolist():
        if not (i in alive and j in alive and i != j):
            raise ModelFileError(f"the model is damaged: joins has the pair {i:g}, {j:g}, which cannot be joined")
        alive.remove(j)


def _check_regions(arrays: dict[str, FloatArray], kind: str, n_components: int) -> None:
    """Regions belong to groups that are there, have an area, and are left, right or neither."""
    groups, segment = arrays[f"{kind}_groups"], arrays[f"{kind}_segment"]
    if not (1 <= groups <= n_components and groups % 1 == 0):
        raise ModelFileError(f"the model is damaged: {kind}_groups is {groups:g}, not a number of groups")
    if not (len(segment) and (segment % 1 == 0).all() and (segment >= 0).all() and (segment < groups).all()):
        raise ModelFileError(f"the model is damaged: {kind}_segment has a number that is none of {groups:g} groups")
    if not np.isin(arrays[f"{kind}_side"], (-1, 0, 1)).all():
        raise ModelFileError(f"the model is damaged: {kind}_side has a number that is not -1, 0 or 1")
    if not ((arrays[f"{kind}_area"] > 0).all() and (arrays[f"{kind}_noise"] > 0).all()):
        raise ModelFileError(f"the model is damaged: {kind}_area or {kind}_noise is not positive")


def write(path: str | PathLike[str], text: str) -> None:
    """Write text to a file so that a failure half-way leaves an older file as it was.

    Raises
    ------
    ValueError
        If the model is so large that `read` would refuse it.
    OSError
        If the file cannot be written.
    """
    if len(text) > MAX_BYTES:
        raise ValueError(
            f"the model takes {len(text) / 2**20:.0f} MB, and only {MAX_BYTES / 2**20:.0f} MB would be read again: "
            "take fewer segments or energies, or another covariance than full"
        )
    target = Path(path).resolve()
    if target.exists() and not os.access(target, os.W_OK):
        raise PermissionError(f"{target} may not be written to")
    temporary = target.with_name(f".{target.name}.{os.getpid()}.tmp")
    try:
        with temporary.open("x", encoding="utf-8") as file:
            file.write(text)
        os.replace(temporary, target)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def read(path: str | PathLike[str]) -> str:
    """Text of a model file; ModelFileError if it is too large or no text."""
    size = Path(path).stat().st_size
    if size > MAX_BYTES:
        raise ModelFileError(f"{size / 2**20:.0f} MB is too large for a model")
    try:
        return Path(path).read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise ModelFileError("this is not a model of WKS Segment, but a binary file") from error


def _array(content: dict[str, Any], name: str, shape: tuple[int, ...]) -> FloatArray:
    try:
        array = np.array(content[name], dtype=np.float64)
    except (KeyError, ValueError, TypeError, OverflowError) as error:
        raise ModelFileError(f"the model is damaged: {name} is missing or not numbers") from error
    if array.shape != shape:
        raise ModelFileError(f"the model is damaged: {name} has the shape {array.shape}, not {shape}")
    if not np.isfinite(array).all():
        raise ModelFileError(f"the model is damaged: {name} has a number that is not finite")
    return array


def _plain(value: object) -> object:
    """NumPy's numbers as Python's own."""
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"{type(value).__name__} cannot be written to a model")
