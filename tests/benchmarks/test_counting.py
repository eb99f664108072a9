"""Counts of operations by stage: exact, the same again, and gone when counting has ended."""

import sys

import numpy as np
import pytest
import scipy.sparse
from scipy.spatial import cKDTree
from shapes import creature

from benchmarks.counting import OUTSIDE, PYTHON_CALLS, Counter, Operation
from wks_segment.core import PoseSegmentation
from wks_segment.core.mesh import adjacency
from wks_segment.core.spectral import dense_eigen, multifrontal
from wks_segment.core.spectral.laplacian import stiffness_matrix


@pytest.fixture(scope="module")
def mesh():
    return creature(subdivisions=2)


def learned(mesh):
    with Counter() as counter:
        model = PoseSegmentation(n_segments=3, n_eigenpairs=30)
        with counter.stage("signature"):
            pose = model.describe(mesh)
        with counter.stage("mixture"):
            model.fit([pose])
    return counter.counts


def test_counts_are_by_stage_and_the_same_again(mesh):
    counts, again = learned(mesh), learned(mesh)
    assert counts["signature"]["Laplacians"] == 1
    assert counts["signature"]["surfaces: faces"] == mesh.n_faces
    assert "k-means rounds" not in counts["signature"]
    assert counts["mixture"]["k-means rounds"] > 0
    for stage in ("signature", "mixture"):
        # What is done once a process, such as looking up a function of LAPACK, is a few calls.
        assert 100 < again[stage].pop(PYTHON_CALLS) <= counts[stage].pop(PYTHON_CALLS)
    assert again == counts


def test_size_of_a_call_is_counted(mesh):
    with Counter() as counter:
        adjacency.cKDTree(mesh.vertices).query(mesh.vertices[:7])
        dense_eigen.solve_triangular(np.eye(5), np.ones((5, 2)), lower=True)
        multifrontal.MultifrontalFactor(stiffness_matrix(mesh) + scipy.sparse.identity(mesh.n_vertices), mesh.vertices)
    found = counter.counts[OUTSIDE]
    assert found["kd-trees: points"] == mesh.n_vertices
    assert found["kd-tree queries: points"] == 7
    assert found["triangular solves: n² k"] == 50
    assert found["factorizations: unknowns"] == mesh.n_vertices


def test_a_stage_inside_of_another_counts_by_itself(mesh):
    with Counter() as counter, counter.stage("outer"):
        with counter.stage("inner"):
            dense_eigen.eigh(np.eye(3))
        dense_eigen.eigh(np.eye(2))
    assert counter.counts["outer"]["dense eigenproblems (SciPy): n³"] == 8
    assert counter.counts["inner"]["dense eigenproblems (SciPy): n³"] == 27


def test_all_is_as_before_when_counting_has_ended():
    names = ("cKDTree",), ("eigh", "solve_triangular"), ("MultifrontalFactor",)
    modules = adjacency, dense_eigen, multifrontal
    before = [getattr(module, name) for module, of_module in zip(modules, names, strict=True) for name in of_module]
    solve, profile = multifrontal.MultifrontalFactor.solve, sys.getprofile()
    with pytest.raises(ValueError, match="could not convert"), Counter():
        adjacency.cKDTree("no points")
    with Counter():
        assert adjacency.cKDTree is not cKDTree
        assert multifrontal.MultifrontalFactor.solve is not solve
    after = [getattr(module, name) for module, of_module in zip(modules, names, strict=True) for name in of_module]
    assert all(one is other for one, other in zip(before, after, strict=True))
    assert multifrontal.MultifrontalFactor.solve is solve
    assert sys.getprofile() is profile


def test_an_operation_that_is_gone_is_an_error():
    gone = Operation("gone", "wks_segment.core.spectral.laplacian", "no_such_function", "things", lambda: 0)
    with pytest.raises(AttributeError, match="no_such_function"), Counter([gone]):
        pass
