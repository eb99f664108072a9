import time

import numpy as np
import pytest
from shapes import creature, icosphere, split_at_every_corner, together

from wks_segment.core import MemoryCache, PoseSegmentation, TriangleMesh, connect, prepare_surface
from wks_segment.core.mesh.adjacency import FaceAdjacency, connected_regions

SMALL = {"n_segments": 4, "n_eigenpairs": 60}
POSES = [creature(bend) for bend in (0.0, 0.4, 0.8)]
COARSE = [creature(bend, 3) for bend in (0.0, 0.4, 0.8)]
"""For what does not depend on how fine a mesh is."""


@pytest.fixture(scope="module")
def model():
    return PoseSegmentation(**SMALL).fit(POSES)


@pytest.fixture(scope="module")
def coarse():
    """Two coarse poses, described with few energies: time with full covariances grows with their square."""
    return PoseSegmentation(**SMALL, n_energies=30).describe_all(COARSE[:2])


def test_unseen_poses_get_the_same_labels(model):
    usual = model.predict(POSES[0])
    for bend in (0.2, 0.6):
        pose = creature(bend)
        assert (pose.vertex_areas @ (model.predict(pose) == usual)) / pose.area > 0.95


def test_a_finer_mesh_of_the_same_body_gets_the_same_labels(model):
    # The vertices of the coarser icosphere are the first of the finer one.
    coarse = model.predict(POSES[0])
    fine = model.predict(creature(0.0, 5))[: len(coarse)]
    assert (coarse == fine).mean() > 0.95


def test_labels_do_not_depend_on_place_size_or_order_of_vertices(model):
    pose = POSES[1]
    order = np.random.default_rng(2).permutation(pose.n_vertices)
    moved = TriangleMesh(0.01 * pose.vertices[order] + 7, np.argsort(order)[pose.faces])
    assert (model.predict(moved) == model.predict(pose)[order]).mean() > 0.999


def test_posteriors_are_probabilities_and_the_label_has_the_highest(model):
    described = model.describe(POSES[0])
    posteriors = model.predict_proba(described)
    assert posteriors.shape == (POSES[0].n_vertices, 4)
    np.testing.assert_allclose(posteriors.sum(axis=1), 1.0, atol=1e-6)  # in single precision
    np.testing.assert_array_equal(model.predict(described), posteriors.argmax(axis=1))


def test_soft_posteriors_are_probabilities_and_smoother(model):
    described = model.describe(POSES[0])
    plain, soft = model.predict_proba(described), model.predict_soft(described)
    assert soft.shape == plain.shape
    assert soft.min() >= 0
    np.testing.assert_allclose(soft.sum(axis=1), 1.0)
    edges = POSES[0].faces[:, :2]
    steps = [((of[edges[:, 0]] - of[edges[:, 1]]) ** 2).sum() for of in (plain, soft)]
    assert steps[1] < 0.5 * steps[0]
    assert (soft.argmax(axis=1) == plain.argmax(axis=1)).mean() > 0.9


def test_soft_posteriors_without_smoothness_equal_the_posteriors(model):
    described = model.describe(POSES[0])
    rough = PoseSegmentation.from_json(model.to_json())
    rough.smoothness = 0.0
    np.testing.assert_allclose(rough.predict_soft(described), model.predict_proba(described), rtol=1e-9)


def test_regions_are_connected_and_not_too_small(model):
    described = model.describe(POSES[2])
    regions = model.segment_regions(described)
    mesh = POSES[2]
    adjacency = FaceAdjacency.of(mesh.faces, mesh.vertices)
    names, areas = np.unique(regions), np.bincount(regions, weights=mesh.face_areas)
    assert areas[names].min() >= 0.005 * mesh.area
    assert connected_regions(regions, adjacency).max() + 1 == len(names)


def test_with_the_paper_preset_regions_are_connected_regions_of_components():
    mesh = POSES[0]
    model = PoseSegmentation(**SMALL, preset="paper").fit([mesh])
    adjacency = FaceAdjacency.of(mesh.faces, mesh.vertices)
    expected = connected_regions(model.segment_faces(mesh), adjacency)
    np.testing.assert_array_equal(model.segment_regions(mesh), expected)


def test_limb_and_body_are_different_segments(model):
    # Of four segments, which are too few to have one for each, the last border depends on the processor's rounding.
    labels = model.with_segments(8).predict(POSES[0])
    tip = labels[np.argmax(POSES[0].vertices[:, 0])]
    body = labels[np.argmin(np.abs(POSES[0].vertices - (0, 0, -1)).sum(axis=1))]
    assert tip != body


def test_shape_scores_highest_with_the_model_of_its_class(model):
    def stretched(bend):
        ball = creature(bend, 3)
        return TriangleMesh(ball.vertices * (1, 0.4, 2.5), ball.faces)

    other = PoseSegmentation(**SMALL).fit([stretched(bend) for bend in (0.0, 0.3, 0.6)])
    assert model.score(creature(0.9)) > other.score(creature(0.9)) + 10
    assert other.score(stretched(0.45)) > model.score(stretched(0.45)) + 10


