"""Reads a rigged character with Blender: `python -m benchmarks.rig_reader FILE TARGET.npz`, see `benchmarks.rigs`.

A process of its own: some versions of bpy crash or hang at exit.
"""

from __future__ import annotations

import os
import random
import sys
import traceback
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from benchmarks.rig_bones import Bones, truth
from wks_segment.blender.errors import UserError
from wks_segment.blender.scene.bone_weights import bone_tree_of
from wks_segment.blender.scene.characters import Character, armature_of, group, mesh_objects, polygon_ranges
from wks_segment.blender.scene.file_formats import open_files
from wks_segment.blender.scene.poses import Pose, in_one_triangulation, read_pose
from wks_segment.core.mesh.triangle_mesh import IntArray
from wks_segment.rigs import parts_of_faces, usual_rows

LEARNED, UNSEEN = 5, 3
LARGEST_TURN = 0.35
"""Largest random rotation about each axis of a bone, in radians, where there is no animation; as in
`benchmarks.characters`."""
STILL = 1e-4
"""An action moves nothing if no vertex moves by more than this fraction of the size between its frames."""
Clip = dict[bpy.types.ID, tuple[bpy.types.Action, Any]]
"""Action, and its slot from Blender 4.4 on, of each data-block that a clip moves."""


def main() -> None:
    """Read a file and write the arrays of its character."""
    source, target = map(Path, sys.argv[1:])
    np.savez_compressed(target, **read(source))


def read(path: Path) -> dict[str, Any]:
    """All meshes of a file as one mesh in some frames, with the bone of each face; see `benchmarks.rigs.Rig`."""
    objects = open_files([path])[0]
    meshes = [
        obj for obj in mesh_objects(objects) if obj.name in bpy.context.view_layer.objects and not obj.hide_viewport
    ]
    scene = _Scene(group(meshes, together=True)[0])
    rest = scene.rest()
    found = {name: list(scene.played(clip)) for name, clip in scene.clips().items()}
    moving = {name: poses for name, poses in found.items() if _moves(poses)}
    if moving:
        action, poses = max(moving.items(), key=lambda item: _motion(item[1]))
    elif scene.rigs:
        action, poses = "random rotations", list(scene.turned_at_random())
    else:
        action, poses = "none", [rest] * (LEARNED + UNSEEN)
    rest, *poses = in_one_triangulation([rest, *poses])
    if not all(pose.is_mesh_of(rest) for pose in poses):
        raise ValueError("its faces differ between frames")
    known = rest.polygon_of >= 0
    bones, of_polygons = bones_of_polygons(scene.character)
    bone, names = truth(bones, of_polygons[rest.polygon_of[known]], rest.mesh.face_areas[known])
    part, part_names = named_parts(scene.character)
    return {
        "part": part[rest.polygon_of[known]], "part_names": np.array(part_names),
        "vertices": np.stack([pose.mesh.vertices for pose in poses]), "rest": rest.mesh.vertices,
        "faces": rest.mesh.faces[known], "polygon": rest.polygon_of[known], "bone": bone,
        "bone_names": np.array(names), "action": np.array(action),
    }  # fmt: skip


