"""`PoseSegmentation.fit` with labels: parts that are taught, and found again with their numbers."""

import json
from copy import copy

import numpy as np
import pytest
from shapes import creature, figure

from wks_segment.core import ModelFileError, PoseSegmentation, TriangleMesh
from wks_segment.core.user_labels import UnlikePartsError

SMALL = {"n_eigenpairs": 80, "n_energies": 40}
BENDS = (0.0, 0.5)
BODY, LONG, THIN, LEFT, RIGHT = range(5)
"""Parts of the creature: the ball, its limbs along x and z, and the two short limbs that mirror each other."""


def parts_of(mesh):
    """(m,) part of each face of a creature at rest; left is the short limb at +y."""
    x, y, z = mesh.face_centers.T
    part = np.full(mesh.n_faces, BODY)
    part[x > 1.3] = LONG
    part[z > 1.2] = THIN
    part[(y > 0.9) & (x < 0.2)] = LEFT
    part[(y < -0.9) & (x < 0.2)] = RIGHT
    return part


REST = creature()
PARTS = parts_of(REST)
SIDELESS = np.where(PARTS == RIGHT, LEFT, PARTS)
POSES = [creature(bend) for bend in BENDS]


def share_right(mesh, found, part):
    return float(np.average(found == part, weights=mesh.face_areas))


@pytest.fixture(scope="module")
def described():
    return PoseSegmentation(**SMALL).describe_all(POSES)


@pytest.fixture(scope="module")
def model(described):
    return PoseSegmentation(**SMALL).fit(described, labels=[SIDELESS] * 2)


def test_parts_keep_their_numbers_in_unseen_poses(model):
    pose = creature(0.3)
    found = model.segment_faces(pose)
    assert share_right(pose, found, SIDELESS) > 0.95
    assert model.n_segments_ == 4
    assert set(np.unique(found)) == {BODY, LONG, THIN, LEFT}


def test_vertices_and_posteriors_have_the_same_numbers(model):
    pose = model.describe(creature(0.3))
    posteriors = model.predict_proba(pose)
    assert posteriors.shape == (REST.n_vertices, 4)
    np.testing.assert_allclose(posteriors.sum(axis=1), 1.0, atol=1e-5)
    np.testing.assert_array_equal(model.predict(pose), posteriors.argmax(axis=1))
    tip = int(REST.vertices[:, 0].argmax())
    assert model.predict(pose)[tip] == LONG


def test_what_is_taught_as_left_and_right_comes_out_as_two(described):
    model = PoseSegmentation(**SMALL).fit([figure(), figure(0.3, 0.2)], labels=[sides_of(figure())] * 2)
    assert model.taught_.sided.tolist() == [0]
    assert model.n_segments_ == model.taught_.n_parts
    pose = figure(0.1, 0.5)
    found = model.segment_faces(pose)
    assert share_right(pose, found, sides_of(figure())) > 0.93


def sides_of(mesh):
    """(m,) part of each face of a figure at rest: 0 left limbs, 1 right limbs, 2 all else."""
    x = mesh.face_centers[:, 0]
    far = np.abs(x) > 0.6 * np.abs(x).max()
    return np.where(far, np.where(x > 0, 0, 1), 2)


def test_a_few_strokes_on_one_mesh_are_enough(described):
    said = np.full(REST.n_faces, -1)
    for part in range(4):
        inside = np.flatnonzero(part == SIDELESS)
        middle = np.median(REST.face_centers[inside[PARTS[inside] == part]], axis=0)
        near = np.argsort(np.linalg.norm(REST.face_centers[inside] - middle, axis=1))
        said[inside[near[: max(3, round(0.03 * len(inside)))]]] = part
    assert 0.01 < (said >= 0).mean() < 0.05
    model = PoseSegmentation(**SMALL).fit(described, labels=[said, None], unlabeled="ignore")
    pose = creature(0.3)
    assert model.n_segments_ == 4
    assert share_right(pose, model.segment_faces(pose), SIDELESS) > 0.75


def test_what_is_not_said_is_cut_as_usual_and_numbered_after_the_taught_parts(described):
    said = np.where(PARTS == LONG, 0, -1)
    model = PoseSegmentation(n_segments=3, **SMALL).fit(described, labels=[said] * 2)
    assert model.n_segments_ == 3
    found = model.segment_faces(described[0])
    assert set(np.unique(found)) == {0, 1, 2}
    assert np.average(found[PARTS == LONG] == 0, weights=REST.face_areas[PARTS == LONG]) > 0.95
    assert np.average(found[PARTS == BODY] != 0, weights=REST.face_areas[PARTS == BODY]) > 0.9
    more = model.with_segments(4)
    assert more.n_segments_ == 4
    assert ((more.segment_faces(described[0]) == 0) == (found == 0)).mean() > 0.98


def test_a_saved_model_labels_as_before(model, described, tmp_path):
    model.save(tmp_path / "taught.json")
    loaded = PoseSegmentation.load(tmp_path / "taught.json")
    assert loaded.taught_.n_parts == 4
    np.testing.assert_array_equal(loaded.segment_faces(described[1]), model.segment_faces(described[1]))
    assert loaded.to_json() == model.to_json()


