"""Writes labels to a mesh with all outputs, and takes them back: both loop over the list of outputs.

A new output is a new module with a class that has `write` and `take_back`, a line in the list, and an option.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import bpy
import numpy as np

from ...core.mesh.triangle_mesh import FloatArray, IntArray
from ...core.message import Message
from ..parts.part_style import Style
from ..scene.characters import quoted
from ..scene.simulations import check_may_change
from ..scene.vertex_group_access import active_group
from .color_attribute import ColorAttribute
from .face_sets import FaceSets
from .id_map import IdMapImage
from .joined_meshes import adopt
from .ledger import Ledger
from .materials import Materials, template_on
from .options import DEFAULT_OUTPUTS, OutputOptions
from .origin import LABEL_ORIGIN
from .output import LastingOutput, Output, PartsOfMesh
from .overrides import ByHand, ModelLabels, by_hand, merge_parts, model_labels
from .part_attributes import PartAttributes, has_labels, labels_on
from .part_materials import keep_unused
from .seams import Seams
from .ucupaint import UcupaintColors
from .uv_maps import UvMap
from .vertex_groups import VertexGroups, read_groups
from .vertex_weights import hard_weights, move_weights

OUTPUTS: tuple[Output, ...] = (
    PartAttributes(),
    ColorAttribute(),
    UcupaintColors(),
    Materials(),
    VertexGroups(),
    FaceSets(),
    Seams(),
    ModelLabels(),
)
"""What is written with labels, in this order, and taken back in the reverse order: outputs need the labels."""
NOTHING_MERGED: Mapping[int, int] = MappingProxyType({})
LASTING_OUTPUTS: tuple[LastingOutput, ...] = (UvMap(), IdMapImage(), ByHand())


def write_labels(
    mesh: bpy.types.Mesh, labels: IntArray, options: OutputOptions = DEFAULT_OUTPUTS,
    merged_into: Mapping[int, int] = NOTHING_MERGED, weights: Mapping[int, FloatArray] | None = None,
    warnings: list[str] | None = None,
) -> IntArray:  # fmt: skip
    """Write the parts of polygons to a mesh with a person's changes, in place of what was written before.

    Attributes and vertex groups of the user that happen to have our names are left alone: ours get a number.

    Parameters
    ----------
    labels : (p,) int array
        Part of each polygon as the model gives it. Faces that have a part by hand keep that.
    merged_into
        For a part that the user merged, the part it is merged into.
    weights
        (n,) weights of the model's parts, for soft vertex groups; they follow the changes. Without them the groups are
        hard, if the options ask for groups.
    warnings
        Gets what was not taken back of the labels before, and why.

    Returns
    -------
    (p,) int array
        The parts as they were written.
    """
    check_may_change(mesh)
    adopt(mesh)
    given = by_hand(mesh)
    final = merge_parts(np.where(given < 0, labels, given), merged_into)
    if weights is not None:
        weights = move_weights(mesh, weights, labels, final)
    elif options.vertex_groups != "none":
        weights = hard_weights(mesh, final)
    shown = None if weights is None else active_group(mesh)
    ledger = Ledger(mesh)
    for output in reversed(OUTPUTS):
        output.take_back(mesh, ledger)
    ledger.begin([LABEL_ORIGIN, *(key for lasting in LASTING_OUTPUTS for key in lasting.keys)])
    parts = PartsOfMesh(final, labels, weights, shown, options)
    for output in OUTPUTS:
        output.write(mesh, parts, ledger)
    keep_unused()
    mesh.update()
    if warnings is not None:
        warnings += ledger.warnings
    return final


def rewrite_labels(
    mesh: bpy.types.Mesh, style: Style, merged_into: Mapping[int, int], warnings: list[str],
    chosen: OutputOptions | None = None,
) -> None:  # fmt: skip
    """Write the labels of a mesh again after a person's changes, with all outputs that it has, or with chosen ones."""
    check_may_change(mesh)
    adopt(mesh)
    labels, before = model_labels(mesh), labels_on(mesh)
    if labels is None or before is None:
        return
    ledger = Ledger(mesh)
    weights, vertex_groups = None, "none"
    if "vertex_groups" in ledger:
        weights, hard = read_groups(mesh), hard_weights(mesh, before)
        if weights.keys() == hard.keys() and all(np.array_equal(weights[part], hard[part]) for part in hard):
            weights, vertex_groups = None, "hard"
        else:
            # The groups are of the parts as they were; `write_labels` takes weights of the model's parts.
            weights, vertex_groups = move_weights(mesh, weights, before, labels), "soft"
    options = OutputOptions(
        colors="colors" in ledger,
        ucupaint="color_ids" in ledger,
        materials="first_slot" in ledger or "own_materials" in ledger,
        template=template_on(mesh),
        vertex_groups=vertex_groups,
        face_sets="face_sets" in ledger or "own_face_sets" in ledger,
        seams="seams" in ledger,
        style=style,
    )
    if chosen is not None:
        weights = weights if chosen.vertex_groups == "soft" else None
        options = chosen
    write_labels(mesh, labels, options, merged_into, weights, warnings)


def clear_labels(mesh: bpy.types.Mesh, warnings: list[str] | None = None) -> bool:
    """Remove exactly what is ours on a mesh and restore what was there; False if there was nothing.

    Parameters
    ----------
    warnings
        Gets what was not taken back, and why.
    """
    if not has_labels(mesh):
        return False
    check_may_change(mesh)
    adopt(mesh)
    ledger = Ledger(mesh)
    for output in reversed((*OUTPUTS, *LASTING_OUTPUTS)):
        output.take_back(mesh, ledger)
    ledger.delete()
    mesh.update()
    changed = keep_unused()
    if warnings is not None:
        warnings += ledger.warnings
        if changed:
            warnings.append(
                Message("You have changed these materials, they stay in the file: {names}", names=quoted(changed))
            )
    return True
