"""Islands are tied together in the same way in every pose, so that they share one spectrum."""

import numpy as np
import pytest
from shapes import icosphere, together

from wks_segment.core import PoseSegmentation, TriangleMesh, connect, prepare_surface


def ball(x, y=0.0, z=0.0, size=1.0, subdivisions=3):
    sphere = icosphere(subdivisions)
    return TriangleMesh(size * sphere.vertices + (x, y, z), sphere.faces)


def tied_islands(connection, faces):
    """Pairs of islands that are tied."""
    island = TriangleMesh(np.random.default_rng(0).random((faces.max() + 1, 3)), faces).islands
    return {tuple(sorted(pair)) for pair in island[connection.ties].tolist()}


def test_a_row_of_balls_is_tied_into_a_chain():
    row = together(*(ball(2.1 * i) for i in (0, 2, 1, 3)))
    assert tied_islands(connect(row), row.faces) == {(0, 2), (1, 2), (1, 3)}
    assert prepare_surface(row).n_islands == 1
    assert prepare_surface(row, pieces="separate").n_islands == 4


def test_islands_are_tied_where_they_stay_near_and_not_where_they_meet_in_one_pose():
    # In one pose, the last ball of the chain touches the first.
    poses = [
        together(ball(0), ball(2.1), ball(4.2), ball(*last)) for last in ((6.3, 0, 0), (4.2, 2.1, 0), (2.1, 2.0, 0))
    ]
    assert tied_islands(connect(*poses), poses[0].faces) == {(0, 1), (1, 2), (2, 3)}
    assert tied_islands(connect(poses[2]), poses[0].faces) != {(0, 1), (1, 2), (2, 3)}


def test_the_rest_position_decides_the_ties_if_it_is_given():
    rest, bent = (together(ball(0), ball(2.1), ball(*last)) for last in ((4.2, 0, 0), (0, 2.05, 0)))
    ties = connect(bent, rest=rest).ties
    np.testing.assert_array_equal(ties, connect(rest).ties)
    assert tied_islands(connect(bent, rest=rest), rest.faces) == {(0, 1), (1, 2)}


def test_equal_islands_in_different_places_get_different_labels_if_joined():
    # Two balls of the same size, one at the end of a long body, one at its side.
    def figure(bend):
        body = icosphere(3)
        long = TriangleMesh(body.vertices * (6, 1, 1), body.faces)
        return together(long, ball(6.5, bend, 0, 0.5), ball(0, 0, 1.5, 0.5))

    poses = [figure(bend) for bend in (-0.1, 0.1)]
    n = poses[0].n_vertices - 2 * ball(0).n_vertices
    labels = {}
    for pieces in ("joined", "separate"):
        model = PoseSegmentation(6, n_eigenpairs=60, n_energies=40, pieces=pieces).fit(poses)
        at_end, at_side = np.split(model.predict(figure(0.0))[n:], 2)
        labels[pieces] = (at_end == at_side).mean()
    assert labels["separate"] == pytest.approx(1, abs=0.1)
    assert labels["joined"] < 0.5


def test_hundreds_of_distant_islands_are_tied():
    generator = np.random.default_rng(0)
    mesh = together(*(ball(*generator.uniform(0, 200, 3), 0.5, 2) for _ in range(300)))
    connection = connect(mesh)
    assert prepare_surface(mesh, connection=connection).n_islands == 1
    assert len(tied_islands(connection, mesh.faces)) == 299
