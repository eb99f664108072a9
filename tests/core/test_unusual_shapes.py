"""Parts of shapes that artists have and benchmarks lack: very coarse, in very many islands, at rest, full of holes."""

import numpy as np
import pytest
from shapes import creature, figure, icosphere, together

from wks_segment.core import PoseSegmentation, TriangleMesh


def small_model(n_segments=3):
    return PoseSegmentation(n_segments, n_eigenpairs=40, n_energies=30)


def test_a_mesh_of_sixty_faces_has_as_many_segments_as_asked_for():
    # Two balls on a rod, as a dumbbell is modeled in a minute.
    heights = [-1.5, -1.3, -0.9, -0.7, 0.7, 0.9, 1.3, 1.5]
    radii = [0.01, 0.5, 0.5, 0.1, 0.1, 0.5, 0.5, 0.01]
    turn = np.arange(4) * np.pi / 2
    rings = [
        np.column_stack([r * np.cos(turn), r * np.sin(turn), 0 * turn + z]) for r, z in zip(radii, heights, strict=True)
    ]
    faces = []
    for ring in range(7):
        for i in range(4):
            a, b = 4 * ring + i, 4 * ring + (i + 1) % 4
            faces += [(a, b, b + 4), (a, b + 4, a + 4)]
    faces += [(0, 2, 1), (0, 3, 2), (28, 29, 30), (28, 30, 31)]
    mesh = TriangleMesh(np.concatenate(rings), np.array(faces))
    assert mesh.n_faces == 60
    assert set(np.unique(small_model(2).fit([mesh]).segment_faces(mesh))) == {0, 1}


def test_islands_by_the_thousand_are_segmented_together():
    generator = np.random.default_rng(0)
    chain = icosphere(0)
    places = np.column_stack([np.arange(1100) * 1.5, generator.uniform(-0.2, 0.2, (1100, 2))])
    mesh = together(*(TriangleMesh(chain.vertices + place, chain.faces) for place in places))
    labels = small_model(2).fit([mesh]).segment_faces(mesh)
    assert labels.shape == (mesh.n_faces,)
    assert set(np.unique(labels)) == {0, 1}


def test_poses_that_are_all_the_same_give_the_parts_of_one():
    pose = figure(0.3, 0.3, 3)
    once, thrice = (small_model(4).fit([pose] * n).segment_faces(pose) for n in (1, 3))
    assert np.average(once == thrice, weights=pose.face_areas) > 0.9


@pytest.mark.parametrize("seed", range(2))
def test_a_mesh_with_a_third_of_its_faces_missing_is_segmented(seed):
    whole = creature(0.3, 4)
    kept = np.random.default_rng(seed).random(whole.n_faces) > 0.3
    holed = TriangleMesh(whole.vertices, whole.faces[kept])
    labels = small_model().fit([holed]).segment_faces(holed)
    assert len(np.unique(labels)) > 1
