"""Which objects make up one character."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import bpy

from .errors import UserError


@dataclass(frozen=True)
class Character:
    """One or several mesh objects that are one body, in the order of their names."""

    objects: tuple[bpy.types.Object, ...]

    @property
    def name(self) -> str:
        """Name of the object, or of the armature that holds several together."""
        armature = armature_of(self.objects[0])
        return self.objects[0].name if len(self.objects) == 1 or armature is None else armature.name

    @property
    def actions(self) -> list[bpy.types.Action]:
        """Actions that move the character now: its objects', their shape keys' and their armatures'."""
        moved: list[bpy.types.ID] = []
        for obj in self.objects:
            moved += [obj, armature_of(obj), getattr(obj.data.shape_keys, "id_data", None)]
        data = [block.animation_data for block in moved if block is not None and block.animation_data is not None]
        return list(dict.fromkeys(d.action for d in data if d.action is not None))


def armature_of(obj: bpy.types.Object) -> bpy.types.Object | None:
    """The armature that deforms an object or that it hangs from, if any."""
    for modifier in obj.modifiers:
        if modifier.type == "ARMATURE" and modifier.object is not None:
            return modifier.object
    parent = obj.parent
    while parent is not None:
        if parent.type == "ARMATURE":
            return parent
        parent = parent.parent
    return None


def bone_shapes() -> set[bpy.types.Object]:
    """Objects that only draw the bones of a rig, as importers add them."""
    return {
        bone.custom_shape
        for obj in bpy.data.objects
        if obj.type == "ARMATURE" and obj.pose is not None
        for bone in obj.pose.bones
        if bone.custom_shape is not None
    }


def mesh_objects(objects: Iterable[bpy.types.Object]) -> list[bpy.types.Object]:
    """Those of the objects that hold a mesh and are not there only to draw a bone, by name."""
    shapes = bone_shapes()
    return sorted((o for o in objects if o.type == "MESH" and o not in shapes), key=lambda o: o.name)


def group(objects: Sequence[bpy.types.Object], together: bool = False) -> list[Character]:
    """Characters that mesh objects make up: those on one armature are one, any other is one by itself.

    Parameters
    ----------
    objects
        Mesh objects.
    together
        Take all of them as one character.

    Raises
    ------
    UserError
        If there is no object, or one belongs to a linked library and cannot be written to.
    """
    if not objects:
        raise UserError("No mesh object to work on: select the character's mesh")
    for obj in objects:
        if obj.library is not None or obj.data.library is not None:
            raise UserError(f'"{obj.name}" is linked from another file: make it local first (Object > Relations)')
        if obj.mode == "EDIT":
            raise UserError(f'"{obj.name}" is in Edit Mode: leave it first (Tab)')
    if together:
        return [Character(tuple(objects))]
    by_armature: dict[bpy.types.Object, list[bpy.types.Object]] = {}
    for obj in objects:
        by_armature.setdefault(armature_of(obj) or obj, []).append(obj)
    return [Character(tuple(members)) for members in by_armature.values()]
