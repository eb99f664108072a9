import numpy as np
import pytest

from wks_segment.core.learning.merge_tree import MOST_LIKENESS, MOST_SEGMENTS, ONE_PART, TWO_PARTS, MergeTree
from wks_segment.core.parts.kinds import Kinds

# Seven components: two of kind 0, three of kind 1, two of kind 2. Those of a kind lie on a line, kinds far apart.
KIND = np.array([0, 1, 2, 1, 0, 2, 1])
PLACES = np.array([(0.0, 0), (50, 0), (90, 0), (53, 0), (0.5, 0), (91, 0), (52, 0)])
WEIGHTS = np.array([0.2, 0.25, 0.15, 0.1, 0.05, 0.2, 0.05])
SHARES = np.array([0.25, 0.4, 0.35])
"""Of the kinds in the area."""


def kinds(merges, likeness):
    return Kinds([np.arange(len(merges) + 1)], np.array(merges).reshape(-1, 2), np.array(likeness, dtype=float))


THREE = kinds([(1, 0), (1, 2)], [0.5, -3.0])


def tree_of(kinds_=THREE, overlaps=None, kind=KIND, places=PLACES, weights=WEIGHTS):
    shares = np.full(kinds_.count, 1 / kinds_.count) if kinds_.count != 3 else SHARES
    return MergeTree.of(places, weights, weights, kind, kinds_, np.diag(shares) if overlaps is None else overlaps)


@pytest.fixture(scope="module")
def tree():
    return tree_of()


def alike(one, other):
    """Whether both are the same groups, whatever their numbers."""
    return ((one[:, None] == one) == (other[:, None] == other)).all()


def test_components_of_a_kind_are_merged_before_kinds(tree):
    assert tree.n_kinds == 3
    assert alike(tree.groups(3), KIND)
    assert alike(tree.groups(2), np.where(KIND == 0, 1, KIND))
    assert tree.groups(1).tolist() == [0] * 7


def test_the_nearest_components_of_any_kind_are_merged_first(tree):
    # By distance: 4 to 0 (0.5), then 2 to 5 and 6 to 3 (1), then these to 1.
    assert tree.pairs[0].tolist() == [0, 4]
    assert {tuple(pair) for pair in tree.pairs[1:3].tolist()} == {(5, 2), (3, 6)}
    assert tree.pairs[3].tolist() == [1, 3]
    assert tree.pairs[4:].tolist() == [[1, 0], [1, 5]]


def test_the_larger_group_keeps_its_name_inside_a_kind():
    """Two small components together outweigh the one that they are merged with."""
    weights = np.array([0.3, 0.4, 0.15, 0.15])
    tree = tree_of(
        kinds([], []), np.ones((1, 1)), np.zeros(4, int), np.array([(0.0, 0), (9, 0), (1, 0), (9.5, 0)]), weights
    )
    assert tree.pairs.tolist() == [[1, 3], [0, 2], [1, 0]]


def test_one_group_more_splits_one_and_keeps_the_numbers_of_the_others(tree):
    for count in range(1, 7):
        coarse, fine = tree.groups(count), tree.groups(count + 1)
        kept = fine < count
        assert set(fine) == set(range(count + 1))
        np.testing.assert_array_equal(fine[kept], coarse[kept])
        assert len(set(coarse[~kept])) == 1
    assert sorted(tree.groups(7)) == list(range(7))


def test_a_kind_without_components_is_left_out():
    """Kind 3 has none: it passes on what is merged into it, and its own merges are no steps."""
    four = kinds([(3, 0), (3, 2), (1, 3)], [4.0, 3.0, -5.0])
    overlaps = np.diag([0.25, 0.4, 0.35, 0.0])
    tree = tree_of(four, overlaps)
    assert tree.n_kinds == 3
    assert len(tree.pairs) == 6
    assert alike(tree.groups(3), KIND)
    assert alike(tree.groups(2), np.where(KIND == 2, 0, KIND))
    np.testing.assert_allclose(tree.likeness[1:3], [-5.0, 3.0])
    np.testing.assert_allclose(tree.certainties, [1.0] * 7)
    np.testing.assert_allclose(tree.by_chance[:3], [1, 0.4**2 + 0.6**2, (SHARES**2).sum()])


