"""Meshes with the defects that occur in practice: a base shape, and functions that damage its vertices and faces.

`any_mesh` is a hypothesis strategy of (vertices, faces, names of the defects); it draws from `DEFECTS`.
"""

import numpy as np
from hypothesis import strategies as st
from shapes import creature, grid, icosphere


def tetrahedron():
    return np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1.0)]), np.array(
        [(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)]
    )


def arrays(mesh):
    return mesh.vertices.copy(), mesh.faces.copy()


def soup(generator):
    """Random triangles that share no vertices."""
    return generator.standard_normal((3 * 60, 3)), np.arange(3 * 60).reshape(-1, 3)


def scattered(generator):
    """Triangles between random vertices: edges with many faces, and faces that intersect each other."""
    faces = generator.integers(0, 40, (150, 3))
    return generator.standard_normal((40, 3)), faces[np.apply_along_axis(lambda f: len(set(f)) == 3, 1, faces)]


BASES = {
    "tetrahedron": lambda generator: tetrahedron(),
    "sphere": lambda generator: arrays(icosphere(2)),
    "creature": lambda generator: arrays(creature(0.3, 3)),
    "sheet": lambda generator: arrays(grid(9, 7)),
    "soup": soup,
    "scattered": scattered,
}


def random_indices(generator, count, share=0.1):
    return generator.choice(count, max(1, round(share * count)), replace=False)


def open_border(vertices, faces, generator):
    return vertices, np.delete(faces, random_indices(generator, len(faces), 0.2), axis=0)


def duplicate_faces(vertices, faces, generator):
    return vertices, np.concatenate([faces, faces[random_indices(generator, len(faces))]])


def two_sided(vertices, faces, generator):
    return vertices, np.concatenate([faces, faces[:, ::-1]])


def mixed_orientation(vertices, faces, generator):
    faces = faces.copy()
    turned = random_indices(generator, len(faces), 0.4)
    faces[turned] = faces[turned, ::-1]
    return vertices, faces


def edges_of_three_faces(vertices, faces, generator):
    chosen = faces[random_indices(generator, len(faces), 0.05)]
    tips = vertices[chosen].mean(axis=1) + 0.3 * generator.standard_normal((len(chosen), 3))
    fins = np.column_stack([chosen[:, :2], len(vertices) + np.arange(len(chosen))])
    return np.concatenate([vertices, tips]), np.concatenate([faces, fins])


def faces_without_area(vertices, faces, generator):
    vertices = vertices.copy()
    chosen = faces[random_indices(generator, len(faces), 0.1)]
    vertices[chosen[:, 0]] = vertices[chosen[:, 1]]
    return vertices, faces


def faces_on_a_line(vertices, faces, generator):
    vertices = vertices.copy()
    chosen = faces[random_indices(generator, len(faces), 0.05)]
    vertices[chosen[:, 2]] = vertices[chosen[:, :2]].mean(axis=1)
    return vertices, faces


def isolated_vertices(vertices, faces, generator):
    return np.concatenate([vertices, 3 * generator.standard_normal((20, 3))]), faces


def unwelded(vertices, faces, generator):
    return vertices[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3)


def half_welded(vertices, faces, generator):
    faces = faces.copy()
    chosen = random_indices(generator, len(faces), 0.3)
    split = vertices[faces[chosen]].reshape(-1, 3)
    faces[chosen] = len(vertices) + np.arange(len(split)).reshape(-1, 3)
    return np.concatenate([vertices, split]), faces


def small_islands(vertices, faces, generator):
    small, small_faces = tetrahedron()
    size = np.ptp(vertices, axis=0).max()
    for _ in range(12):
        faces = np.concatenate([faces, small_faces + len(vertices)])
        vertices = np.concatenate([vertices, size * (0.05 * small + generator.standard_normal(3))])
    return vertices, faces


def inside_each_other(vertices, faces, generator):
    return np.concatenate([vertices, 0.7 * vertices + 0.1]), np.concatenate([faces, faces + len(vertices)])


def glued(vertices, faces, generator):
    new = generator.integers(0, len(vertices), (6, 3))
    return vertices, np.concatenate([faces, new[np.apply_along_axis(lambda f: len(set(f)) == 3, 1, new)]])


def noise(vertices, faces, generator):
    return vertices + 0.05 * generator.standard_normal(vertices.shape) * np.ptp(vertices, axis=0).max(), faces


def spikes(vertices, faces, generator):
    vertices = vertices.copy()
    chosen = random_indices(generator, len(vertices), 0.02)
    vertices[chosen] += 5 * generator.standard_normal((len(chosen), 3)) * np.ptp(vertices, axis=0).max()
    return vertices, faces


def flat(vertices, faces, generator):
    return vertices * (1, 1, 0), faces


def needle(vertices, faces, generator):
    return vertices * (1, 1e-4, 1e-4), faces


def tiny(vertices, faces, generator):
    return 1e-6 * vertices, faces


def huge(vertices, faces, generator):
    return 1e6 * vertices, faces


def far_from_the_origin(vertices, faces, generator):
    return vertices + 1e4 * np.ptp(vertices, axis=0).max(), faces


def all_at_one_place(vertices, faces, generator):
    return np.zeros_like(vertices), faces


def not_finite(vertices, faces, generator):
    vertices = vertices.copy()
    vertices[generator.integers(len(vertices)), generator.integers(3)] = generator.choice([np.nan, np.inf, -np.inf])
    return vertices, faces


def beyond_single_precision(vertices, faces, generator):
    return 1e30 * vertices, faces


DEFECTS = {
    defect.__name__: defect
    for defect in (
        open_border, duplicate_faces, two_sided, mixed_orientation, edges_of_three_faces, faces_without_area,
        faces_on_a_line, isolated_vertices, unwelded, half_welded, small_islands, inside_each_other, glued, noise,
        spikes, flat, needle, tiny, huge, far_from_the_origin, all_at_one_place, not_finite,
        beyond_single_precision,
    )
}  # fmt: skip


@st.composite
def any_mesh(draw):
    """(vertices, faces, [name of the base, names of the defects …])."""
    base = draw(st.sampled_from(sorted(BASES)))
    names = draw(st.lists(st.sampled_from(sorted(DEFECTS)), max_size=4))
    generator = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    vertices, faces = BASES[base](generator)
    for name in names:
        vertices, faces = DEFECTS[name](vertices, faces, generator)
    return vertices, faces, [base, *names]
