"""Reads what bones do to a character: its tree of bones, and their weights on its vertices."""

from __future__ import annotations

from typing import TYPE_CHECKING

import bpy
import numpy as np

from ...core.message import message_of
from ...rigs import BoneTree, Skeleton, Skin
from ..errors import UserError
from .attributes import read_floats
from .characters import Character, armature_of, vertex_ranges
from .mesh_arrays import Body

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix


def bone_tree_of(character: Character) -> BoneTree:
    """The bones that move a character, and the bone of each of its polygons.

    Raises
    ------
    UserError
        If it has no armature, or no weights that would divide it.
    """
    rigs = [rig for rig in dict.fromkeys(map(armature_of, character.objects)) if rig is not None]
    if not rigs:
        raise UserError(
            '"{name}" has no armature: select a rigged mesh, or take the parts from something else', name=character.name
        )
    parent_of = {bone.name: bone.parent.name if bone.parent else None for rig in rigs for bone in rig.data.bones}
    skeleton = Skeleton.of(parent_of)
    body = Body.of(character)
    areas = [
        abs(np.linalg.det(np.array(obj.matrix_world)[:3, :3])) ** (2 / 3) * read_floats(obj.data.polygons, "area")
        for obj in character.objects
    ]
    try:
        skin = Skin(body.vertices, body.corners, np.concatenate(areas), _weights(character, skeleton))
        return BoneTree.of(skeleton, skin)
    except ValueError as error:
        raise UserError('"{name}": {reason}', name=character.name, reason=message_of(error)) from error


def _weights(character: Character, skeleton: Skeleton) -> csr_matrix:
    """(n, bones) weights of the bones that deform a character; an object that is parented to a bone has all of its."""
    index = {bone: i for i, bone in enumerate(skeleton.bones)}
    vertices: list[int] = []
    bones: list[int] = []
    weights: list[float] = []
    n_vertices = 0
    for obj, inside in vertex_ranges(character):
        n_vertices = inside.stop
        modified = next((m.object for m in obj.modifiers if m.type == "ARMATURE" and m.object is not None), None)
        carrier = _carrying_bone(obj)
        if modified is not None:
            deforming = {bone.name for bone in modified.data.bones if bone.use_deform}
            of_group = {group.index: index[group.name] for group in obj.vertex_groups if group.name in deforming}
            for i, vertex in enumerate(obj.data.vertices, inside.start):
                for member in vertex.groups:
                    if member.group in of_group and member.weight > 0:
                        vertices.append(i)
                        bones.append(of_group[member.group])
                        weights.append(member.weight)
        elif carrier in index:
            vertices += range(inside.start, inside.stop)
            bones += [index[carrier]] * (inside.stop - inside.start)
            weights += [1.0] * (inside.stop - inside.start)
    from scipy.sparse import csr_matrix  # enabling the extension imports no SciPy

    return csr_matrix((weights, (vertices, bones)), shape=(n_vertices, len(skeleton.bones)))


def _carrying_bone(obj: bpy.types.Object) -> str:
    """Name of the bone that an object, or one that it is parented to, hangs on; empty if there is none."""
    node = obj
    while node is not None:
        if node.parent_type == "BONE" and node.parent_bone:
            return str(node.parent_bone)
        node = node.parent
    return ""
