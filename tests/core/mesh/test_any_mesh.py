"""Any mesh gets labels for every face, or an error that says what is wrong with it. `make fuzz` tries thousands."""

import numpy as np
from defects import any_mesh
from hypothesis import given
from tally import count

from wks_segment.core import PoseSegmentation, SpectrumError, TriangleMesh

SMALL = {"n_segments": 3, "n_eigenpairs": 20, "n_energies": 20}


def learned_from(mesh):
    return PoseSegmentation(**SMALL).fit([mesh])


MODEL = []


def model_of_a_good_mesh():
    from shapes import creature

    if not MODEL:
        MODEL.append(learned_from(creature(0.0, 3)))
    return MODEL[0]


@given(any_mesh())
def test_a_mesh_is_labeled_or_the_error_says_why_not(drawn):
    vertices, faces, names = drawn
    try:
        mesh = TriangleMesh(vertices, faces)
        model = model_of_a_good_mesh()
        pose = model.describe(mesh)
        labels, regions, score = model.segment_faces(pose), model.segment_regions(pose), model.score(pose)
    except (ValueError, SpectrumError) as error:
        assert len(str(error)) > 20, error
        count("mesh, labeled by a model", names, "refused")
        return
    assert labels.shape == (len(faces),)
    assert set(labels.tolist()) <= {0, 1, 2}
    assert regions.shape == (len(faces),)
    assert regions.min() >= 0
    assert np.isfinite(score)
    count("mesh, labeled by a model", names, "labeled")


@given(any_mesh())
def test_a_mesh_is_learned_or_the_error_says_why_not(drawn):
    vertices, faces, names = drawn
    try:
        mesh = TriangleMesh(vertices, faces)
        model = learned_from(mesh)
    except (ValueError, SpectrumError) as error:
        assert len(str(error)) > 20, error
        count("mesh, learned from", names, "refused")
        return
    posteriors = model.predict_proba(mesh)
    assert posteriors.shape == (len(vertices), 3)
    np.testing.assert_allclose(posteriors.sum(axis=1), 1, atol=1e-5)
    assert model.segment_regions(mesh).shape == (len(faces),)
    PoseSegmentation.from_json(model.to_json())
    count("mesh, learned from", names, "learned")
