import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from shapes import figure

from wks_segment.core import TriangleMesh, prepare_surface
from wks_segment.core.files.checked_json import DamagedError
from wks_segment.core.geometry.heat_flow import Flows
from wks_segment.core.learning.body_plan import BodyPlan
from wks_segment.core.parts.body_places import BodyPlaces

FIGURE = figure()
LIMB, TOP, TRUNK = range(3)


def labels_of(mesh):
    """(m,) part of each face of a figure at rest: its limbs, the top of its body, and all else."""
    x, _, z = mesh.face_centers.T
    return np.where(np.abs(x) > 0.6 * np.abs(x).max(), LIMB, np.where(z > 0.5, TOP, TRUNK))


LABELS = labels_of(FIGURE)


def body(mesh, labels=LABELS):
    surface = prepare_surface(mesh)
    places = BodyPlaces.of(surface, Flows(surface.mesh))
    return places, places.areas_of(labels, mesh.face_areas, 3)


def styled(mesh, seed):
    """The figure with other proportions, turned in any direction."""
    generator = np.random.default_rng(seed)
    vertices = mesh.vertices * generator.uniform(0.8, 1.25, 3)
    return TriangleMesh(vertices @ Rotation.random(random_state=seed).as_matrix().T, mesh.faces)


@pytest.fixture(scope="module")
def bodies():
    return [body(styled(FIGURE, seed)) for seed in range(3)]


@pytest.fixture(scope="module")
def plan(bodies):
    return BodyPlan.learned(bodies)


def test_parts_of_a_body_of_other_proportions_are_found_in_any_direction(plan):
    places, table = body(styled(FIGURE, 7))
    posteriors = plan.posteriors(places)
    np.testing.assert_allclose(posteriors.sum(axis=1), 1.0)
    right = table[np.arange(len(table)), posteriors.argmax(axis=1)].sum()
    assert right / table.sum() > 0.85


def test_what_the_plan_finds_is_the_same_however_the_body_lies(plan):
    first, second = (body(TriangleMesh(FIGURE.vertices @ turn, FIGURE.faces))[0] for turn in
                     (np.eye(3), Rotation.from_euler("xyz", (1, 2, 3)).as_matrix()))  # fmt: skip
    labels = [plan.posteriors(places).argmax(axis=1)[places.patch] for places in (first, second)]
    assert np.average(labels[0] == labels[1], weights=FIGURE.face_areas) > 0.97


def test_a_part_that_no_body_shows_has_no_plan(bodies):
    without = [(places, table * (1, 1, 0)) for places, table in bodies]
    assert BodyPlan.learned(without) is None
    assert BodyPlan.learned([]) is None


def test_few_bodies_say_too_little_of_how_bodies_differ(bodies):
    assert BodyPlan.learned(bodies[:2]) is None


def test_arrays_are_read_back_and_checked(plan):
    arrays = plan.arrays()
    read = BodyPlan.of_arrays(arrays)
    assert read.arrays().keys() == arrays.keys()
    for name, array in read.arrays().items():
        np.testing.assert_array_equal(array, arrays[name])
    assert BodyPlan.of_arrays({}) is None
    with pytest.raises(DamagedError, match="plan_covariances"):
        BodyPlan.of_arrays(arrays | {"plan_covariances": -arrays["plan_covariances"]})
