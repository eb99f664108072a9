import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from shapes import creature, figure, icosphere, together

from wks_segment.core import TriangleMesh, prepare_surface
from wks_segment.core.geometry.heat_flow import Flows
from wks_segment.core.parts.body_places import COORDINATES, TURNS, BodyPlaces

OUTWARD, TO_TIP, BASE = 1, 2, 3
"""Columns of the coordinates along limbs."""


def places_of(mesh):
    surface = prepare_surface(mesh)
    return BodyPlaces.of(surface, Flows(surface.mesh))


def turned(mesh, seed=0):
    return TriangleMesh(mesh.vertices @ Rotation.random(random_state=seed).as_matrix().T + (1, 2, 3), mesh.faces)


@pytest.fixture(scope="module")
def places():
    return places_of(figure())


def test_a_body_that_bends_to_one_side_has_no_places():
    assert places_of(creature(0.0)) is not None
    assert places_of(creature(0.8)) is None


def test_places_are_on_both_sides_of_the_mirror_plane(places):
    x = figure().face_centers[:, 0]
    beside = places.beside[places.patch]
    assert np.corrcoef(np.abs(x), beside)[0, 1] > 0.97
    assert np.average(beside**2, weights=figure().face_areas) == pytest.approx(1.0, abs=0.1)


def test_limbs_end_at_their_tips_and_begin_outside_the_middle(places):
    mesh = figure()
    tip = places.patch[np.abs(mesh.face_centers[:, 0]).argmax()]
    assert places.limbs[tip, TO_TIP] < 0.1
    assert places.limbs[tip, BASE] > 0.2
    assert (places.limbs[:, TO_TIP] >= 0).all()
    middle = places.limbs[:, OUTWARD].argmin()
    assert places.limbs[middle, BASE] == 0


def test_places_stay_when_the_body_is_turned_and_moved(places):
    other = places_of(turned(figure()))
    for name in ("beside", "in_plane", "limbs"):
        first, second = (getattr(one, name)[one.patch] for one in (places, other))
        # Of two equally near patches either may be the neighbor.
        assert np.median(np.abs(first - second)) < 0.01


def test_every_direction_in_the_mirror_plane_is_a_turn(places):
    turns = np.array([places.turned(turn) for turn in range(TURNS)])
    assert turns.shape == (TURNS, len(places.areas), COORDINATES)
    assert len({turn.tobytes() for turn in np.round(turns, 6)}) == TURNS
    lengths = np.linalg.norm(turns[:, :, 1:3], axis=2)
    np.testing.assert_allclose(lengths, np.tile(lengths[0], (TURNS, 1)), atol=1e-9)


def test_a_limb_that_is_an_island_is_as_far_out_as_its_mirror_image():
    """Three balls in a row and a fourth beside one of them would be tied on one side only."""
    ball = icosphere(3)
    row = together(*(TriangleMesh(ball.vertices * 0.9 + (2.0 * i, 0.3 * abs(i), 0), ball.faces) for i in (-1, 0, 1)))
    places = places_of(row)
    x = row.face_centers[:, 0]
    far = places.limbs[places.patch, OUTWARD]
    assert np.average(far[x > 1]) == pytest.approx(np.average(far[x < -1]), rel=0.03)


def test_areas_of_labels_are_shares_of_the_whole(places):
    mesh = figure()
    labels = np.where(mesh.face_centers[:, 0] > 0, 0, -1)
    table = places.areas_of(labels, mesh.face_areas, 2)
    assert table.sum() == pytest.approx(0.5, abs=0.02)
    assert not table[:, 1].any()