@dataclass(frozen=True)
class _Scene:
    """A character, and what moves it."""

    character: Character

    @property
    def rigs(self) -> list[bpy.types.Object]:
        """Armatures of the character."""
        return [obj for obj in dict.fromkeys(map(armature_of, self.character.objects)) if obj is not None]

    def clips(self) -> dict[str, Clip]:
        """The animations in the file by name: of tracks, of active actions, and actions that nothing uses."""
        clips: dict[str, Clip] = {}
        for block in _animated_blocks():
            data = block.animation_data
            for track in data.nla_tracks:
                for strip in track.strips:
                    if strip.action is not None:
                        clip = clips.setdefault(track.name, {})
                        clip.setdefault(block, (strip.action, getattr(strip, "action_slot", None)))
            in_tracks = {clip[block][0] for clip in clips.values() if block in clip}
            if data.action is not None and data.action not in in_tracks:
                clips.setdefault(data.action.name, {})[block] = data.action, getattr(data, "action_slot", None)
        used = {action for clip in clips.values() for action, _ in clip.values()}
        for action in bpy.data.actions:
            if action not in used and self.rigs:
                clips[action.name] = dict.fromkeys(self.rigs, (action, None))
        return clips

    def rest(self) -> Pose:
        """The character with its armatures at rest and nothing animated."""
        self._still()
        for rig in self.rigs:
            rig.data.pose_position = "REST"
        pose = self._seen("rest")
        for rig in self.rigs:
            rig.data.pose_position = "POSE"
        return pose

    def played(self, clip: Clip) -> Iterator[Pose]:
        """Poses in the middles of equal spans of a clip, since a cycle ends as it begins."""
        self._still()
        for block, (action, slot) in clip.items():
            data = block.animation_data_create()
            data.action = action
            if slot is not None:
                data.action_slot = slot
            elif getattr(data, "action_slot", action) is None and data.action_suitable_slots:
                data.action_slot = data.action_suitable_slots[0]
        first = min(action.frame_range[0] for action, _ in clip.values())
        last = max(action.frame_range[1] for action, _ in clip.values())
        for frame in first + (np.arange(LEARNED + UNSEEN) + 0.5) * (last - first) / (LEARNED + UNSEEN):
            bpy.context.scene.frame_set(int(frame // 1), subframe=float(frame % 1))
            yield self._seen(f"frame {frame:.2f}")

    def turned_at_random(self) -> Iterator[Pose]:
        """Poses with all bones but the roots rotated at random."""
        self._still()
        turn = random.Random(0)
        for i in range(LEARNED + UNSEEN):
            for bone in (bone for rig in self.rigs for bone in rig.pose.bones):
                bone.rotation_mode = "XYZ"
                most = LARGEST_TURN if bone.parent else 0.0
                bone.rotation_euler = [turn.uniform(-most, most) for _ in range(3)]
            bpy.context.view_layer.update()
            yield self._seen(f"random {i}")

    def _still(self) -> None:
        """Turn all animation off, and reset what it has moved."""
        for block in _animated_blocks():
            block.animation_data.action = None
            for track in block.animation_data.nla_tracks:
                track.mute = True
            if isinstance(block, bpy.types.Key):
                for key in block.key_blocks:
                    key.value = 0.0
        for rig in self.rigs:
            for bone in rig.pose.bones:
                bone.matrix_basis.identity()
        bpy.context.view_layer.update()

    def _seen(self, name: str) -> Pose:
        return read_pose(bpy.context, self.character, name)


def bones_of_polygons(character: Character) -> tuple[Bones, IntArray]:
    """All bones of a character, and the bone of each of its polygons: the one with most weight on its vertices.

    An object that is parented to a bone, itself or through its parents, has that bone; one without any bone is itself
    one. Polygons without weight are of a bone named as their object, whose parent is the armature's first bone.
    """
    parent_of: dict[str, str | None] = {}
    for rig in dict.fromkeys(armature_of(obj) for obj in character.objects):
        for bone in () if rig is None else rig.data.bones:
            parent_of[bone.name] = bone.parent.name if bone.parent else None
    chosen: list[list[str]] = []
    for obj, _ in polygon_ranges(character):
        own = _name_of_object(obj, parent_of)
        rig = next((m.object for m in obj.modifiers if m.type == "ARMATURE" and m.object is not None), None)
        chosen.append([own] * len(obj.data.polygons) if rig is None else _heaviest(obj, rig, own))
    bones = Bones.of(parent_of)
    index = {name: i for i, name in enumerate(bones.names)}
    return bones, np.array([index[name] for names in chosen for name in names], dtype=np.int64)


def named_parts(character: Character) -> tuple[IntArray, list[str]]:
    """The usual named part of each polygon of a character, −1 for none, and the names; no part without usable bones."""
    try:
        tree = bone_tree_of(character)
    except UserError:
        return np.full(polygon_ranges(character)[-1][1].stop, -1), []
    own, names = usual_rows(tree.rows)
    found = parts_of_faces([tree], [own], names=[names])
    return found.labels[0], [part.full_name for part in found.parts]


def _name_of_object(obj: bpy.types.Object, parent_of: dict[str, str | None]) -> str:
    """The bone that an object is parented to; else a new bone named as the object, below those of its parents."""
    if obj.parent is not None and obj.parent_type == "BONE" and obj.parent_bone in parent_of:
        return obj.parent_bone
    if obj.type == "EMPTY" and obj.parent is not None:
        return _name_of_object(obj.parent, parent_of)
    if obj.type == "ARMATURE":
        return obj.data.bones[0].name
    name = obj.name if obj.name not in parent_of else f"object {obj.name}"
    above = None if obj.parent is None else _name_of_object(obj.parent, parent_of)
    hangs_on_bone = above is not None and any(p.parent_type == "BONE" for p in _upward(obj))
    if hangs_on_bone:
        return str(above)
    parent_of.setdefault(name, above)
    return name


def _upward(obj: bpy.types.Object) -> Iterator[bpy.types.Object]:
    """An object and its parents."""
    node = obj
    while node is not None:
        yield node
        node = node.parent


def _heaviest(obj: bpy.types.Object, rig: bpy.types.Object, otherwise: str) -> list[str]:
    """For each polygon of an object the bone with most weight on it."""
    deforming = [g.name if g.name in rig.data.bones and rig.data.bones[g.name].use_deform else "" for g in
                 obj.vertex_groups]  # fmt: skip
    weights = np.zeros((len(obj.data.vertices), len(deforming) + 1))
    weights[:, -1] = 1e-9  # only where nothing else is
    for i, vertex in enumerate(obj.data.vertices):
        for entry in vertex.groups:
            if entry.group < len(deforming) and deforming[entry.group]:
                weights[i, entry.group] = entry.weight
    names = [*deforming, otherwise]
    return [names[weights[list(polygon.vertices)].sum(axis=0).argmax()] for polygon in obj.data.polygons]


def _animated_blocks() -> list[bpy.types.ID]:
    """Objects and shape keys that have animation data."""
    return [block for block in (*bpy.data.objects, *bpy.data.shape_keys) if block.animation_data is not None]


def _moves(poses: list[Pose]) -> bool:
    """Whether a vertex moves between poses."""
    points = np.stack([pose.mesh.vertices for pose in poses])
    return bool(np.ptp(points, axis=0).max() > STILL * np.ptp(points[0], axis=0).max())


def _motion(poses: list[Pose]) -> float:
    """Mean distance of vertices from their mean places in the poses.

    Not from where they are at rest: by that, a knight who breathes while he lies moves more than one who fights.
    """
    points = np.stack([pose.mesh.vertices for pose in poses])
    return float(np.linalg.norm(points - points.mean(axis=0), axis=2).mean())


if __name__ == "__main__":
    code = 1
    try:
        main()
        code = 0
    except Exception:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
