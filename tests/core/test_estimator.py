"""`PoseSegmentation` as an estimator of scikit-learn."""

import pickle

import numpy as np
import pytest
from shapes import creature
from sklearn.base import clone
from sklearn.exceptions import NotFittedError
from sklearn.utils.validation import check_is_fitted

from wks_segment.core import PoseSegmentation
from wks_segment.core.learning.parameters import PARAMETERS

POSES = [creature(bend, 3) for bend in (0.0, 0.4)]
SMALL = {"n_segments": 3, "n_eigenpairs": 20, "n_energies": 12}


class CanceledError(Exception):
    pass


@pytest.fixture(scope="module")
def model():
    return PoseSegmentation(**SMALL).fit(POSES)


def learned(model):
    return {name: value for name, value in vars(model).items() if name.endswith("_")}


def test_parameters_can_be_read_and_set():
    model = PoseSegmentation(5, scaling="raw")
    assert set(model.get_params()) == set(PARAMETERS)
    assert model.set_params(n_segments=7) is model
    assert model.get_params() == PoseSegmentation(7, scaling="raw").get_params()
    with pytest.raises(ValueError, match="there is no parameter"):
        model.set_params(segments=3)


def test_representation_shows_the_changed_parameters():
    assert repr(PoseSegmentation(5, preset="paper")) == "PoseSegmentation(n_segments=5, preset='paper')"


def test_parameters_are_checked_by_fit_and_not_before():
    model = PoseSegmentation(n_segments=-1)
    with pytest.raises(ValueError, match="n_segments must be a whole number"):
        model.fit(POSES)


def test_clone_has_the_parameters_and_nothing_learned(model):
    copy = clone(model)
    assert copy.get_params() == model.get_params()
    with pytest.raises(NotFittedError):
        check_is_fitted(copy)


def test_unfitted_model_raises_not_fitted_error():
    unfitted = PoseSegmentation()
    for use in (unfitted.predict, unfitted.segment_regions, unfitted.comparable_score):
        with pytest.raises(NotFittedError, match="the model is not fitted"):
            use(POSES[0])
    assert not hasattr(unfitted, "n_segments_")


def test_fitted_and_loaded_models_count_as_fitted(model):
    check_is_fitted(model)
    check_is_fitted(PoseSegmentation.from_json(model.to_json()))


def test_labeling_changes_nothing_learned(model):
    before, text = learned(model), model.to_json()
    pose = model.describe(POSES[0])
    labels = model.segment_polygons([pose], [np.arange(POSES[0].n_faces)])
    model.polygon_sides([pose], [np.arange(POSES[0].n_faces)], labels)
    model.segment_regions(pose)
    model.with_segments(2, [pose])
    assert all(learned(model)[name] is value for name, value in before.items())
    assert model.to_json() == text


def test_canceled_fit_leaves_the_model_as_it_was(model):
    def cancel(stage, share):
        if stage == "regions":
            raise CanceledError

    again, text = PoseSegmentation.from_json(model.to_json()), model.to_json()
    with pytest.raises(CanceledError):
        again.fit([model.describe(pose) for pose in POSES], progress=cancel)
    assert again.to_json() == text


def test_pickled_model_is_the_same(model):
    assert pickle.loads(pickle.dumps(model)).to_json() == model.to_json()


def test_mean_and_spread_can_be_read(model):
    assert model.centre_ is model.standardizer_.mean
    assert model.spread_ is model.standardizer_.spread
    assert model.centre_.shape == model.spread_.shape == (SMALL["n_energies"],)
