"""Meshes made by formulas, so that the right answers are known."""

import numpy as np

from wks_segment.core import TriangleMesh


def icosphere(subdivisions):
    """Unit sphere of 20 · 4^subdivisions triangles of nearly equal size."""
    golden = (1 + 5**0.5) / 2
    vertices = np.array(
        [(-1, golden, 0), (1, golden, 0), (-1, -golden, 0), (1, -golden, 0), (0, -1, golden), (0, 1, golden),
         (0, -1, -golden), (0, 1, -golden), (golden, 0, -1), (golden, 0, 1), (-golden, 0, -1), (-golden, 0, 1)]
    )  # fmt: skip
    faces = np.array(
        [(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2), (10, 7, 6),
         (7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5), (2, 4, 11), (6, 2, 10),
         (8, 6, 7), (9, 8, 1)]
    )  # fmt: skip
    for _ in range(subdivisions):
        edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        unique, index = np.unique(edges, axis=0, return_inverse=True)
        ab, bc, ca = (len(vertices) + index.reshape(-1, 3)).T
        vertices = np.concatenate([vertices, vertices[unique].mean(axis=1)])
        a, b, c = faces.T
        faces = np.concatenate([np.stack(t, axis=1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    return TriangleMesh(vertices / np.linalg.norm(vertices, axis=1)[:, None], faces)


def grid(nx, ny, width=1.0, height=1.0):
    """Flat rectangle of nx × ny cells, with alternating diagonals so that both directions are equal."""
    x, y = np.meshgrid(np.linspace(0, width, nx + 1), np.linspace(0, height, ny + 1), indexing="ij")
    vertices = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    faces = []
    for i in range(nx):
        for j in range(ny):
            a, b, c, d = (i * (ny + 1) + j, (i + 1) * (ny + 1) + j, (i + 1) * (ny + 1) + j + 1, i * (ny + 1) + j + 1)
            faces += [(a, b, c), (a, c, d)] if (i + j) % 2 == 0 else [(a, b, d), (b, c, d)]
    return TriangleMesh(vertices, np.array(faces))


def creature(bend=0.0, subdivisions=4, seed=None):
    """Sphere with a long limb, two short ones and a thin one, in a pose in which the limbs are bent (radians)."""
    sphere = icosphere(subdivisions)
    points = sphere.vertices.copy()
    limbs = (((1, 0, 0), 3.0, 0.35), ((-0.6, 0.8, 0), 1.2, 0.45), ((-0.6, -0.8, 0), 1.2, 0.45), ((0, 0, 1), 2.0, 0.25))
    for axis, length, width in limbs:
        angle = np.arccos(np.clip(points @ np.asarray(axis, float) / np.linalg.norm(points, axis=1), -1, 1))
        points = points + length * np.exp(-((angle / width) ** 2))[:, None] * np.asarray(axis, float)
    # The limbs turn about z, the more the further out they are: a nearly isometric deformation.
    out = np.maximum(np.linalg.norm(points, axis=1) - 1.2, 0)
    turn = bend * out / 3
    x, y, z = points.T
    posed = np.stack([x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn), z], axis=1)
    faces = sphere.faces
    if seed is not None:
        order = np.random.default_rng(seed).permutation(len(posed))
        inverse = np.argsort(order)
        posed, faces = posed[order], inverse[faces]
    return TriangleMesh(posed, faces)


def shaken(mesh, amount=0.35, seed=0):
    """The mesh with vertices moved along edges: irregular triangles, some of them thin."""
    generator = np.random.default_rng(seed)
    edge = mesh.faces[:, [0, 1]]
    target = np.arange(mesh.n_vertices)
    target[edge[:, 0]] = edge[:, 1]
    share = amount * generator.random((mesh.n_vertices, 1))
    return TriangleMesh((1 - share) * mesh.vertices + share * mesh.vertices[target], mesh.faces)


def split_at_every_corner(mesh):
    """The mesh as a triangle soup: each corner of a face has a vertex of its own."""
    return TriangleMesh(mesh.vertices[mesh.faces].reshape(-1, 3), np.arange(3 * mesh.n_faces).reshape(-1, 3))


def together(*meshes):
    """Several meshes as the islands of one."""
    starts = np.cumsum([0, *(mesh.n_vertices for mesh in meshes)])
    return TriangleMesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]),
    )


LIMBS = {
    "head": ((0, 0, 1), 1.2, 0.35), "left arm": ((1, 0, 0.3), 2.5, 0.2), "right arm": ((-1, 0, 0.3), 2.5, 0.2),
    "left leg": ((0.5, 0, -1), 2.5, 0.25), "right leg": ((-0.5, 0, -1), 2.5, 0.25), "nose": ((0, -0.7, 0.7), 0.5, 0.2),
    "tail": ((0, 0.9, -0.3), 0.7, 0.2),
}  # fmt: skip


def figure(left=0.0, right=0.0, subdivisions=4):
    """Body with arms and legs that faces −y, as in Blender; `left` and `right` (radians) lift the limbs of a side."""
    sphere = icosphere(subdivisions)
    points = sphere.vertices.copy()
    for axis, length, width in LIMBS.values():
        unit = np.array(axis) / np.linalg.norm(axis)
        angle = np.arccos(np.clip(sphere.vertices @ unit, -1, 1))
        points = points + length * np.exp(-((angle / width) ** 2))[:, None] * unit
    # Each side turns about y, the more the further out it is: a nearly isometric deformation.
    out = np.maximum(np.abs(points[:, 0]) - 0.8, 0)
    turn = np.where(points[:, 0] > 0, left, -right) * out / 2
    x, y, z = points.T
    posed = np.stack([x * np.cos(turn) + z * np.sin(turn), y, z * np.cos(turn) - x * np.sin(turn)], axis=1)
    return TriangleMesh(posed, sphere.faces)


def places_on(surface):
    """(n', 3) vertices of a surface where the original mesh lies, which its own frame moves and scales."""
    own = surface.to_vertices(surface.mesh.vertices)
    matrix = np.linalg.lstsq(np.column_stack([own, np.ones(len(own))]), surface.original.vertices, rcond=None)[0]
    return np.column_stack([surface.mesh.vertices, np.ones(surface.mesh.n_vertices)]) @ matrix
