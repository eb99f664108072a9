import numpy as np
import pytest
from shapes import creature

from wks_segment.core import PoseSegmentation, prepare_surface
from wks_segment.core.learning.merge_tree import Contacts, MergeTree, PoseGeometry

# A row of four components with equal areas; the second and the third have hardly any border.
ROW = np.zeros((4, 4))
ROW[[0, 1, 2], [1, 2, 3]] = 1.0, 0.01, 0.8
ROW += ROW.T
EVEN = np.full(4, 0.25)


def overlaps(areas, shared=0.02):
    """Overlaps of nearly certain posteriors: only neighbors in the row share a little."""
    table = np.diag(areas - shared)
    table[[0, 1, 2], [1, 2, 3]] = shared / 2
    return table + np.triu(table, 1).T


def test_components_with_a_long_border_are_joined_first():
    tree = MergeTree.of(Contacts(ROW, EVEN, overlaps(EVEN)))
    assert tree.pairs.tolist() == [[0, 1], [2, 3], [0, 2]]
    assert tree.groups(4).tolist() == [0, 3, 1, 2]
    assert tree.groups(3).tolist() == [0, 0, 1, 2]
    assert tree.groups(2).tolist() == [0, 0, 1, 1]
    assert tree.groups(1).tolist() == [0, 0, 0, 0]


def test_one_group_more_splits_one_and_keeps_the_numbers_of_the_others():
    areas = np.array([0.1, 0.3, 0.4, 0.2])
    tree = MergeTree.of(Contacts(ROW, areas, overlaps(areas)))
    for count in (1, 2, 3):
        coarse, fine = tree.groups(count), tree.groups(count + 1)
        kept = fine < count
        np.testing.assert_array_equal(fine[kept], coarse[kept])
        (split,) = set(coarse[~kept])  # the new group is less than half of one old group
        assert areas[~kept].sum() <= areas[kept & (coarse == split)].sum()


def test_first_join_lowers_the_sum_of_border_by_area_most():
    # Each merge lowers Σ border / area; the first one must lower it most.
    def total(groups):
        table = np.eye(max(groups) + 1)[groups]
        borders = table.T @ ROW @ table
        np.fill_diagonal(borders, 0)
        return (borders.sum(axis=1) / (table.T @ areas)).sum()

    areas = np.array([0.4, 0.3, 0.2, 0.1])
    best = min([[0, 0, 1, 2], [0, 1, 1, 2], [0, 1, 2, 2]], key=total)
    found = MergeTree.of(Contacts(ROW, areas, overlaps(areas))).groups(3)
    assert (found[:, None] == found).tolist() == (np.array(best)[:, None] == best).tolist()


def test_small_and_scattered_components_are_joined_first():
    areas = np.array([0.5, 0.25, 0.245, 0.005])
    assert MergeTree.of(Contacts(ROW, areas, overlaps(areas, 0.001))).pairs[0].tolist() == [2, 3]
    scattered = np.array([False, False, True, False])
    assert 2 in MergeTree.of(Contacts(ROW, EVEN, overlaps(EVEN)), scattered).pairs[0]


def test_components_that_replace_each_other_between_poses_are_joined():
    # Half of the faces belong to component 0 in one pose and to 3 in the other; the rest belong to 1 and 2.
    labels = np.array([[0] * 4 + [1, 1, 2, 2], [3] * 4 + [1, 1, 2, 2]])
    contacts = Contacts(ROW, EVEN, overlaps(EVEN)).with_changes(np.eye(4)[labels])
    expected = np.zeros((4, 4))
    expected[0, 3] = expected[3, 0] = 20 * 0.5 / 2
    np.testing.assert_allclose(contacts.borders - ROW, expected)
    assert MergeTree.of(contacts).pairs[0].tolist() == [0, 3]


def test_components_without_borders_are_joined_by_overlap():
    apart = np.zeros((3, 3))
    areas = np.full(3, 1 / 3)
    shared = np.diag(areas - 0.01)
    shared[0, 2] = shared[2, 0] = 0.005
    assert MergeTree.of(Contacts(apart, areas, shared)).pairs[0].tolist() == [0, 2]


def test_certainty_is_one_for_certain_faces_and_zero_by_chance():
    sure = MergeTree.of(Contacts(ROW, EVEN, np.diag(EVEN)))
    np.testing.assert_allclose(sure.curve(), [0, 1, 1, 1])
    assert sure.best_number() == 4
    guessed = MergeTree.of(Contacts(ROW, EVEN, np.outer(EVEN, EVEN)))
    np.testing.assert_allclose(guessed.curve(), 0, atol=1e-12)


def test_best_number_is_the_last_before_certainty_falls():
    # Components of one half cannot be told apart; the halves can be with certainty.
    halves = np.kron(np.eye(2), np.full((2, 2), 0.125))
    tree = MergeTree.of(Contacts(ROW, EVEN, halves))
    np.testing.assert_allclose(tree.certainties[[1, 3]], [1, 0.5])
    assert tree.best_number() == 2


def test_contacts_measure_borders_on_the_surface():
    surface = prepare_surface(creature(0.3, 4))
    geometry = PoseGeometry.of(surface)
    x = surface.original.vertices[surface.original.faces].mean(axis=1)[:, 0]
    contacts = Contacts.on(geometry, np.stack([x < 0, x >= 0], axis=1).astype(float))
    a, b = geometry.adjacency.pairs.T
    expected = geometry.lengths[(x[a] < 0) != (x[b] < 0)].sum()
    np.testing.assert_allclose(contacts.borders, [[0, expected], [expected, 0]])
    np.testing.assert_allclose(contacts.areas.sum(), 1)
    np.testing.assert_allclose(np.diag(contacts.overlaps), contacts.areas)


@pytest.fixture(scope="module")
def poses():
    return [creature(bend, 4) for bend in (0.0, 0.4)]


def test_open_number_of_segments_is_the_best_number(poses, tmp_path):
    model = PoseSegmentation("auto", n_eigenpairs=60, n_energies=40).fit(poses)
    assert model.n_segments_ == model.grouping_.best_number()
    assert 2 <= model.n_segments_ <= 16
    assert model.predict_proba(poses[0]).shape == (poses[0].n_vertices, model.n_segments_)
    model.save(tmp_path / "model.json")
    loaded = PoseSegmentation.load(tmp_path / "model.json")
    assert loaded.n_segments_ == model.n_segments_
    np.testing.assert_array_equal(loaded.segment_faces(poses[1]), model.segment_faces(poses[1]))


def test_other_number_of_segments_needs_no_fit(poses):
    model = PoseSegmentation(6, n_eigenpairs=60, n_energies=40).fit(poses)
    described = model.describe(poses[0])
    fine = model.predict_proba(described)
    model.n_segments = 3
    # The three segments are unions of the six.
    whole = model.predict_proba(described)
    unions = np.array(
        [[np.allclose(whole[:, j], fine[:, list(some)].sum(axis=1)) for some in _subsets(6)] for j in range(3)]
    )
    assert unions.any(axis=1).all()


def _subsets(count):
    return [[i for i in range(count) if mask >> i & 1] for mask in range(1, 2**count)]


def test_no_segment_consists_of_small_regions_only(poses):
    model = PoseSegmentation(4, n_eigenpairs=30, n_energies=40).fit(poses)
    for pose in poses:
        assert len(np.unique(model.segment_faces(pose))) == 4


def test_paper_preset_needs_a_number_of_segments(poses):
    with pytest.raises(ValueError, match="n_segments must be a number"):
        PoseSegmentation("auto", preset="paper").fit(poses)