@pytest.mark.parametrize("covariance_type", ["auto", "shared", "diag", "spherical", "tied", "full"])
@pytest.mark.parametrize("scaling", ["log", "raw"])
def test_every_setting_can_be_learned_and_saved(tmp_path, coarse, covariance_type, scaling):
    fitted = PoseSegmentation(**SMALL, n_energies=30, covariance_type=covariance_type, scaling=scaling).fit(coarse)
    fitted.save(tmp_path / "model.json")
    loaded = PoseSegmentation.load(tmp_path / "model.json")
    np.testing.assert_array_equal(loaded.predict_proba(coarse[0]), fitted.predict_proba(coarse[0]))
    assert loaded.score(coarse[1]) == fitted.score(coarse[1])
    assert loaded.covariance_type == covariance_type


def test_the_same_poses_give_the_same_model():
    one, again = (PoseSegmentation(**SMALL).fit(COARSE[:2]) for _ in range(2))
    assert again.to_json() == one.to_json()


def test_copies_of_a_vertex_along_seams_get_the_same_label(model):
    soup = split_at_every_corner(POSES[0])
    np.testing.assert_array_equal(model.predict(soup), model.predict(POSES[0])[POSES[0].faces.ravel()])


def test_coarse_mesh_is_refined_internally_and_labeled_on_its_own_vertices():
    coarse = [creature(bend, 2) for bend in (0.0, 0.6)]
    fitted = PoseSegmentation(3, n_eigenpairs=100).fit(coarse)
    assert fitted.describe(coarse[0]).surface.mesh.n_vertices >= 1000
    assert fitted.predict(coarse[0]).shape == (coarse[0].n_vertices,)
    assert fitted.segment_faces(coarse[0]).shape == (coarse[0].n_faces,)


def test_islands_get_labels_and_do_not_disturb_the_body():
    def with_eyes(bend):
        eyes = [TriangleMesh(0.1 * icosphere(1).vertices + place, icosphere(1).faces) for place in (2.0, -2.0)]
        return together(creature(bend), *eyes)

    fitted = PoseSegmentation(**SMALL).fit([with_eyes(0.0), with_eyes(0.6)])
    labels = fitted.predict(with_eyes(0.0))
    unseen = fitted.predict(with_eyes(0.3))
    assert (labels == unseen).mean() > 0.95
    assert len(np.unique(labels[: POSES[0].n_vertices])) >= 3
    assert set(fitted.segment_faces(with_eyes(0.3))) <= set(range(4))


def test_polygons_of_several_triangles_are_labeled_over_all_poses(model):
    # Each triangle of the coarse mesh is a polygon of four triangles of the fine mesh.
    coarse = [creature(bend, 3) for bend in (0.0, 0.6)]
    fine = [prepare_surface(mesh, 2000) for mesh in coarse]
    labels = model.segment_polygons([surface.mesh for surface in fine], [surface.face_of for surface in fine])
    assert labels.shape == (coarse[0].n_faces,)
    assert (labels == model.segment_faces(coarse[0])).mean() > 0.9
    with pytest.raises(ValueError, match="there are 2 poses, but polygons for 1"):
        model.segment_polygons(coarse, [np.arange(coarse[0].n_faces)])
    with pytest.raises(ValueError, match="pose 0 has 1280 triangles, but polygons for"):
        model.segment_polygons(coarse[:1], [np.arange(3)])


def test_progress_rises_to_one():
    seen = []
    PoseSegmentation(**SMALL).fit(COARSE[:2], progress=lambda stage, fraction: seen.append((stage, fraction)))
    fractions = [fraction for _, fraction in seen]
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1.0
    assert seen[0][0] == "pose 1 of 2"
    assert sum(stage == "parts" for stage, _ in seen) > 10
    assert {"mixture", "regions"} <= {stage for stage, _ in seen}


def test_progress_has_a_share_for_what_is_computed_only():
    """Signatures that are known take no time, and none of the bar."""

    def first_of(stage, poses, cache=None):
        seen = []
        PoseSegmentation(**SMALL).fit(poses, lambda *report: seen.append(report), cache=cache)
        return next(share for name, share in seen if name == stage)

    cache, model = MemoryCache(), PoseSegmentation(**SMALL)
    some = COARSE[::2]  # the most symmetric pose and the most spread one, so that another one changes no signature
    all_new = first_of("parts", some, cache)
    assert 0.05 < all_new < 0.9
    assert first_of("parts", some, cache) == 0
    assert 0.01 < first_of("parts", COARSE, cache) < 0.8 * all_new
    assert first_of("parts", [model.describe(pose) for pose in COARSE[:2]]) == 0


