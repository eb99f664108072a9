"""The pose and the animation of an armature, kept while others are tried."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import bpy
from mathutils import Matrix


class KeptPose:
    """What an armature has at the moment: its action, and the pose of its bones with all that has no keyframes."""

    def __init__(self, armature: bpy.types.Object) -> None:
        self._armature, data = armature, armature.animation_data
        self._animation = (
            {name: getattr(data, name, None) for name in ("action", "action_slot", "use_nla")} if data else {}
        )
        self._bones = [(bone, _state(bone), dict(bone.items())) for bone in armature.pose.bones]

    def restore(self, context: bpy.types.Context) -> None:
        """Give the armature its action and its pose back."""
        data = self._armature.animation_data
        if data is not None and not self._animation:
            self._armature.animation_data_clear()
        elif data is not None:
            data.action = self._animation["action"]
            for name in ("action_slot", "use_nla"):
                if self._animation[name] is not None:
                    setattr(data, name, self._animation[name])
        # Evaluate keyframes now, so that they do not overwrite what is restored next.
        context.view_layer.update()
        for bone, state, properties in self._bones:
            for name, value in state.items():
                setattr(bone, name, value)
            for name, value in properties.items():
                bone[name] = value
        context.view_layer.update()


@contextmanager
def kept_pose(context: bpy.types.Context, armature: bpy.types.Object) -> Iterator[KeptPose]:
    """Restore the pose and the animation of an armature after the block."""
    kept = KeptPose(armature)
    try:
        yield kept
    finally:
        kept.restore(context)


def to_rest(armature: bpy.types.Object) -> None:
    """Put all bones of an armature at rest: an action leaves those as they are that it does not move."""
    for bone in armature.pose.bones:
        bone.matrix_basis = Matrix()


def _state(bone: bpy.types.PoseBone) -> dict[str, Any]:
    """All properties of a bone that can be animated.

    The rotation mode is the first one to be restored, since Blender converts the other properties when it is set.
    """
    state: dict[str, Any] = {"rotation_mode": bone.rotation_mode}
    for prop in bone.bl_rna.properties:
        if prop.is_animatable and not prop.is_readonly and prop.type in ("FLOAT", "INT", "BOOLEAN"):
            value = getattr(bone, prop.identifier)
            state[prop.identifier] = tuple(value) if prop.is_array else value
    return {name: value for name, value in state.items() if not name.startswith("matrix")}
