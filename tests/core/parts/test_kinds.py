import numpy as np
import pytest
from shapes import creature, figure, icosphere, together

from wks_segment.core import MemoryCache, PoseSegmentation, TriangleMesh
from wks_segment.core.parts.evidence import Evidence
from wks_segment.core.parts.kinds import FIRST, SMALL_KIND, Kinds, find_kinds
from wks_segment.core.poses.pose_cache import Workpiece
from wks_segment.core.progress import Progress


def kinds_of(*meshes, n_segments=4, agree=None, **parameters):
    """Kinds of meshes, each in one pose or a list of poses."""
    model = PoseSegmentation(n_eigenpairs=40, n_energies=20, **parameters)
    evidences = []
    for poses in meshes:
        described = model.describe_all(poses if isinstance(poses, list) else [poses])
        evidences.append(Evidence.of([Workpiece(pose) for pose in described], None, Progress()))
    signatures = [mean_signature(evidence.poses) for evidence in evidences]
    mean = np.mean([signature.mean(axis=0) for signature in signatures], axis=0)
    return find_kinds(evidences, [signature - mean for signature in signatures], n_segments, Progress(), agree)


def mean_signature(poses):
    """(m, d) signature of the faces, mean over the poses."""
    return np.mean([pose.surface.to_faces(pose.signature) for pose in poses], axis=0)


def check(kinds, *meshes):
    """Each face has a kind, and all kinds are merged into one."""
    count = len(kinds.merges) + 1
    assert kinds.merges.shape == (count - 1, 2)
    assert kinds.likeness.shape == (count - 1,)
    assert np.isfinite(kinds.likeness).all()
    assert [len(kind) for kind in kinds.of_faces] == [mesh.n_faces for mesh in meshes]
    assert set(np.concatenate(kinds.of_faces)) == set(range(count))
    left = set(range(count))
    for kept, gone in kinds.merges.tolist():
        assert kept in left
        left.remove(gone)
    assert len(left) == 1


def areas_of(kinds, meshes):
    """Mean share of each kind in the area."""
    count = len(kinds.merges) + 1
    shares = [np.bincount(k, m.face_areas / m.area, count) for k, m in zip(kinds.of_faces, meshes, strict=True)]
    return np.mean(shares, axis=0)


def merged(kinds, n_left):
    """Kind of each face of each mesh when so many are left."""
    owner = np.arange(len(kinds.merges) + 1)
    for kept, gone in kinds.merges[: len(owner) - n_left]:
        owner[owner == gone] = kept
    return [owner[kind] for kind in kinds.of_faces]


@pytest.fixture(scope="module")
def body():
    return figure(subdivisions=3)


@pytest.fixture(scope="module")
def of_body(body):
    return kinds_of(body)


@pytest.fixture(scope="module")
def bodies(body):
    return [body, creature(0.2, 3, seed=0), TriangleMesh(body.vertices * (1.05, 0.97, 1.0), body.faces[::-1])]


@pytest.fixture(scope="module")
def of_bodies(bodies):
    return kinds_of(*bodies)


def test_both_sides_of_a_symmetric_figure_are_one_kind(body, of_body):
    check(of_body, body)
    kind = of_body.of_faces[0]
    left, right = ([np.argmax(body.face_centers @ (side * x, 0, z)) for x, z in ((1, 0.3), (0.5, -1))]
                   for side in (1, -1))  # fmt: skip
    np.testing.assert_array_equal(kind[left], kind[right])
    areas = [np.bincount(kind[sign * body.face_centers[:, 0] > 0.1],
                         body.face_areas[sign * body.face_centers[:, 0] > 0.1], kind.max() + 1)
             for sign in (1, -1)]  # fmt: skip
    np.testing.assert_allclose(areas[0], areas[1], atol=0.02 * body.area)


def test_arms_and_legs_and_head_are_different_kinds(body, of_body):
    arm, leg, head = (np.argmax(body.face_centers @ np.array(axis)) for axis in ((1, 0, 0.3), (0.5, 0, -1), (0, 0, 1)))
    kind = of_body.of_faces[0]
    assert len({kind[arm], kind[leg], kind[head]}) == 3


def test_small_balls_on_both_sides_of_a_large_one_are_the_same_kinds():
    ball = icosphere(2)
    sides = [TriangleMesh(0.5 * ball.vertices + (place, 0, 0), ball.faces) for place in (-2.6, 2.6)]
    mesh = together(TriangleMesh(2 * ball.vertices, ball.faces), *sides)
    kinds = kinds_of(mesh)
    check(kinds, mesh)
    _, left, right = np.split(kinds.of_faces[0], 3)
    assert set(left) == set(right)


def test_the_larger_kind_of_a_merge_keeps_its_number(body, of_body, bodies, of_bodies):
    for kinds, meshes in ((of_body, [body]), (of_bodies, bodies)):
        areas = areas_of(kinds, meshes)
        for kept, gone in kinds.merges:
            assert areas[kept] >= areas[gone] - 1e-9
            areas[kept] += areas[gone]