@pytest.mark.parametrize(("n_pairs", "shape"), [(30, 3), (300, 3), (300, 4)])
def test_progress_of_learning_is_near_to_the_time(n_pairs, shape):
    """When it comes to learning, the bar shows the share of the time that has passed; of processor time here."""
    meshes, model = [creature(bend, shape) for bend in (0.0, 0.4)], PoseSegmentation(4, n_eigenpairs=n_pairs)
    model.fit(meshes)  # imports
    clock, seen = time.process_time, []
    begun = clock()
    model.fit(meshes, lambda stage, share: seen.append((stage, share, clock() - begun)))
    _, share, seconds = next(each for each in seen if each[0] == "parts")
    assert share == pytest.approx(seconds / (clock() - begun), abs=0.15)


class StopError(Exception):
    pass


@pytest.mark.parametrize(("stage", "reports"), [("pose", 3), ("parts", 3), ("mixture", 2), ("regions", 3)])
def test_error_from_progress_ends_a_fit_within_a_stage(stage, reports):
    calls = []

    def progress(current, share):
        if current.startswith(stage):
            calls.append(current)
            if len(calls) == reports:
                raise StopError

    learner = PoseSegmentation(**SMALL)
    with pytest.raises(StopError):
        learner.fit(COARSE, progress=progress)
    assert len(calls) == reports
    assert not hasattr(learner, "regions_") or learner.regions_ is None


def test_error_from_progress_ends_labeling(model):
    described = [model.describe(mesh) for mesh in POSES]
    shares = []

    def progress(share):
        shares.append(share)
        if len(shares) == 2:
            raise StopError

    with pytest.raises(StopError):
        model.segment_polygons(described, [np.arange(mesh.n_faces) for mesh in POSES], progress=progress)
    assert len(shares) == 2
    assert 0 < shares[0] < shares[1] <= 1 / len(POSES)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"n_segments": 0}, "n_segments must be a whole number of at least 1, not 0"),
        ({"n_segments": "8"}, "n_segments must be a whole number"),
        ({"n_eigenpairs": 2}, "n_eigenpairs must be"),
        ({"n_energies": 1.5}, "n_energies must be"),
        ({"covariance_type": "round"}, "covariance_type must be one of"),
        ({"accuracy": "best"}, "accuracy must be one of"),
        ({"scaling": "cube"}, "scaling must be one of"),
        ({"random_state": -1}, "random_state must be"),
        ({"n_segments": 100_000}, "n_segments is 100000, but the poses have only"),
    ],
)
def test_bad_parameter_is_named_in_the_error(change, message):
    with pytest.raises(ValueError, match=message):
        PoseSegmentation(**{**SMALL, **change}).fit([POSES[0]])


def test_fit_without_a_pose_is_refused():
    with pytest.raises(ValueError, match="no pose to learn from"):
        PoseSegmentation().fit([])


def test_unfitted_model_is_refused(tmp_path):
    unfitted = PoseSegmentation(**SMALL)
    for use in (unfitted.predict, unfitted.score, unfitted.segment_faces):
        with pytest.raises(ValueError, match="not fitted"):
            use(creature(0.0, 3))
    with pytest.raises(ValueError, match="not fitted"):
        unfitted.save(tmp_path / "model.json")


def test_value_that_is_no_pose_is_refused(model):
    with pytest.raises(TypeError, match="must be a TriangleMesh or a PoseSignature, not list"):
        model.predict([1, 2, 3])


def test_poses_described_in_parallel_equal_poses_described_one_by_one():
    model = PoseSegmentation(**SMALL)
    stages = []
    together_ = model.describe_all(POSES, progress=lambda stage, share: stages.append((stage, share)), workers=2)
    connection = connect(*POSES)
    for pose, described in zip(POSES, together_, strict=True):
        np.testing.assert_allclose(described.signature, model.describe(pose, connection).signature, rtol=1e-4)
    shares = [share for _, share in stages]
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    assert stages[0][0] == "pose 1 of 3"


def test_error_from_progress_ends_all_poses():
    class StopError(Exception):
        pass

    def stop(stage, share):
        if share > 0:
            raise StopError

    with pytest.raises(StopError):
        PoseSegmentation(**SMALL).describe_all(POSES, progress=stop, workers=2)


def test_pose_that_cannot_be_described_is_named_in_the_error():
    # A triangle with an edge that is too short.
    bad = TriangleMesh([(0, 0, 0), (1, 0, 0), (1, 1e-8, 0)], [(0, 1, 2)])
    model = PoseSegmentation(n_energies=1)
    with pytest.raises(ValueError, match="n_energies"):
        model.describe_all(POSES[:1])
    with pytest.raises(ValueError, match=r'"Bad": .*collapses'):
        PoseSegmentation(**SMALL).describe_all([POSES[0], bad], names=['"Good"', '"Bad"'])
