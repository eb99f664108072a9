"""Perturbations of a mesh, as they come from scans, imports and artists: noise, holes, glued surfaces, resampling.

Each function takes a mesh, a strength and a random generator, and returns the changed mesh with, for each of its faces,
the index of the corresponding face of the original mesh, or −1.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from scipy.spatial import cKDTree

from wks_segment.core import TriangleMesh
from wks_segment.core.mesh.subdivision import split_faces
from wks_segment.core.mesh.triangle_mesh import FloatArray, IntArray, unique_edges

Perturbed = tuple[TriangleMesh, IntArray]

SHOT_DISTANCE = 0.05
"""Distance by which shot noise moves a vertex, relative to the diagonal of the bounding box."""
HOLE_RADIUS, LARGE_HOLE_RADIUS = 0.02, 0.03
"""Radius of holes, relative to the same diagonal. A large hole can cut off a forearm or a foot."""
GLUE_DISTANCE = 0.15
"""Largest length of a glued triangle, relative to the same diagonal."""


def noise(mesh: TriangleMesh, strength: float, generator: np.random.Generator) -> Perturbed:
    """Move each vertex by a normal deviate of `strength` times the mean edge length."""
    shift = strength * _mean_edge(mesh) * generator.standard_normal(mesh.vertices.shape) / np.sqrt(3)
    return TriangleMesh(mesh.vertices + shift, mesh.faces), np.arange(mesh.n_faces)


def shot_noise(mesh: TriangleMesh, strength: float, generator: np.random.Generator) -> Perturbed:
    """Move a share of the vertices far away."""
    chosen = generator.choice(mesh.n_vertices, max(1, round(strength * mesh.n_vertices)), replace=False)
    direction = generator.standard_normal((len(chosen), 3))
    vertices = mesh.vertices.copy()
    vertices[chosen] += SHOT_DISTANCE * _diagonal(mesh) * direction / np.linalg.norm(direction, axis=1)[:, None]
    return TriangleMesh(vertices, mesh.faces), np.arange(mesh.n_faces)


def holes(
    mesh: TriangleMesh, strength: float, generator: np.random.Generator, radius: float = HOLE_RADIUS
) -> Perturbed:
    """Cut round holes at random places."""
    kept = np.ones(mesh.n_faces, dtype=bool)
    centers = mesh.vertices[mesh.faces].mean(axis=1)
    for face in generator.choice(mesh.n_faces, round(strength), p=mesh.face_areas / mesh.area):
        kept &= np.linalg.norm(centers - centers[face], axis=1) > radius * _diagonal(mesh)
    return _with_faces(mesh, mesh.faces[kept]), np.flatnonzero(kept)


def glued(mesh: TriangleMesh, strength: float, generator: np.random.Generator) -> Perturbed:
    """Add triangles between points that are near in space but not on the surface."""
    added: list[IntArray] = []
    near = cKDTree(mesh.vertices)
    normals = _vertex_normals(mesh)
    while len(added) < round(strength):
        face = mesh.faces[generator.integers(mesh.n_faces)]
        others = np.array(near.query_ball_point(mesh.vertices[face[0]], GLUE_DISTANCE * _diagonal(mesh)))
        facing = others[normals[others] @ normals[face[0]] < -0.5]
        if facing.size:
            added.append(np.array([face[0], face[1], generator.choice(facing)]))
    faces = np.concatenate([mesh.faces, added])
    owner = np.concatenate([np.arange(mesh.n_faces), np.full(len(added), -1)])
    return TriangleMesh(mesh.vertices, faces), owner


def sampling(mesh: TriangleMesh, strength: float, generator: np.random.Generator) -> Perturbed:
    """Reduce the faces to 1 / `strength` of their number by Blender's Decimate modifier."""
    import bpy

    data = bpy.data.meshes.new("sampled")
    data.from_pydata(mesh.vertices, [], mesh.faces)
    obj = bpy.data.objects.new("sampled", data)
    bpy.context.collection.objects.link(obj)
    obj.modifiers.new("Decimate", "DECIMATE").ratio = 1 / strength
    evaluated = obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    evaluated.calc_loop_triangles()
    vertices = np.empty(3 * len(evaluated.vertices), dtype=np.float32)
    evaluated.vertices.foreach_get("co", vertices)
    faces = np.empty(3 * len(evaluated.loop_triangles), dtype=np.int32)
    evaluated.loop_triangles.foreach_get("vertices", faces)
    bpy.data.objects.remove(obj)
    bpy.data.meshes.remove(data)
    coarse = TriangleMesh(vertices.reshape(-1, 3), faces.reshape(-1, 3))
    centers = cKDTree(mesh.vertices[mesh.faces].mean(axis=1))
    return coarse, centers.query(coarse.vertices[coarse.faces].mean(axis=1))[1]


def finer(mesh: TriangleMesh, strength: float, generator: np.random.Generator) -> Perturbed:
    """Split each face on one side of a random plane through the middle into four, `strength` times."""
    vertices, faces, owner = mesh.vertices, mesh.faces, np.arange(mesh.n_faces)
    side = mesh.vertices @ generator.standard_normal(3)
    side -= np.median(side)
    for _ in range(round(strength)):
        edges, which, _ = unique_edges(faces)
        split = np.zeros(len(edges), dtype=bool)
        split[which.reshape(-1, 3)[side[faces].mean(axis=1) > 0].ravel()] = True
        middle = np.full(len(edges), -1)
        middle[split] = len(vertices) + np.arange(split.sum())
        vertices = np.concatenate([vertices, vertices[edges[split]].mean(axis=1)])
        side = np.concatenate([side, side[edges[split]].mean(axis=1)])
        faces, parent = split_faces(faces, middle[which.reshape(-1, 3)], vertices)
        owner = owner[parent]
    return TriangleMesh(vertices, faces), owner


Perturbation = tuple[Callable[[TriangleMesh, float, np.random.Generator], Perturbed], tuple[float, ...]]

PERTURBATIONS: dict[str, Perturbation] = {
    "noise": (noise, (0.05, 0.15, 0.25)),
    "shot noise": (shot_noise, (0.002, 0.005, 0.01)),
    "holes": (holes, (2, 5, 10)),
    "large holes": (partial(holes, radius=LARGE_HOLE_RADIUS), (2, 5, 10)),
    "glued": (glued, (3, 8, 15)),
    "sampling": (sampling, (1.5, 2.5, 3.5)),
    "finer on one side": (finer, (1, 2, 3)),
}
"""Name to the function and its weak, medium and strong strength."""


def _diagonal(mesh: TriangleMesh) -> float:
    return float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))


def _mean_edge(mesh: TriangleMesh) -> float:
    corners = mesh.vertices[mesh.faces]
    return float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean())


def _vertex_normals(mesh: TriangleMesh) -> FloatArray:
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    face_normals = np.cross(b - a, c - a)
    normals = np.zeros((mesh.n_vertices, 3))
    for i in range(3):
        np.add.at(normals, mesh.faces[:, i], face_normals)
    return normals / np.maximum(np.linalg.norm(normals, axis=1), np.finfo(float).tiny)[:, None]


def _with_faces(mesh: TriangleMesh, faces: IntArray) -> TriangleMesh:
    """The mesh with only some of its faces, and the vertices that they use."""
    used, compact = np.unique(faces, return_inverse=True)
    return TriangleMesh(mesh.vertices[used], compact.reshape(-1, 3))
