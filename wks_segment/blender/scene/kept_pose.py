"""The pose and the animation of an armature or of shape keys, kept while others are tried."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, TypeAlias

import bpy
from mathutils import Matrix

Posable: TypeAlias = bpy.types.Object | bpy.types.Key
"""An armature or another object that is animated, or the shape keys of a mesh."""


TRANSFORM = ("rotation_mode", "location", "rotation_euler", "rotation_quaternion", "rotation_axis_angle", "scale")
"""Properties of an armature's object that actions move as well."""


class KeptPose:
    """What an armature or shape keys have at the moment: their action, and all values that have no keyframes."""

    def __init__(self, owner: Posable) -> None:
        self._owner, data = owner, owner.animation_data
        self._animation = (
            {name: getattr(data, name, None) for name in ("action", "action_slot", "use_nla")} if data else {}
        )
        moved = [owner, *parts_of(owner)] if isinstance(owner, bpy.types.Object) else parts_of(owner)
        self._parts = [(part, _state(part), _properties(part)) for part in moved]

    def restore(self, context: bpy.types.Context) -> None:
        """Give back the action and the pose."""
        data = self._owner.animation_data
        if data is not None and not self._animation:
            self._owner.animation_data_clear()
        elif data is not None:
            data.action = self._animation["action"]
            for name in ("action_slot", "use_nla"):
                if self._animation[name] is not None:
                    setattr(data, name, self._animation[name])
        # Evaluate keyframes now, so that they do not overwrite what is restored next.
        context.view_layer.update()
        for part, state, properties in self._parts:
            for name, value in state.items():
                setattr(part, name, value)
            for name, value in properties.items():
                part[name] = value
        context.view_layer.update()


@contextmanager
def kept_pose(context: bpy.types.Context, owner: Posable) -> Iterator[KeptPose]:
    """Restore the pose and the animation of an armature or of shape keys after the block."""
    kept = KeptPose(owner)
    try:
        yield kept
    finally:
        kept.restore(context)


def parts_of(owner: Posable) -> Any:
    """The bones of an armature, or the shape keys; none of another object."""
    if isinstance(owner, bpy.types.Object):
        return () if owner.pose is None else owner.pose.bones
    return owner.key_blocks


def to_rest(owner: Posable) -> None:
    """Put all bones at rest, or all shape keys at zero: an action leaves those as they are that it does not move."""
    for part in parts_of(owner):
        if isinstance(part, bpy.types.PoseBone):
            part.matrix_basis = Matrix()
        else:
            part.value = 0.0


def _properties(part: bpy.types.bpy_struct) -> dict[str, Any]:
    """Custom properties of a bone."""
    return dict(part.items()) if isinstance(part, bpy.types.PoseBone) else {}


def _state(part: bpy.types.bpy_struct) -> dict[str, Any]:
    """All properties of a bone or a shape key that can be animated, or the transform of an object.

    The rotation mode is the first one to be restored, since Blender converts the other properties when it is set.
    """
    if isinstance(part, bpy.types.Object):
        return {name: _plain(getattr(part, name)) for name in TRANSFORM}
    state: dict[str, Any] = {"rotation_mode": part.rotation_mode} if isinstance(part, bpy.types.PoseBone) else {}
    for prop in part.bl_rna.properties:
        if prop.is_animatable and not prop.is_readonly and prop.type in ("FLOAT", "INT", "BOOLEAN"):
            state[prop.identifier] = _plain(getattr(part, prop.identifier))
    return {name: value for name, value in state.items() if not name.startswith("matrix")}


def _plain(value: Any) -> Any:
    """A copy of a value that does not follow the property."""
    return value if isinstance(value, int | float | str) else tuple(value)
