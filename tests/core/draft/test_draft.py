"""A draft has parts like the real ones, whatever the meshes, and leaves everything as it is."""

import numpy as np
import pytest
from shapes import creature, grid, split_at_every_corner

from wks_segment.core import PoseSegmentation
from wks_segment.core.draft.segments import draft
from wks_segment.core.mesh.surface import connect_alike
from wks_segment.core.progress import Progress

POSES = [creature(bend, subdivisions=4) for bend in (0.0, 0.3, 0.6, 0.9)]


def drafted(meshes, **parameters):
    names = [f"pose {i}" for i in range(len(meshes))]
    return draft(PoseSegmentation(**{"n_segments": 5} | parameters), meshes, connect_alike(meshes, names))


def rand_index(first, second, areas):
    """Adjusted Rand index of two labelings, by area."""
    table = np.zeros((first.max() + 1, second.max() + 1))
    np.add.at(table, (first, second), areas / areas.sum())
    both, one, other = ((sums**2).sum() for sums in (table, table.sum(axis=1), table.sum(axis=0)))
    return (both - one * other) / ((one + other) / 2 - one * other)


def test_draft_is_like_the_result():
    labels = drafted(POSES)
    model = PoseSegmentation(n_segments=5, n_eigenpairs=150).fit(POSES)
    real = model.segment_faces(POSES[0])
    assert len(np.unique(labels[0])) > 2
    assert rand_index(real, labels[0], POSES[0].face_areas) > 0.5
    for other in labels[1:]:  # poses of one mesh
        np.testing.assert_array_equal(other, labels[0])


def test_model_stays_as_it_is_and_a_draft_is_the_same_again():
    model = PoseSegmentation(n_segments=3, n_eigenpairs=200)
    connections = connect_alike(POSES[:2], ["a", "b"])
    before = model.get_params()
    first, second = (draft(model, POSES[:2], connections) for _ in range(2))
    assert model.get_params() == before
    assert not hasattr(model, "mixture_")
    np.testing.assert_array_equal(first, second)


@pytest.mark.parametrize("parameters", [{"n_segments": "auto"}, {"preset": "paper"}, {"pieces": "separate"}])
def test_parameters_of_the_model_count(parameters):
    (first, second) = drafted(POSES[:2], **parameters)
    assert len(np.unique(first)) > 1
    np.testing.assert_array_equal(first, second)


def test_one_segment_is_no_draft():
    assert drafted(POSES[:2], n_segments=1) is None


def test_several_bodies_of_which_most_are_not_learned():
    bodies = [creature(0.1 * i, subdivisions=4, seed=i) for i in range(5)]
    bodies[1], bodies[3] = split_at_every_corner(bodies[1]), creature(0.2, subdivisions=3)
    labels = drafted(bodies, n_segments=8)
    assert [len(of_body) for of_body in labels] == [body.n_faces for body in bodies]
    assert all(0 <= of_body.min() <= of_body.max() < 8 for of_body in labels)


def test_no_draft_of_a_ribbon_whose_cells_form_a_chain():
    assert drafted([grid(4000, 1, 4000, 1)]) is None


def test_progress_ends_a_draft():
    told = []

    def stop(share):
        told.append(share)
        if share > 0.2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        draft(PoseSegmentation(), POSES, connect_alike(POSES, "abcd"), Progress.of_share(stop))
    assert told == sorted(told)
