"""Calls that cannot be right are refused, and the message names the argument."""

import numpy as np
import pytest
from shapes import creature, grid, icosphere

from wks_segment.core import (
    PoseSegmentation,
    TriangleMesh,
    eigenpairs,
    fit_mixture,
    heat_kernel_signature,
    prepare_surface,
    rank,
    wave_kernel_signature,
)
from wks_segment.core.message import message_of

MESH = grid(4, 4)
SAMPLES = np.repeat([[0.0], [1.0], [2.0]], 4, axis=0)


def model(**parameters):
    return PoseSegmentation(**{"n_segments": 2, "n_eigenpairs": 12, "n_energies": 8} | parameters)


@pytest.fixture(scope="module")
def fitted():
    return model(preset="paper").fit([creature(subdivisions=2)])


WRONG = {
    "vertices: 2 columns": lambda: TriangleMesh([[0, 0]], [[0, 0, 0]]),
    "vertex 1: not finite": lambda: TriangleMesh([[0, 0, 0], [np.nan, 0, 0], [0, 1, 0]], [[0, 1, 2]]),
    "faces: 2 columns": lambda: TriangleMesh(MESH.vertices, [[0, 1]]),
    "faces: no integers": lambda: TriangleMesh(MESH.vertices, [[0.5, 1, 2]]),
    "faces: none": lambda: TriangleMesh(MESH.vertices, np.zeros((0, 3), int)),
    "face 0: a vertex twice": lambda: TriangleMesh(MESH.vertices, [[1, 1, 2]]),
    "face 0: no such vertex": lambda: TriangleMesh(MESH.vertices, [[0, 1, 999]]),
    "lengths: negative": lambda: TriangleMesh(MESH.vertices, MESH.faces, lengths=-np.ones((MESH.n_faces, 3))),
    "laplacian: unknown": lambda: prepare_surface(MESH, laplacian="graph"),
    "n_pairs: 0": lambda: eigenpairs(MESH, 0),
    "accuracy: unknown": lambda: eigenpairs(MESH, 5, accuracy="best"),
    "n_energies: 1": lambda: wave_kernel_signature(np.arange(4.0), np.ones((3, 4)), 1),
    "values: other shape": lambda: wave_kernel_signature(np.arange(4.0), np.ones((3, 5)), 8),
    "functions: other shape": lambda: heat_kernel_signature(np.arange(4.0), np.ones((3, 5)), 8),
    "covariance_type: unknown": lambda: fit_mixture(SAMPLES, np.ones(12), 2, "round", 0),
    "components: too many": lambda: fit_mixture(SAMPLES, np.ones(12), 5, "diag"),
    "pose: none": lambda: model().fit([]),
    "meshes: one mesh": lambda: model().fit(MESH),
    "meshes: one described pose": lambda: model().fit(model().describe(MESH)),
    "meshes: a number": lambda: model().describe_all(3),
    "models: one model": lambda: rank(model(), []),
    "poses: one mesh": lambda: rank([model()], MESH),
    "pose: a list": lambda: model().fit([[1, 2, 3]]),
    "n_segments: 0": lambda: model(n_segments=0).fit([MESH]),
    "n_segments: more than vertices": lambda: model(n_segments=999, preset="paper").fit([MESH]),
    "n_segments: auto with the paper": lambda: model(n_segments="auto", preset="paper").fit([MESH]),
    "n_eigenpairs: a text": lambda: model(n_eigenpairs="many").fit([MESH]),
    "smoothness: too large": lambda: model(smoothness=1e9).fit([MESH]),
    "pieces: unknown": lambda: model(pieces="apart").fit([MESH]),
    "rest: other faces": lambda: model().fit([creature(subdivisions=2)], rest=icosphere(1)),
    "models: none": lambda: rank([], []),
}
"""What is named in the message, and a call that must raise it."""


@pytest.mark.parametrize("case", WRONG)
def test_the_argument_is_named(case):
    with pytest.raises((ValueError, TypeError)) as caught:
        WRONG[case]()
    assert case.partition(":")[0] in message_of(caught.value)


@pytest.mark.parametrize(
    ("case", "call"),
    {
        "min_share": lambda model, mesh: model.segment_faces(mesh, min_share=1.5),
        "segment": lambda model, mesh: model.with_segments(3),
        "eigenpairs": lambda model, mesh: model.predict(PoseSegmentation(2, n_eigenpairs=9).describe(mesh)),
        "polygons": lambda model, mesh: model.segment_polygons([mesh], []),
        "poses": lambda model, mesh: model.segment_polygons(mesh, [np.arange(mesh.n_faces)]),
    }.items(),
)
def test_so_it_is_with_a_fitted_model(fitted, case, call):
    with pytest.raises((ValueError, TypeError), match=case):
        call(fitted, creature(subdivisions=2))


def test_a_generator_is_as_good_as_a_list(fitted):
    mesh = creature(subdivisions=2)
    again = model(preset="paper").fit(pose for pose in [mesh])
    assert again.to_json() == fitted.to_json()
    assert len(model().describe_all(pose for pose in [mesh])) == 1


def test_results_do_not_depend_on_what_numpy_raises():
    """Other code of the process may have called `numpy.seterr`."""
    mesh, far = creature(subdivisions=2), icosphere(2)
    usual = model().fit([mesh])
    with np.errstate(all="raise"):
        raising = model().fit([mesh])
        labels = raising.segment_faces(far)
        best = rank([raising, usual], [[raising.describe(far)], [usual.describe(far)]]).best.index
    assert raising.to_json() == usual.to_json()
    assert np.array_equal(labels, usual.segment_faces(far))
    assert best == 0