def test_a_single_component_is_one_group():
    tree = tree_of(kinds([], []), np.ones((1, 1)), np.zeros(1, int), np.zeros((1, 2)), np.ones(1))
    assert (tree.n_kinds, tree.natural, tree.number_of_wholes(1)) == (1, 1, 1)
    assert tree.pairs.shape == (0, 2)
    assert tree.groups(1).tolist() == [0]
    assert tree.curve().tolist() == [0]


def test_likeness_is_that_of_the_kinds_and_most_inside_one(tree):
    np.testing.assert_allclose(tree.likeness, [-MOST_LIKENESS, -3.0, 0.5, *[MOST_LIKENESS] * 4])
    extreme = tree_of(kinds([(1, 0), (1, 2)], [1e3, -1e3]))
    np.testing.assert_allclose(extreme.likeness[1:3], [-MOST_LIKENESS, MOST_LIKENESS])


def test_certainty_is_one_for_certain_faces_and_zero_by_chance(tree):
    np.testing.assert_allclose(tree.certainties, 1)
    np.testing.assert_allclose(tree.curve(), [0, *[1] * 6])
    # In single precision the shares of the area do not sum to 1.
    for total in (1, 1 - 1e-7, 1 + 1e-7):
        guessed = tree_of(overlaps=total * np.outer(SHARES, SHARES))
        np.testing.assert_allclose(guessed.curve(), 0, atol=1e-6)


def test_certainty_is_lower_where_kinds_share_faces():
    """A tenth of the area is claimed by halves by kinds 0 and 1: with both merged, all is certain."""
    overlaps = np.diag(SHARES)
    overlaps[0, 0], overlaps[1, 1] = overlaps[0, 0] - 0.025, overlaps[1, 1] - 0.025
    overlaps[0, 1] = overlaps[1, 0] = 0.025
    before = overlaps.copy()
    tree = tree_of(overlaps=overlaps)
    np.testing.assert_array_equal(overlaps, before)
    np.testing.assert_allclose(tree.certainties, [1, 1, *[0.95] * 5])
    chance = (SHARES**2).sum()
    np.testing.assert_allclose(tree.curve()[1:], [1, *[(0.95 - chance) / (1 - chance)] * 5])


def row(likeness):
    """Tree of kinds of one component each, with log-odds of their merges, the first merge first."""
    count = len(likeness) + 1
    places = np.arange(count)[:, None] * 1.0
    merges = [(0, i) for i in range(count - 1, 0, -1)]
    return tree_of(kinds(merges, likeness), None, np.arange(count), places, np.full(count, 1 / count))


@pytest.mark.parametrize("n_apart", [0, 1, 3, 6])
def test_an_open_number_of_segments_keeps_apart_what_is_surely_two_parts(n_apart):
    tree = row([1.0] * (6 - n_apart) + [TWO_PARTS - 0.1] * n_apart)
    assert tree.natural == max(2, 1 + n_apart)
    assert tree.number_of("auto") == tree.natural
    assert tree.number_of(5) == 5


def test_an_open_number_of_segments_is_limited():
    assert row([TWO_PARTS - 1] * (MOST_SEGMENTS + 5)).natural == MOST_SEGMENTS


def test_wholes_are_no_fragments_of_what_is_one_part():
    # With five groups the next merge is of fragments, so four are whole; with six it is not.
    tree = row([ONE_PART - 1.0, ONE_PART + 0.1, ONE_PART - 1.0, ONE_PART - 2.0, ONE_PART - 3.0])
    assert [tree.number_of_wholes(most) for most in (1, 2, 3, 4, 5, 6)] == [1, 2, 3, 4, 4, 4]
    assert [row([1.0] * 3).number_of_wholes(most) for most in (1, 2, 4)] == [1, 2, 2]


def test_groups_of_groups_are_where_their_components_are(tree):
    for fine in range(1, 8):
        for coarse in range(1, fine + 1):
            owner = tree.group_of_groups(fine, coarse)
            assert owner.shape == (fine,)
            np.testing.assert_array_equal(owner[tree.groups(fine)], tree.groups(coarse))