def test_small_kinds_are_merged_before_all_others(body):
    # Buttons on the body: far too small to be parts.
    ball = icosphere(1)
    at = body.vertices[np.argmax(body.vertices @ np.array(((0, -1, 0),)).T)]
    button = TriangleMesh(0.14 * ball.vertices + at - (0, 0.2, 0), ball.faces)
    mesh = together(body, button)
    assert button.area < SMALL_KIND * mesh.area
    for meshes in ([mesh], [mesh, creature(0.2, 3, seed=0)]):
        kinds = kinds_of(*meshes)
        check(kinds, *meshes)
        areas = areas_of(kinds, meshes)
        n_small, ended = np.count_nonzero(areas < SMALL_KIND), False
        assert n_small > 0
        for kept, gone in kinds.merges:
            small = areas[gone] < SMALL_KIND
            assert not (small and ended)
            ended = ended or not small
            areas[kept] += areas[gone]


def test_several_bodies_share_kinds(bodies, of_bodies):
    check(of_bodies, *bodies)
    assert set.intersection(*(set(kind) for kind in of_bodies.of_faces))


def test_the_same_body_with_its_faces_in_another_order_has_the_same_kinds(body):
    again = TriangleMesh(3 * body.vertices[:, [1, 2, 0]] + 1, body.faces[::-1])
    kinds = kinds_of(body, creature(0.2, 3, seed=0), again)
    np.testing.assert_array_equal(kinds.of_faces[0], kinds.of_faces[2][::-1])


def test_kinds_are_read_from_the_arrays_that_they_give(of_body, of_bodies):
    for kinds in (of_body, of_bodies):
        again = Kinds.of_arrays(kinds.arrays())
        assert len(again.of_faces) == len(kinds.of_faces)
        for found, expected in zip(again.of_faces, kinds.of_faces, strict=True):
            np.testing.assert_array_equal(found, expected)
        np.testing.assert_array_equal(again.merges, kinds.merges)
        np.testing.assert_array_equal(again.likeness, kinds.likeness)
    assert Kinds.of_arrays({}) is None


def test_more_segments_than_usual_have_enough_kinds(bodies):
    kinds = kinds_of(*bodies, n_segments=20)
    check(kinds, *bodies)
    assert len(kinds.merges) + 1 >= 20


def test_islands_that_do_not_touch_are_merged_last_and_unlikely():
    ball = icosphere(1)
    mesh = together(ball, TriangleMesh(0.4 * ball.vertices + (5, 0, 0), ball.faces))
    kinds = kinds_of(mesh, pieces="separate")
    check(kinds, mesh)
    if len(kinds.merges):
        assert kinds.likeness[-1] == -FIRST
        large, small = np.split(merged(kinds, 2)[0], 2)
        assert len(set(large)) == len(set(small)) == 1


@pytest.mark.parametrize("subdivisions", [0, 2])
def test_a_ball_is_of_one_kind_or_merged_into_one(subdivisions):
    ball = icosphere(subdivisions)
    check(kinds_of(ball), ball)
    check(kinds_of(ball, ball), ball, ball)


def test_poses_that_do_not_move_change_nothing(body, of_body):
    again = kinds_of([body, body])
    np.testing.assert_array_equal(again.of_faces[0], of_body.of_faces[0])
    np.testing.assert_allclose(again.likeness, of_body.likeness, atol=1e-2)


def test_meshes_agree_on_the_kinds_of_their_regions():
    """The function is given the regions of both meshes, with a kind each, and its kinds are those of the faces."""
    seen = []

    def agree(graphs, kinds):
        seen.append([len(graph.regions) for graph in graphs])
        assert [len(of_mesh) for of_mesh in kinds] == seen[0]
        return [np.arange(len(of_mesh)) % 3 for of_mesh in kinds]

    bodies = creature(0.0, 2, seed=0), figure(subdivisions=2)
    kinds = kinds_of(*bodies, agree=agree)
    check(kinds, *bodies)
    assert len(kinds.merges) == 2
    assert len(seen) == 1


def test_nearly_the_same_body_has_the_same_kinds_once_all_agree(body, bodies):
    """Its faces are in another order."""
    kept = {}

    class Recording(MemoryCache):
        def keep(self, key, arrays):
            kept[key] = Kinds.of_arrays(arrays)

    PoseSegmentation(4, n_eigenpairs=40, n_energies=20).fit(bodies, cache=Recording())
    (kinds,) = (kinds for kinds in kept.values() if kinds is not None)
    check(kinds, *bodies)
    first, last = kinds.of_faces[0], kinds.of_faces[2][::-1]
    assert body.face_areas[first == last].sum() / body.area > 0.8
