"""Characters: the mesh objects that together are one body."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import bpy
import numpy as np

from ...core.message import Message
from ..errors import UserError

CONVERTIBLE = {
    "CURVE": "curve", "SURFACE": "surface", "FONT": "text", "META": "metaball", "CURVES": "hair object",
    "POINTCLOUD": "point cloud", "VOLUME": "volume", "GREASEPENCIL": "Grease Pencil object",
}  # fmt: skip
"""Types of objects that Blender can convert to a mesh, and their names in Blender."""


@dataclass(frozen=True)
class Member:
    """Reference to an object and its mesh by numbers that stay the same as long as Blender runs."""

    name: str
    uid: int
    mesh_uid: int

    def resolve(self) -> bpy.types.Object | None:
        """The object, also if it was renamed; None if it was deleted or no longer has a mesh."""
        obj = bpy.data.objects.get(self.name)
        if obj is None or obj.session_uid != self.uid:
            obj = next((other for other in bpy.data.objects if other.session_uid == self.uid), None)
        return obj if obj is not None and obj.type == "MESH" else None


@dataclass(frozen=True, init=False)
class Character:
    """One or several mesh objects that are one body, ordered by name.

    Keeps no references to Blender's data, so that threads can have it: objects are looked up each time.

    Attributes
    ----------
    name : str
        Name of the object, or of the armature if there are several objects.
    members : tuple of Member
        References to the objects.
    """

    name: str
    members: tuple[Member, ...]

    def __init__(self, objects: Sequence[bpy.types.Object]) -> None:
        armature = armature_of(objects[0])
        members = tuple(Member(obj.name, obj.session_uid, obj.data.session_uid) for obj in objects)
        object.__setattr__(self, "name", objects[0].name if len(objects) == 1 or armature is None else armature.name)
        object.__setattr__(self, "members", members)

    @property
    def objects(self) -> tuple[bpy.types.Object, ...]:
        """The objects; must not be called from a thread.

        Raises
        ------
        UserError
            If one was deleted.
        """
        objects = {member.name: member.resolve() for member in self.members}
        missing = [name for name, obj in objects.items() if obj is None]
        if missing:
            raise UserError("{names} no longer exists", names=quoted(missing))
        return tuple(objects.values())

    @property
    def meshes(self) -> tuple[int, ...]:
        """Numbers of the meshes, the same for characters that share their meshes; may be called from a thread."""
        return tuple(member.mesh_uid for member in self.members)

    def frame_ranges(self) -> list[tuple[float, float]]:
        """First and last frame of each action and unmuted NLA strip that moves the character now."""
        ranges: list[tuple[float, float]] = []
        for block in self.animated():
            data = block.animation_data
            if data is None:
                continue
            if data.action is not None:
                ranges.append(tuple(data.action.frame_range))
            for track in data.nla_tracks if data.use_nla else ():
                if not track.mute:
                    ranges += [(strip.frame_start, strip.frame_end) for strip in track.strips if not strip.mute]
        return ranges

    def animated(self) -> list[bpy.types.ID]:
        """Data-blocks with the character's animation: objects, armatures, shape keys, and parents of these."""
        blocks: dict[bpy.types.ID, None] = {}
        for obj in self.objects:
            blocks |= dict.fromkeys(b for b in (armature_of(obj), obj, obj.data.shape_keys) if b is not None)
            for child in (obj, armature_of(obj)):
                parent = None if child is None else child.parent
                while parent is not None:
                    blocks[parent], parent = None, parent.parent
        return list(blocks)


def polygon_ranges(character: Character) -> list[tuple[bpy.types.Object, slice]]:
    """Each object of a character, and the range of its polygons in the character's numbering."""
    return _ranges(character, "polygons")


def vertex_ranges(character: Character) -> list[tuple[bpy.types.Object, slice]]:
    """Each object of a character, and the range of its vertices in the character's numbering."""
    return _ranges(character, "vertices")


def _ranges(character: Character, of: str) -> list[tuple[bpy.types.Object, slice]]:
    ends = np.cumsum([len(getattr(obj.data, of)) for obj in character.objects]).tolist()
    starts = [0, *ends[:-1]]
    return [(obj, slice(a, b)) for obj, a, b in zip(character.objects, starts, ends, strict=True)]


def armature_of(obj: bpy.types.Object) -> bpy.types.Object | None:
    """The armature that deforms an object or that the object is parented to, if there is one."""
    for modifier in obj.modifiers:
        if modifier.type == "ARMATURE" and modifier.object is not None:
            return modifier.object
    parent = obj.parent
    while parent is not None:
        if parent.type == "ARMATURE":
            return parent
        parent = parent.parent
    return None


def mesh_objects(objects: Iterable[bpy.types.Object]) -> list[bpy.types.Object]:
    """The objects with a mesh, ordered by name, except those that only show the shape of a bone."""
    meshes = sorted((obj for obj in objects if obj.type == "MESH"), key=lambda obj: obj.name)
    rigs = [obj for obj in bpy.data.objects if obj.type == "ARMATURE" and obj.pose is not None] if meshes else []
    shapes = {bone.custom_shape for rig in rigs for bone in rig.pose.bones}
    # Importers add such objects, alone or under an Empty.
    return [obj for obj in meshes if obj not in shapes or obj.modifiers or armature_of(obj) is not None]


