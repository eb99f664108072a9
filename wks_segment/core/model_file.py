"""Model files: JSON with data only, readable by people, the same bytes on every machine."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any, get_args

import numpy as np

from .files.checked_json import (
    BELOW_ONE,
    MOST_NUMBER,
    POSITIVE,
    DamagedError,
    Field,
    digest_of,
    length,
    parsed,
    quoted,
    read_array,
)
from .files.model_arrays import check_groups, check_joins, check_means, check_variances
from .files.whole_file import write_whole
from .labeling.region_atlas import RegionAtlas
from .labeling.traits import FIELDS, PLANES, SURROUNDINGS
from .learning.body_plan import BodyPlan
from .learning.gaussian_mixture import CovarianceType, GaussianMixture
from .learning.merge_tree import MOST_SEGMENTS, MergeTree
from .learning.parameters import PARAMETERS, check_parameters, effective
from .learning.part_mixture import PartMixture
from .learning.standardizer import LEAST_SPREAD, Standardizer
from .learning.taught_parts import MOST_TAUGHT, TaughtParts
from .mesh.triangle_mesh import FloatArray, IntArray
from .message import Message, message_of
from .parts.body_places import COORDINATES
from .user_labels import PartNotes

FORMAT = "wks_segment model"
MODEL_VERSION = 5
"""To be raised whenever older programs would misread a new file, or this program an old one."""
TAUGHT_VERSION = 6
"""Version of models of taught parts: programs that know none would number them wrongly."""
PLAN_VERSION = 7
"""Version of models of taught parts with their places in the plan of a body: programs that know none would find the
numbers changed."""
UNIONS_VERSION = 4
"""Version of models whose segments are unions of components by signature alone. They are read, and label as before."""
MOST_CUT, BEST_WITHIN = 10.0, 0.06
"""In such a model, border by area above which groups are fragments, and how far the certainty with an open number of
segments may be below the best."""
LEAST_CUT = 1e-6
"""Lower bound of borders in such a model, whose logarithm must be finite."""
MOST_OF_PARAMETER = {"n_segments": 1000, "n_eigenpairs": 5000, "n_energies": 1000}
"""Upper bounds of parameters in a file: with more, a mesh would be refined until the memory is full."""
MOST_SEED = 2**32
"""Upper bound of other parameters, of which the seed is the largest."""
ADJUSTABLE = ("n_segments", "smoothness")
"""Parameters that are changed after a model was learned."""
WHOLE_SHARE = 1.001
"""Upper bound of certainties and shares of the area, which are rounded."""
MOST_COMPONENTS, MOST_REGIONS, MOST_POSES = 2700, 400, 10_000
"""Upper bounds of counts in a file: above what any fit makes, and small enough to be checked in a second."""
REGION_KINDS = ("region", "sided")
"""The two atlases of a file: of wholes, and of segments by which left and right are told."""
MAX_BYTES = 20 * 2**20
"""Maximum size of a file, which would take more than a second to read: 64 segments with diagonal covariances take
300 kB, 8 with full ones 2 MB."""


class ModelFileError(ValueError):
    """The file or text is not a model that this version can read; the message says why.

    Examples
    --------
    >>> from wks_segment.core import ModelFileError, PoseSegmentation
    >>> try:
    ...     PoseSegmentation.from_json("no model")
    ... except ModelFileError:
    ...     print("refused")
    refused
    """


@dataclass(frozen=True)
class ModelContent:
    """Everything that a model file holds.

    Attributes
    ----------
    parameters : dict
        Of the model, by name.
    learned : PartMixture
    standardizer : Standardizer
    atlases : (RegionAtlas, RegionAtlas) or None
        Of wholes and of segments.
    usual_scores : (poses,) array
    part_notes : PartNotes
    """

    parameters: dict[str, Any]
    learned: PartMixture
    standardizer: Standardizer
    atlases: tuple[RegionAtlas, RegionAtlas] | None
    usual_scores: FloatArray
    part_notes: PartNotes


def encode(model: ModelContent) -> str:
    """JSON text of a model."""
    mixture, grouping = model.learned.mixture, model.learned.grouping
    arrays: dict[str, FloatArray | IntArray] = {
        "centre": model.standardizer.mean, "spread": model.standardizer.spread, "weights": mixture.weights,
        "means": mixture.means, "covariances": mixture.covariances, "usual_scores": model.usual_scores,
    }  # fmt: skip
    if grouping is not None:
        arrays |= {
            "joins": grouping.pairs,
            "n_kinds": np.array(grouping.n_kinds),
            "natural": np.array(grouping.natural),
        }
        arrays |= {name: getattr(grouping, name) for name in ("certainties", "by_chance", "likeness")}
        if grouping.areas is not None:
            arrays["areas"] = grouping.areas
    if model.learned.of_bodies:
        arrays["of_bodies"] = np.array(1)
    taught, plan = model.learned.taught, model.learned.plan
    if taught is not None:
        arrays |= taught.arrays()
    if plan is not None:
        arrays |= plan.arrays()
    for kind, atlas in zip(REGION_KINDS, model.atlases or (), strict=False):
        arrays |= atlas.arrays(kind)
    content = {
        "format": FORMAT,
        "version": PLAN_VERSION if plan is not None else MODEL_VERSION if taught is None else TAUGHT_VERSION,
        "parameters": {name: model.parameters[name] for name in PARAMETERS},
        "mixture_covariance_type": mixture.covariance_type,
        "digest": _digest(model.parameters, mixture.covariance_type, arrays),
        **model.part_notes.as_json(),
        **{name: array.tolist() for name, array in arrays.items()},
    }
    return json.dumps(content, default=_as_python, allow_nan=False)


def decode(text: str) -> ModelContent:
    """The model in JSON text, with every value checked; ModelFileError if anything is wrong."""
    content = _content(text)
    try:
        return _decoded(content)
    except DamagedError as error:
        raise ModelFileError(Message("the model is damaged: {reason}", reason=message_of(error))) from error


def _decoded(content: dict[str, Any]) -> ModelContent:
    """The model in the JSON object of a file; DamagedError, which names the value, if one is wrong."""
    parameters = _parameters(content)
    covariance_type: CovarianceType = content.get("mixture_covariance_type")  # type: ignore[assignment]  # checked next
    if covariance_type not in get_args(CovarianceType):
        raise DamagedError(Message("unknown covariance type {value}", value=quoted(covariance_type)))
    grouped = parameters["preset"] != "paper"
    arrays = {
        field.name: read_array(content, field) for field in _fields(content, parameters, covariance_type, grouped)
    }
    n_components = len(arrays["weights"])
    if grouped:
        check_joins(arrays["joins"], n_components)
        for kind in REGION_KINDS:
            check_groups(arrays, kind, n_components)
    check_variances(arrays["covariances"], covariance_type, LEAST_SPREAD**2)
    if abs(arrays["weights"].sum() - 1) > 1e-6:
        raise DamagedError("the weights do not sum to 1")
    check_means(arrays, parameters)
    try:
        check_parameters(parameters)
    except (ValueError, TypeError) as error:
        raise ModelFileError(Message("the model has a bad parameter: {reason}", reason=message_of(error))) from error
    # Files of versions before this digest have none, and hold all the same.
    if "digest" in content and content["digest"] != _digest(parameters, covariance_type, arrays):
        raise DamagedError("its numbers are not those that were saved: were they edited, or taken from another model?")
    try:
        part_notes = PartNotes.of_json(content)
    except ValueError as error:
        raise DamagedError(message_of(error)) from error
    grouping, of_bodies, taught, plan, atlases = None, False, None, None, None
    if grouped:
        grouping = _grouping(arrays)
        taught, plan = TaughtParts.of_arrays(arrays), BodyPlan.of_arrays(arrays)
        of_bodies = "of_bodies" in arrays or "kind_mean" in arrays
        wholes, segments = (RegionAtlas.of_arrays(arrays, kind) for kind in REGION_KINDS)
        atlases = wholes, segments
    return ModelContent(
        parameters,
        PartMixture(
            GaussianMixture(covariance_type, arrays["weights"], arrays["means"], arrays["covariances"]),
            grouping,
            of_bodies,
            taught,
            plan,
        ),
        Standardizer(effective(parameters, "scaling"), arrays["centre"], arrays["spread"]),
        atlases,
        arrays["usual_scores"],
        part_notes,
    )


def _grouping(arrays: dict[str, FloatArray]) -> MergeTree:
    """The merge tree in the arrays of a model file."""
    joins, certainties, by_chance = arrays["joins"].astype(np.int64), arrays["certainties"], arrays["by_chance"]
    if "cuts" not in arrays:
        n_kinds, natural = int(arrays["n_kinds"]), int(arrays["natural"])
        return MergeTree(joins, certainties, by_chance, arrays["likeness"], n_kinds, natural, arrays.get("areas"))
    # One group has no border.
    likeness = np.log(np.maximum(arrays["cuts"], LEAST_CUT) / MOST_CUT)
    tree = MergeTree(joins, certainties, by_chance, likeness, len(certainties), 1)
    curve = tree.curve()[1:MOST_SEGMENTS]
    natural = 2 + int(np.flatnonzero(curve >= curve.max() - BEST_WITHIN)[-1]) if len(curve) else 1
    return replace(tree, natural=natural)


def _fields(
    content: dict[str, Any], parameters: dict[str, Any], covariance_type: CovarianceType, grouped: bool
) -> Iterator[Field]:
    """All arrays of a model file, with the shapes that its counts give."""
    k, d = _n_components(content, parameters["n_segments"]), parameters["n_energies"]
    covariance_shapes = {"shared": (d,), "diag": (k, d), "spherical": (k,), "tied": (d, d), "full": (k, d, d)}
    n_poses = length(content, "usual_scores", MOST_POSES)
    yield from (
        Field("centre", (d,)),
        Field("spread", (d,), least=LEAST_SPREAD),
        Field("weights", (k,), least=POSITIVE),
        Field("means", (k, d)),
        Field("covariances", covariance_shapes[covariance_type], -(MOST_NUMBER**2), MOST_NUMBER**2),
        Field("usual_scores", (n_poses,)),
    )
    if not grouped:
        return
    yield from (
        Field("joins", (k - 1, 2)),
        Field("certainties", (k,), 0.0, WHOLE_SHARE),
        Field("by_chance", (k,), 0.0, WHOLE_SHARE),
    )
    if content["version"] == UNIONS_VERSION:
        yield Field("cuts", (k,), least=0.0)
    else:
        n_kinds = content["n_kinds"] if isinstance(content.get("n_kinds"), int) else 0
        yield from (
            Field("likeness", (k,)),
            Field("n_kinds", (), 1, k, whole=True),
            Field("natural", (), 1, k, whole=True),
        )
        if "areas" in content:
            yield Field("areas", (k,), least=0.0, most=1.0)
        if "of_bodies" in content:
            yield Field("of_bodies", (), 1, 1, whole=True)
        if "kind_mean" in content:  # sizes and neighbors of kinds, which files had before, and which are in the digest
            yield from (
                Field("kind_mean", (n_kinds,)),
                Field("kind_spread", (n_kinds,), least=LEAST_SPREAD),
                Field("kind_touching", (n_kinds, n_kinds), least=POSITIVE, most=BELOW_ONE),
            )
    if content["version"] in (TAUGHT_VERSION, PLAN_VERSION):
        g = length(content, "taught_left", MOST_TAUGHT)
        yield from (Field(f"taught_{side}", (g,), 0, MOST_TAUGHT - 1, whole=True) for side in ("left", "right"))
        yield Field("taught_of_bodies", (), 0, 1, whole=True)
    if content["version"] == PLAN_VERSION:
        yield from (
            Field("plan_means", (g, COORDINATES)),
            Field("plan_covariances", (g, COORDINATES, COORDINATES)),
            Field("plan_shares", (g,), least=POSITIVE, most=WHOLE_SHARE),
            Field("plan_signature_weight", (), 0.0, 1.0),
        )
    for kind in REGION_KINDS:
        r = length(content, f"{kind}_segment", MOST_REGIONS)
        yield from (
            Field(f"{kind}_groups", (), 1, k, whole=True),
            Field(f"{kind}_segment", (r,), 0, k - 1, whole=True),
            Field(f"{kind}_side", (r,), -1, 1, whole=True),
            Field(f"{kind}_area", (r,), POSITIVE, WHOLE_SHARE),
            Field(f"{kind}_signature", (r, FIELDS)),
            Field(f"{kind}_handedness", (r, PLANES)),
            # Files of earlier versions have distances that are a little negative.
            Field(f"{kind}_distance", (r, r), least=-SURROUNDINGS),
            Field(f"{kind}_noise", (4,), least=POSITIVE),
        )


def _content(text: str) -> dict[str, Any]:
    """The JSON object in a text, if it is a model of this version."""
    try:
        content = parsed(text)
    except DamagedError as error:
        raise ModelFileError(
            Message("this is not a model of WKS Segment: it is not JSON ({reason})", reason=message_of(error))
        ) from error
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise ModelFileError("this is not a model of WKS Segment")
    version = content.get("version")
    if version not in (UNIONS_VERSION, MODEL_VERSION, TAUGHT_VERSION, PLAN_VERSION):
        if isinstance(version, int) and version < MODEL_VERSION:
            template = "the model has version {version}, this program reads {known}: learn it again"
        else:
            template = "the model has version {version}, this program reads {known}: update WKS Segment"
        raise ModelFileError(Message(template, version=quoted(version), known=MODEL_VERSION))
    return content


def _parameters(content: dict[str, Any]) -> dict[str, Any]:
    """The parameters, of which only names, types and sizes are checked: they decide what else a file must hold."""
    parameters = content.get("parameters")
    if not isinstance(parameters, dict) or set(parameters) != set(PARAMETERS):
        raise DamagedError(Message("its parameters are not {names}", names=", ".join(PARAMETERS)))
    for name, value in parameters.items():
        most = MOST_OF_PARAMETER.get(name, MOST_SEED)
        if type(value) in (int, float) and value > most:
            raise DamagedError(
                Message("{name} is {value}, more than {most}", name=name, value=quoted(value), most=most)
            )
        if type(value) not in (int, float, str) or quoted(value) != repr(value):
            raise DamagedError(Message("{name} cannot be {value}", name=name, value=quoted(value)))
    return parameters


def _n_components(content: dict[str, Any], n_segments: Any) -> int:
    """Number of components of the mixture, which is the number of weights."""
    count = length(content, "weights", MOST_COMPONENTS)
    if n_segments != "auto" and (not isinstance(n_segments, int) or n_segments > count):
        raise DamagedError(
            Message("{segments} segments of {count} components", segments=quoted(n_segments), count=count)
        )
    return count


def _digest(parameters: dict[str, Any], covariance_type: str, arrays: Mapping[str, FloatArray | IntArray]) -> str:
    """Digest of the arrays, and of the parameters that these depend on."""
    learned = {name: parameters[name] for name in PARAMETERS if name not in ADJUSTABLE}
    return digest_of(json.dumps([learned, covariance_type], default=_as_python), arrays)


def write(path: str | PathLike[str], text: str) -> None:
    """Write text to a file, which appears whole; if this fails, an older file is left as it was.

    Raises
    ------
    ValueError
        If the model is so large that `read` would refuse it.
    OSError
        If the file cannot be written.
    """
    if len(text) > MAX_BYTES:
        raise ValueError(
            Message(
                "the model takes {size:.0f} MB, but at most {most:.0f} MB can be read again: "
                "take fewer segments or energies, or a covariance other than full",
                size=len(text) / 2**20,
                most=MAX_BYTES / 2**20,
            )
        )
    write_whole(path, text)


def read(path: str | PathLike[str]) -> str:
    """Text of a model file; ModelFileError if it is too large or not text."""
    size = Path(path).stat().st_size
    if size > MAX_BYTES:
        raise ModelFileError(Message("{size:.0f} MB is too large for a model", size=size / 2**20))
    try:
        return Path(path).read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise ModelFileError("this is not a model of WKS Segment, but a binary file") from error


def _as_python(value: object) -> object:
    """A NumPy number as a number of Python."""
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"{type(value).__name__} cannot be written to a model")
