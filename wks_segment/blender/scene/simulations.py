"""Simulations that were played and not baked: a change of a mesh throws their frames away.

Cloth, soft bodies, particles, dynamic paint and rigid bodies keep played frames in a point cache, which Blender marks
as outdated as soon as a mesh that takes part is changed, even by an attribute; simulation zones of Geometry Nodes start
again as well. So nothing of such an object is changed while poses are read, and jobs that write to it are refused.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import bpy

from ..errors import UserError
from .characters import Character, armature_of

SIMULATION_OUTPUT = "GeometryNodeSimulationOutput"
"""Node at the end of a simulation zone."""


@dataclass(frozen=True)
class Simulation:
    """A simulation of an object that is not baked.

    Attributes
    ----------
    name : str
        Name of its modifier, or of what else it belongs to.
    frames : int
        Number of frames that were played and are not outdated; those of a zone are unknown, and count as one.
    deforms : bool
        Whether it moves the object or its vertices.
    is_zone : bool
        Whether it is a simulation zone of Geometry Nodes.
    """

    name: str
    frames: int
    deforms: bool
    is_zone: bool = False


def check_simulations(scene: bpy.types.Scene, characters: Iterable[Character], over_time: bool) -> None:
    """Refuse characters with simulations that reading or labeling would throw away, or that were not played.

    Parameters
    ----------
    scene
    characters
    over_time : bool
        Whether poses are read at frames: without its frames, a simulation has one pose in all of them.

    Raises
    ------
    UserError
        If a simulation must be baked first.
    """
    for character in characters:
        own = character.objects
        for obj in (*own, *_involved(scene, character)):
            for simulation in unbaked(scene, obj):
                unplayed = over_time and simulation.deforms and obj in own
                if simulation.is_zone:
                    raise UserError(
                        'The simulation "{simulation}" of "{name}" is not baked to disk, and its frames would be lost: '
                        "save the file and bake it (Physics > Simulation Nodes > Bake to Disk), or turn it off",
                        simulation=simulation.name, name=obj.name,
                    )  # fmt: skip
                if simulation.frames or unplayed:
                    raise UserError(
                        'The simulation "{simulation}" of "{name}" is not baked: its frames would be lost, or are not '
                        "computed yet. Bake it first (Physics > Cache > Bake)",
                        simulation=simulation.name, name=obj.name,
                    )  # fmt: skip


def must_not_change(scene: bpy.types.Scene, character: Character) -> bool:
    """Whether a change of a character or its armature, even for a moment, would throw frames of a simulation away."""
    return any(
        simulation.frames
        for obj in (*character.objects, *_involved(scene, character))
        for simulation in unbaked(scene, obj)
    )


def check_may_change(mesh: bpy.types.Mesh) -> None:
    """Refuse to change a mesh if that would throw frames of a simulation away; called before anything is written.

    Raises
    ------
    UserError
        If a simulation must be baked first.
    """
    check_simulations(bpy.context.scene, _characters_of(mesh), over_time=False)


def may_change(mesh: bpy.types.Mesh) -> bool:
    """Whether a change of a mesh throws no frames of a simulation away."""
    return not any(must_not_change(bpy.context.scene, character) for character in _characters_of(mesh))


def _characters_of(mesh: bpy.types.Mesh) -> list[Character]:
    return [Character((obj,)) for obj in bpy.context.scene.objects if obj.data == mesh]


def unbaked(scene: bpy.types.Scene, obj: bpy.types.Object) -> Iterator[Simulation]:
    """The simulations of an object that are not baked."""
    for name, cache, deforms in _point_caches(scene, obj):
        if not (cache.is_baked or cache.use_external):
            number = None if cache.is_outdated else re.search(r"\d+", cache.info)
            frames = int(number[0]) if number else 0
            yield Simulation(name, frames if frames > 1 else 0, deforms)  # one is the start, which is there at once
    for modifier in obj.modifiers:
        if is_simulation_zone(modifier) and modifier.show_viewport and not _is_baked_to_disk(modifier):
            yield Simulation(modifier.name, 1, True, is_zone=True)


def is_simulation_zone(modifier: bpy.types.Modifier) -> bool:
    """Whether a modifier is a tree of nodes with a simulation zone, also inside of groups."""
    if modifier.type != "NODES" or modifier.node_group is None:
        return False
    trees, seen = [modifier.node_group], set()
    while trees:
        tree = trees.pop()
        if tree in seen:
            continue
        seen.add(tree)
        for node in tree.nodes:
            if node.bl_idname == SIMULATION_OUTPUT and not node.mute:
                return True
            if node.type == "GROUP" and node.node_tree is not None:
                trees.append(node.node_tree)
    return False


def _point_caches(
    scene: bpy.types.Scene, obj: bpy.types.Object
) -> Iterator[tuple[str, bpy.types.PointCache, bool]]:  # fmt: skip
    """Name, cache and whether it deforms, of each simulation of an object that has a point cache."""
    for modifier in obj.modifiers:
        if modifier.type in ("CLOTH", "SOFT_BODY"):
            yield modifier.name, modifier.point_cache, modifier.show_viewport
        elif modifier.type == "DYNAMIC_PAINT" and modifier.canvas_settings is not None:
            for surface in modifier.canvas_settings.canvas_surfaces:
                yield surface.name, surface.point_cache, modifier.show_viewport
    for particles in obj.particle_systems:
        yield particles.name, particles.point_cache, False
    world = scene.rigidbody_world
    if obj.rigid_body is not None and world is not None and world.enabled:
        yield "Rigid Body World", world.point_cache, obj.rigid_body.type == "ACTIVE"


def _is_baked_to_disk(modifier: bpy.types.NodesModifier) -> bool:
    """Whether there are baked files of each zone of a modifier. Blender does not tell of those packed in the file."""
    folders = [
        bake.directory if bake.use_custom_path else str(Path(modifier.bake_directory) / str(bake.bake_id))
        for bake in modifier.bakes
        if bake.node is not None and bake.node.bl_idname == SIMULATION_OUTPUT
    ]
    named = [Path(bpy.path.abspath(folder)) for folder in folders]
    return bool(named) and all(folder.is_absolute() and any(folder.glob("meta/*")) for folder in named)


def _involved(scene: bpy.types.Scene, character: Character) -> list[bpy.types.Object]:
    """Other objects with a modifier or particles that may depend on a character: what hangs on its armature or on its
    objects, and everything if something of it collides or is a force."""
    own = character.objects
    armatures = {armature_of(obj) for obj in own} - {None}
    acts = any(
        modifier.type in ("COLLISION", "DYNAMIC_PAINT") for obj in own for modifier in obj.modifiers
    ) or any(obj.field is not None and obj.field.type != "NONE" for obj in own)  # fmt: skip
    others = [obj for obj in scene.objects if obj not in own and (len(obj.modifiers) or len(obj.particle_systems))]
    return [obj for obj in others if acts or obj.parent in own or armature_of(obj) in armatures]
