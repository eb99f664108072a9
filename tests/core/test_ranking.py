"""Rankings of models: comparable between settings, with a verdict."""

import json
from copy import copy
from dataclasses import replace

import numpy as np
import pytest
from shapes import creature, icosphere

from wks_segment.core import PoseSegmentation, TriangleMesh, described_alike, rank, retrieve
from wks_segment.core.learning.gaussian_mixture import fit_mixture, maximize, squares_of, variance_floor
from wks_segment.core.learning.likelihood import left_out_likelihoods, likely_mean
from wks_segment.core.model_file import ModelFileError
from wks_segment.core.ranking import least_usual, ranking_of, spread_evenly

QUICK = {"n_segments": 3, "n_eigenpairs": 30, "n_energies": 30}
STRETCHED = np.array([1.0, 1.0, 4.0])


def stretched(bend):
    """Shape of another class."""
    mesh = creature(bend, 3)
    return TriangleMesh(mesh.vertices * STRETCHED, mesh.faces)


CLASSES = {"creature": lambda bend: creature(bend, 3), "stretched": stretched}
BENDS = (0.0, 0.3, 0.6)


@pytest.fixture(scope="module")
def models():
    return [PoseSegmentation(**QUICK).fit([make(bend) for bend in BENDS]) for make in CLASSES.values()]


def ranked(models, mesh):
    return rank(models, [[model.describe(mesh)] for model in models])


@pytest.mark.parametrize("kind", [0, 1])
def test_model_of_the_class_is_first(models, kind):
    found = ranked(models, list(CLASSES.values())[kind](0.45))
    assert [place.index for place in found.ranks] == [kind, 1 - kind]
    assert found.verdict == "sure"
    assert found.best.fits
    assert sum(place.probability for place in found.ranks) == pytest.approx(1)


@pytest.mark.parametrize(
    "other",
    [
        {"n_energies": 40}, {"n_eigenpairs": 60}, {"scaling": "raw"}, {"preset": "paper"}, {"covariance_type": "diag"},
        {"n_segments": 6}, {"covariance_type": "full"},
    ],
    ids=str,
)  # fmt: skip
def test_models_with_different_settings_are_comparable(models, other):
    """Each shape is assigned to its class, whichever class has the other settings."""
    makers = list(CLASSES.values())
    for kind, make in enumerate(makers):
        mixed = list(models)
        mixed[kind] = PoseSegmentation(**QUICK | other).fit([make(bend) for bend in BENDS])
        assert [ranked(mixed, of(0.45)).best.index for of in makers] == [0, 1]


def test_shape_of_no_class_fits_no_model(models):
    assert ranked(models, icosphere(3)).verdict == "nothing fits"


@pytest.mark.parametrize("factors", [(1, 1, 1.1), (1.1, 1, 1), (1, 1.15, 1)])
def test_body_of_other_proportions_fits(models, factors):
    body = creature(0.45, 3)
    found = ranked(models, TriangleMesh(body.vertices * factors, body.faces))
    assert (found.best.index, found.verdict) == (0, "sure")
    assert not found.ranks[1].fits


def test_correlations_do_not_count_for_models_of_one_mesh(models):
    model, pose = copy(models[0]), models[0].describe(creature(0.45, 3))
    assert model.mixture_.covariance_type == "tied"
    model.mixture_ = replace(model.mixture_, covariances=np.diag(np.diag(model.mixture_.covariances)))
    assert model.comparable_score(pose) == pytest.approx(models[0].comparable_score(pose))
    assert model.score(pose) != pytest.approx(models[0].score(pose), rel=0.01)


def test_verdict_is_unsure_between_equal_models(models):
    found = ranked([models[0], models[0]], creature(0.45, 3))
    assert found.verdict == "unsure"
    assert found.best.probability == pytest.approx(0.5)
    assert [place.index for place in found.ranks] == [0, 1]


def test_verdict_on_a_single_model_is_sure_if_it_fits(models):
    assert ranked(models[:1], creature(0.45, 3)).verdict == "sure"
    assert ranked(models[:1], icosphere(3)).verdict == "nothing fits"


def test_usual_scores_are_near_those_of_unseen_poses(models):
    for model, make in zip(models, CLASSES.values(), strict=True):
        assert model.usual_scores_.shape == (3,)
        assert np.mean(model.usual_scores_) == pytest.approx(model.comparable_score(make(0.45)), abs=0.3)
        learned = np.mean([model.comparable_score(make(bend)) for bend in BENDS])
        assert model.usual_scores_.mean() < learned


def test_usual_score_of_a_single_pose_is_its_score():
    mesh = creature(0.0, 3)
    model = PoseSegmentation(**QUICK).fit([mesh])
    assert model.usual_scores_ == pytest.approx([model.comparable_score(mesh)], abs=1e-5)