def selected_meshes(context: bpy.types.Context) -> list[bpy.types.Object]:
    """The selected mesh objects, ordered by name; for a selected armature without selected meshes, its visible ones.

    A click on a character often selects its armature.
    """
    return mesh_objects(with_rigged(context.selected_objects, context.visible_objects))


def with_rigged(selected: Iterable[bpy.types.Object], visible: Iterable[bpy.types.Object]) -> list[bpy.types.Object]:
    """The selected mesh objects, and the visible ones of each selected armature that has none among the selected."""
    selected = list(selected)
    chosen = [obj for obj in selected if obj.type == "MESH"]
    rigs = {obj for obj in selected if obj.type == "ARMATURE"}
    if rigs:
        rigs -= {armature_of(obj) for obj in chosen}
        chosen += [obj for obj in visible if obj.type == "MESH" and armature_of(obj) in rigs]
    return chosen


def evaluated_objects(layer: bpy.types.ViewLayer) -> set[bpy.types.Object]:
    """The objects that Blender evaluates in a view layer: not disabled in viewports, nor in a collection that is.

    Others would have no modifiers, and one shape in all frames. What is only hidden is evaluated.
    """
    found: set[bpy.types.Object] = set()
    collections = [layer.layer_collection]
    while collections:
        collection = collections.pop()
        if collection.collection.hide_viewport:
            continue
        if not collection.exclude:
            found.update(obj for obj in collection.collection.objects if not obj.hide_viewport)
        collections += collection.children
    return found


def quoted(names: Iterable[str]) -> str:
    """Names in quotes, with commas between them."""
    return ", ".join(f'"{name}"' for name in names)


def why_no_mesh(objects: Iterable[bpy.types.Object]) -> str:
    """Message that says how to get a mesh, if none of the objects has one."""
    for obj in objects:
        if obj.type in CONVERTIBLE:
            template = '"{name}" is a {type}: convert it first (Object > Convert > Mesh)'
            return Message(template, name=obj.name, type=Message(CONVERTIBLE[obj.type]))
        if obj.type == "EMPTY" and obj.instance_type == "COLLECTION":
            return Message(
                '"{name}" is an instance: make it real first (Object > Apply > Make Instances Real)', name=obj.name
            )
    return "Select the mesh of a character first"


def group(objects: Sequence[bpy.types.Object], together: bool = False) -> list[Character]:
    """Group mesh objects into characters: those with the same armature or parented to each other are one.

    So are objects without an armature that are parented to one animated object, such as an Empty that is driven.

    Parameters
    ----------
    objects
        Mesh objects.
    together : bool
        Make one character of all objects.

    Raises
    ------
    UserError
        If there is no object, or one is linked from another file, is an override of one, or is in Edit Mode.
    """
    if not objects:
        raise UserError("No mesh object to work on: select the character's mesh")
    for obj in objects:
        if obj.library is not None or obj.data.library is not None:
            raise UserError(
                '"{name}" is linked from another file: make it local first (Object > Relations)', name=obj.name
            )
        if obj.data.override_library is not None:
            raise UserError(
                'The mesh of "{name}" is a library override, of which Blender would not save the segments: make it '
                "local first (Object > Relations > Make Local)",
                name=obj.name,
            )
        check_not_edited(obj)
    if together:
        return [Character(tuple(objects))]
    by_body: dict[bpy.types.Object, list[bpy.types.Object]] = {}
    for obj in objects:
        by_body.setdefault(_body_of(obj, set(objects)), []).append(obj)
    return [Character(tuple(members)) for members in by_body.values()]


def same_body(obj: bpy.types.Object, objects: Iterable[bpy.types.Object]) -> list[bpy.types.Object]:
    """Those of some mesh objects that are one character with an object."""
    among = {obj, *objects}
    body = _body_of(obj, among)
    return [other for other in mesh_objects(among) if other is obj or _body_of(other, among) == body]


def check_not_edited(obj: bpy.types.Object) -> None:
    """UserError if an object is in Edit Mode, or another one with its mesh: Blender cannot write to the mesh then."""
    if obj.mode == "EDIT":
        raise UserError('"{name}" is in Edit Mode: leave it first (Tab)', name=obj.name)
    if obj.data.is_editmode:
        others = (other.name for other in bpy.data.objects if other.data == obj.data and other.mode == "EDIT")
        raise UserError(
            '"{name}" is in Edit Mode through "{other}", which has the same mesh: leave it first (Tab)',
            name=obj.name,
            other=next(others, obj.data.name),
        )


def _body_of(obj: bpy.types.Object, among: set[bpy.types.Object]) -> bpy.types.Object:
    """The armature of an object, else the topmost of its parents that is among the objects or animated, else itself."""
    armature = armature_of(obj)
    if armature is not None:
        return armature
    body, parent = obj, obj.parent
    while parent is not None:
        body, parent = (parent if parent in among or _is_animated(parent) else body), parent.parent
    return body if body is obj else _body_of(body, among)


def _is_animated(obj: bpy.types.Object) -> bool:
    """Whether an object has an action or a strip of animation of its own."""
    data = obj.animation_data
    return data is not None and (data.action is not None or any(len(track.strips) for track in data.nla_tracks))
