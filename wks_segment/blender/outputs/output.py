"""The two verbs that every output has: write to a mesh, take back from it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import bpy

from ...core.mesh.triangle_mesh import FloatArray, IntArray
from .ledger import Ledger
from .options import OutputOptions


@dataclass(frozen=True)
class PartsOfMesh:
    """The parts of a mesh, as outputs write them.

    Attributes
    ----------
    of_polygons : (p,) int array
        Part of each polygon, with the user's changes.
    by_model : (p,) int array
        Part of each polygon as the model gives it.
    weights : dict, optional
        (n,) weights of the vertices in each part, for vertex groups; none are written if not given.
    active_group : str, optional
        Name of the vertex group that was active before anything was taken back.
    options : OutputOptions
    """

    of_polygons: IntArray
    by_model: IntArray
    weights: Mapping[int, FloatArray] | None
    active_group: str | None
    options: OutputOptions


class TakenBack(Protocol):
    """Something of ours on a mesh that Clear removes."""

    def take_back(self, mesh: bpy.types.Mesh, ledger: Ledger) -> None:
        """Remove exactly what was written, and restore what was there before; nothing if nothing was written."""


class Output(TakenBack, Protocol):
    """One kind of thing that is written with new labels, in place of what was written with the labels before."""

    def write(self, mesh: bpy.types.Mesh, parts: PartsOfMesh, ledger: Ledger) -> None:
        """Write to a mesh, if the options ask for it, and enter into the ledger what `take_back` needs."""


class LastingOutput(TakenBack, Protocol):
    """Something that an operator of its own writes: new labels leave it as it is, Clear takes it back."""

    @property
    def keys(self) -> tuple[str, ...]:
        """Its entries in the ledger."""