@pytest.mark.parametrize("scores", [None, []])
def test_usual_scores_are_saved_and_required(models, scores):
    text = models[0].to_json()
    np.testing.assert_array_equal(PoseSegmentation.from_json(text).usual_scores_, models[0].usual_scores_)
    content = json.loads(text) | {"usual_scores": scores}
    with pytest.raises(ModelFileError, match="usual_scores"):
        PoseSegmentation.from_json(json.dumps(content))


def test_score_is_the_mean_over_all_of_the_area(models):
    """Unlike `comparable_score`, which leaves out the least likely tenth."""
    model, mesh = models[0], creature(0.45, 3)
    pose = model.describe(mesh)
    assert model.score(pose) != pytest.approx(model.comparable_score(pose))
    assert model.score(mesh) == pytest.approx(model.score(pose))


def test_least_likely_tenth_does_not_count():
    shares = np.full(20, 0.05)
    values = np.arange(20.0)
    values[:2] = -1e9
    assert likely_mean(values, shares) == pytest.approx(values[2:].mean())
    assert likely_mean(values[::-1], shares) == pytest.approx(values[2:].mean())
    assert likely_mean(np.array([-4.0, 1.0]), np.array([0.2, 0.8])) == pytest.approx((-4 * 0.1 + 0.8) / 0.9)


def test_left_out_samples_are_less_likely():
    generator = np.random.default_rng(0)
    group = np.repeat(np.arange(3), 100)
    samples = generator.standard_normal((300, 4)) + group[:, None]
    shares = np.full(300, 1 / 300)
    for kind in ("shared", "diag", "spherical", "tied", "full"):
        mixture = fit_mixture(samples, shares, 3, kind, 0)
        without = left_out_likelihoods(mixture, samples, shares, group, lambda one: one)
        assert without.mean() < mixture.log_likelihoods(samples).mean()


def test_left_out_samples_have_the_likelihood_of_one_step_without_them():
    generator = np.random.default_rng(0)
    group = np.repeat(np.arange(3), [50, 100, 150])
    samples = generator.standard_normal((300, 4)) + group[:, None]
    shares = generator.random(300) + 0.5
    shares /= shares.sum()
    floor = variance_floor(samples, shares)
    for kind in ("shared", "diag", "spherical", "tied", "full"):
        mixture = fit_mixture(samples, shares, 3, kind, 0)
        found = left_out_likelihoods(mixture, samples, shares, group, lambda one: one)
        for i in range(3):
            others, own = samples[group != i], samples[group == i]
            masses = mixture.posteriors(others) * shares[group != i, None]
            without = maximize(others, squares_of(others, kind), masses / masses.sum(), kind, floor)
            np.testing.assert_allclose(found[group == i], without.log_likelihoods(own), rtol=1e-8)


def test_score_far_below_the_usual_is_another_class():
    assert least_usual(np.array([2.0])) == pytest.approx(1.5)
    assert least_usual(np.array([1.0, 2.0, 3.0])) == pytest.approx(2.0 - 3.0)
    assert ranking_of(np.array([1.0, 1.2]), [np.array([1.0]), np.array([2.0])], "aa").verdict == "nothing fits"


def test_models_with_the_same_settings_are_compared_by_score_alone():
    usual = [np.array([1.0]), np.array([2.0])]
    assert ranking_of(np.array([1.1, 1.9]), usual, "aa").best.index == 1
    assert ranking_of(np.array([1.1, 1.9]), usual, "ab").best.index == 0


def test_models_that_share_signatures_are_grouped(models):
    more = [*models, PoseSegmentation(n_energies=7), PoseSegmentation(**QUICK, pieces="separate")]
    assert described_alike(more) == [[0, 1], [2], [3]]


def test_ranking_without_models_or_poses_is_refused(models):
    with pytest.raises(ValueError, match="there are 0 models"):
        rank([], [])
    with pytest.raises(ValueError, match="there are 2 models, and poses for 1"):
        rank(models, [[models[0].describe(creature(0.0, 3))], []])


def test_retrieval_counts_queries_of_all_classes(models):
    queries = {name: [models[0].describe(make(bend)) for bend in (0.15, 0.45)] for name, make in CLASSES.items()}
    found = retrieve(dict(zip(CLASSES, models, strict=True)), queries)
    np.testing.assert_array_equal(found.confusion, [[2, 0], [0, 2]])
    assert (found.right, found.asked, found.rate) == (4, 4, 1.0)
    assert sum(map(sum, found.verdicts.values())) == 4


def test_learned_shapes_are_spread_evenly():
    assert spread_evenly(20, 5) == [0, 4, 8, 12, 16]
    assert spread_evenly(8, 5) == [0, 1, 3, 4, 6]
