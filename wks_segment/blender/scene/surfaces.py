"""The surface of an object as it is seen, and the artist's own polygon that each triangle of it comes from."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import bpy
import numpy as np

from ...core.mesh.triangle_mesh import FloatArray, IntArray
from ..errors import OtherFacesError, UserError
from .attributes import new_attribute, read_floats, read_ints
from .characters import Character
from .simulations import is_simulation_zone, must_not_change
from .topology import polygon_sizes

ORIGIN = ".wks_segment_origin"
"""Temporary face attribute with the number of each face: modifiers copy it to the faces that they make of a face."""
DEFORMING = frozenset({
    "ARMATURE", "CAST", "CLOTH", "CORRECTIVE_SMOOTH", "CURVE", "DISPLACE", "HOOK", "LAPLACIANDEFORM", "LATTICE",
    "MESH_CACHE", "MESH_DEFORM", "MESH_SEQUENCE_CACHE", "NORMAL_EDIT", "SHRINKWRAP", "SIMPLE_DEFORM", "SMOOTH",
    "LAPLACIANSMOOTH", "SOFT_BODY", "SURFACE_DEFORM", "WARP", "WAVE", "WEIGHTED_NORMAL",
})  # fmt: skip
"""Modifiers that only move vertices, so that faces keep their numbers."""
SIMULATING = frozenset({"COLLISION", "DYNAMIC_PAINT", "FLUID", "PARTICLE_SYSTEM", "SURFACE"})
"""Modifiers beside `DEFORMING` that take part in simulations and make no faces."""


@dataclass(frozen=True)
class ObjectSurface:
    """The surface of an object.

    Attributes
    ----------
    vertices : (n, 3) array
        In world space.
    triangles : (m, 3) int array
    polygon_of : (m,) int array
        Polygon of the object's own mesh that each triangle comes from, −1 for none.
    vertex_of : (n,) int array
        Vertex of the object's own mesh that each vertex is, −1 for unknown.
    """

    vertices: FloatArray
    triangles: IntArray
    polygon_of: IntArray
    vertex_of: IntArray


@dataclass(frozen=True)
class Origins:
    """How the faces of a character's objects are traced.

    Attributes
    ----------
    marks
        Name of the attribute with the origin of each face, by mesh.
    traced
        Polygon of each face as a stand-in has it, and its corners, by object; for objects that must not be changed.
    """

    marks: dict[bpy.types.Mesh, str]
    traced: dict[bpy.types.Object, tuple[IntArray, IntArray]]


@contextmanager
def origins_of(scene: bpy.types.Scene, character: Character) -> Iterator[Origins]:
    """Make the faces of a character traceable for a while, where modifiers may make faces.

    Numbers of faces are added to the meshes as a temporary attribute; for an object that must not be changed, to a
    stand-in. They start at 1, since faces that a modifier takes from other meshes get 0.
    """
    making = [obj for obj in character.objects if any(m.type not in DEFORMING | SIMULATING for m in obj.modifiers)]
    if must_not_change(scene, character):
        yield Origins({}, {obj: _traced(obj) for obj in making})
        return
    names: dict[bpy.types.Mesh, str] = {}
    try:
        for mesh in dict.fromkeys(obj.data for obj in making):
            names[mesh] = _mark(mesh)
            mesh.update_tag()
        yield Origins(names, {})
    finally:
        for mesh, name in names.items():
            mesh.attributes.remove(mesh.attributes[name])


def read_surface(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph, origins: Origins, pose: str) -> ObjectSurface:
    """The surface of an object in a pose with a name.

    Raises
    ------
    UserError
        If its faces cannot be traced to the polygons of its mesh; OtherFacesError if only in this pose.
    """
    evaluated = obj.evaluated_get(depsgraph)
    mesh = evaluated.to_mesh()
    try:
        mesh.calc_loop_triangles()
        vertices = read_floats(mesh.vertices, "co", 3).astype(np.float64)
        triangles = read_ints(mesh.loop_triangles, "vertices", 3)
        polygons, is_same = _origin_of_faces(obj, mesh, origins, pose)
        polygon_of = polygons[read_ints(mesh.loop_triangles, "polygon_index")]
        world = np.array(evaluated.matrix_world, dtype=np.float64)
    finally:
        evaluated.to_mesh_clear()
    with np.errstate(invalid="ignore", over="ignore"):  # read_pose refuses it
        vertices = vertices @ world[:3, :3].T + world[:3, 3]
    vertex_of = np.arange(len(vertices)) if is_same else np.full(len(vertices), -1)
    return ObjectSurface(vertices, triangles, polygon_of, vertex_of)


def _origin_of_faces(obj: bpy.types.Object, mesh: bpy.types.Mesh, origins: Origins, pose: str) -> tuple[IntArray, bool]:
    """Polygon of the object's own mesh that each face of its evaluated mesh comes from, −1 for none.

    And whether the evaluated mesh has the same faces in the same order.
    """
    own = np.arange(len(obj.data.polygons))
    is_same = has_corners_of(mesh, obj.data)
    traced = origins.traced.get(obj)
    mark = mesh.attributes.get(origins.marks[obj.data]) if obj.data in origins.marks else None
    if mark is not None and len(mesh.polygons):
        polygons = read_ints(mark.data, "value") - 1
        if polygons.max() >= 0:
            return polygons, is_same and np.array_equal(polygons, own)
    elif is_same or not len(mesh.polygons):
        return own[: len(mesh.polygons)], is_same
    elif traced is not None and np.array_equal(traced[1], _corners(mesh)):
        return traced[0], False
    if traced is not None:
        raise UserError(
            '"{pose}": the faces of "{object}" cannot be traced to its mesh without losing the frames of its '
            "simulation: bake the simulation first",
            pose=pose, object=obj.name,
        )  # fmt: skip
    if obj.data in origins.marks and not any(modifier.type == "MESH_SEQUENCE_CACHE" for modifier in obj.modifiers):
        raise UserError(
            '"{pose}": a modifier of "{object}" such as Remesh makes faces that cannot be traced to the mesh: apply '
            "it, or turn it off",
            pose=pose, object=obj.name,
        )  # fmt: skip
    raise OtherFacesError(
        '"{pose}": "{object}" has {there:,} faces there that are not those of its mesh, which has {here:,}: a cache '
        "changes its faces from frame to frame. Take frames in which they stay the same",
        pose=pose, object=obj.name, there=len(mesh.polygons), here=len(obj.data.polygons),
    )  # fmt: skip


def has_corners_of(mesh: bpy.types.Mesh, other: bpy.types.Mesh) -> bool:
    """Whether two meshes have the same number of vertices, and the same polygons with the same corners."""
    return len(mesh.vertices) == len(other.vertices) and np.array_equal(_corners(mesh), _corners(other))


def _corners(mesh: bpy.types.Mesh) -> IntArray:
    """The vertices of all corners, then the number of corners of each polygon."""
    return np.concatenate([read_ints(mesh.loops, "vertex_index"), polygon_sizes(mesh)])


def _mark(mesh: bpy.types.Mesh) -> str:
    """Number the faces of a mesh from 1 in a new attribute; return its name."""
    return new_attribute(mesh, ORIGIN, "INT", "FACE", np.arange(1, len(mesh.polygons) + 1)).name


def _traced(obj: bpy.types.Object) -> tuple[IntArray, IntArray]:
    """Polygon of each face and the corners, of a stand-in with only those modifiers that make faces.

    The stand-in has a scene of its own, so that nothing in the artist's scene is evaluated again.
    """
    scene, stand_in, mesh = bpy.data.scenes.new(ORIGIN), obj.copy(), obj.data.copy()
    try:
        stand_in.data, stand_in.parent = mesh, None
        stand_in.animation_data_clear()
        for modifier in list(stand_in.modifiers):
            if modifier.type in DEFORMING | SIMULATING or is_simulation_zone(modifier):
                stand_in.modifiers.remove(modifier)
        name = _mark(mesh)
        scene.collection.objects.link(stand_in)
        layer = scene.view_layers[0]
        layer.update()
        evaluated = stand_in.evaluated_get(layer.depsgraph)
        seen = evaluated.to_mesh()
        mark = seen.attributes.get(name)
        origin = np.full(len(seen.polygons), -1) if mark is None else read_ints(mark.data, "value") - 1
        corners = _corners(seen)
        evaluated.to_mesh_clear()
        return origin, corners
    finally:
        bpy.data.objects.remove(stand_in)
        bpy.data.meshes.remove(mesh)
        bpy.data.scenes.remove(scene)