def test_regions_are_the_same_in_every_pose(model, described):
    regions = [model.segment_regions(pose) for pose in described]
    assert np.average(regions[0] == regions[1], weights=REST.face_areas) > 0.95


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda content: content["taught_left"].append(9), "taught_right has the shape"),
        (lambda content: content.update(taught_right=[0, 1, 2, 0]), "not those that were saved"),
        (lambda content: (content.pop("digest"), content.update(taught_right=[0, 1, 2, 0])), "each part once"),
        (lambda content: content.update(taught_left=[0, 1, 2, -1]), "taught_left"),
        (lambda content: content.update(taught_of_bodies=2), "taught_of_bodies"),
        (lambda content: content.update(taught_of_bodies=1), "not those that were saved"),
    ],
)
def test_damaged_fields_of_taught_parts_are_refused(model, change, message):
    content = json.loads(model.to_json())
    change(content)
    with pytest.raises(ModelFileError, match=message):
        PoseSegmentation.from_json(json.dumps(content))


def test_a_fit_without_labels_knows_no_taught_parts(described):
    model = PoseSegmentation(n_segments=3, **SMALL).fit(described)
    assert model.taught_ is None
    assert json.loads(model.to_json())["version"] == 5


@pytest.mark.parametrize(
    ("labels", "message"),
    [
        ([PARTS], "2 meshes, but labels for 1"),
        ([PARTS, PARTS[:-1]], r"mesh 2 has [\d,]+ faces, but labels of shape"),
        ([None, None], "say no part"),
        ([np.where(PARTS == LONG, 9, PARTS), None], "no face has part 1"),
        ([np.where(np.arange(len(PARTS)) < 2, 5, PARTS), None], "part 5 has 2 faces"),
        ([PARTS - 5, None], "whole numbers"),
        ([PARTS + 0.5, None], "whole numbers"),
        ([np.full(len(PARTS), np.nan), None], "whole numbers"),
        ([PARTS.astype(str), None], "whole numbers"),
    ],
)
def test_labels_that_do_not_fit_are_refused(described, labels, message):
    with pytest.raises(ValueError, match=message):
        PoseSegmentation(**SMALL).fit(described, labels=labels)


def test_unlabeled_has_two_values(described):
    with pytest.raises(ValueError, match="unlabeled must be"):
        PoseSegmentation(**SMALL).fit(described, labels=[PARTS, None], unlabeled="guess")


def test_the_papers_setting_cannot_be_taught(described):
    with pytest.raises(ValueError, match="default"):
        PoseSegmentation(preset="paper", **SMALL).fit(described, labels=[PARTS, None])


def test_two_parts_that_nothing_tells_apart_are_named(described):
    # Checkered halves of one limb: neither shape nor side divides them.
    checkered = np.where(SIDELESS == LONG, np.where(np.arange(REST.n_faces) % 2, LONG, 4), SIDELESS)
    with pytest.raises(UnlikePartsError, match="parts 1 and 4 cannot be told apart") as caught:
        PoseSegmentation(**SMALL).fit(described, labels=[checkered] * 2)
    assert caught.value.parts == (1, 4)


def test_a_fit_that_fails_leaves_the_model_as_it_was(model, described):
    before = model.to_json()
    with pytest.raises(ValueError, match="say no part"):
        model.fit(described, labels=[None, None])
    assert model.to_json() == before


def styled(scale, ridges=0.0):
    """A figure at rest with other proportions, and with ridges across its body and limbs."""
    mesh = figure()
    x, _, z = mesh.vertices.T
    out = 1 + ridges * np.sin(12 * np.abs(x)) * np.sin(12 * z)
    return TriangleMesh(mesh.vertices * scale * out[:, None], mesh.faces)


ARMS_AND_LEGS = np.where(np.abs(figure().face_centers[:, 0]) < 0.6, 2, np.where(figure().face_centers[:, 2] > 0, 0, 1))
"""Part of each face of a figure: 0 arms, 1 legs, 2 the body between them."""


@pytest.fixture(scope="module")
def of_bodies():
    bodies = [styled((1, 1, 1)), styled((1.2, 1, 0.9)), styled((0.9, 1.2, 1))]
    return PoseSegmentation(**SMALL).fit(bodies, labels=[ARMS_AND_LEGS] * 3)


def test_bodies_at_rest_teach_where_parts_lie_and_the_file_keeps_it(of_bodies):
    assert json.loads(of_bodies.to_json())["version"] == 7
    read = PoseSegmentation.from_json(of_bodies.to_json())
    other = of_bodies.describe(styled((1, 1, 1.6), 0.15))
    np.testing.assert_array_equal(read.segment_faces(other), of_bodies.segment_faces(other))


def test_poses_of_one_mesh_and_parts_beside_others_have_no_plan(model):
    assert model.plan_ is None
    assert json.loads(model.to_json())["version"] == 6


def test_the_plan_finds_parts_where_signatures_do_not(of_bodies):
    other = styled((1, 1, 1.6), 0.15)
    pose = of_bodies.describe(other)
    by_signatures = copy(of_bodies)
    by_signatures.plan_ = None
    alone = share_right(other, by_signatures.segment_faces(pose), ARMS_AND_LEGS)
    assert share_right(other, of_bodies.segment_faces(pose), ARMS_AND_LEGS) > alone + 0.2
