"""Where the labels of a mesh are from: kept on the mesh, so that nothing depends on what is in use elsewhere."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import bpy

from ..parts.part_ids import model_of
from .ledger import Ledger

LABEL_ORIGIN = "origin"
"""Entry of the ledger."""


@dataclass(frozen=True)
class Origin:
    """Where the labels of a mesh are from.

    Attributes
    ----------
    labels : str
        Key of the label set that the numbers of parts belong to; empty for labels without a model.
    settings
        The settings that the labels follow, as they were.
    job : str
        Name of the job that gave the labels, by which the live session finds what it keeps.
    transferred : bool
        Whether the labels are another mesh's, by the nearest surface.
    """

    labels: str = ""
    settings: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))
    job: str = ""
    transferred: bool = False

    @property
    def model(self) -> str:
        """Identity of the model."""
        return model_of(self.labels)


def origin_of(mesh: bpy.types.Mesh) -> Origin:
    """Where the labels of a mesh are from; unknown for a mesh without labels, and in files of version 0.1.0."""
    entry = Ledger(mesh).get(LABEL_ORIGIN, {})
    return Origin(
        entry.get("labels", ""), json.loads(entry.get("settings", "{}")), entry.get("job", ""),
        bool(entry.get("transferred", False)),
    )  # fmt: skip


def enter_origin(mesh: bpy.types.Mesh, origin: Origin) -> None:
    """Keep where the labels of a mesh are from."""
    Ledger(mesh)[LABEL_ORIGIN] = {
        "labels": origin.labels,
        "settings": json.dumps(dict(origin.settings), sort_keys=True),
        "job": origin.job,
        "transferred": int(origin.transferred),
    }
