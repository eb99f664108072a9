import numpy as np
import pytest
from shapes import LIMBS, figure, icosphere

from wks_segment.core import PoseSegmentation, TriangleMesh
from wks_segment.core.labeling import labeler
from wks_segment.core.labeling.region_atlas import RegionAtlas
from wks_segment.core.labeling.sides import region_sides
from wks_segment.core.labeling.traits import Traits


def limb(name, subdivisions=4, radius=0.15):
    """Faces at the end of a limb: within an angle from its axis on the sphere that the figure is made from."""
    sphere = icosphere(subdivisions)
    axis = np.array(LIMBS[name][0]) / np.linalg.norm(LIMBS[name][0])
    return np.arccos(np.clip(sphere.vertices[sphere.faces].mean(axis=1) @ axis, -1, 1)) < radius


@pytest.fixture(scope="module")
def regions_at_rest(model):
    """Regions of the figure at rest."""
    return model.segment_regions(figure())


def number_of(numbers, faces):
    values, counts = np.unique(numbers[faces], return_counts=True)
    return int(values[counts.argmax()])


@pytest.fixture(scope="module")
def model():
    poses = [figure(0.0, 0.0), figure(0.5, 0.1), figure(-0.3, 0.6)]
    # Body with head, arms, legs in one piece each; with more segments their ends are segments of their own.
    return PoseSegmentation(4, n_eigenpairs=200, n_energies=100).fit(poses)


def test_left_and_right_are_two_regions_with_the_same_numbers_in_unseen_poses(model, regions_at_rest):
    for left, right in ((0.4, -0.4), (-0.5, 0.5), (0.0, 0.7)):
        mesh = figure(left, right)
        found = model.segment_regions(mesh)
        assert np.average(found == regions_at_rest, weights=mesh.face_areas) > 0.93
        for pair in (("left arm", "right arm"), ("left leg", "right leg")):
            numbers = [number_of(found, limb(one)) for one in pair]
            assert numbers == [number_of(regions_at_rest, limb(one)) for one in pair]
            assert numbers[0] != numbers[1]


def test_numbers_are_the_same_on_another_meshing_elsewhere_and_inside_out(model, regions_at_rest):
    fine = figure(0.3, -0.2, 5)
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    order = np.random.default_rng(0).permutation(fine.n_vertices)
    moved = TriangleMesh(3 * (fine.vertices @ turn)[order] + 5, np.argsort(order)[fine.faces][:, ::-1])
    found = model.segment_regions(moved)
    for one in ("left arm", "right arm", "left leg", "right leg", "head"):
        assert number_of(found, limb(one, 5)) == number_of(regions_at_rest, limb(one))


def test_mirrored_body_has_left_and_right_exchanged(model):
    regions_at_rest = model.segment_regions(figure(0.4, 0.0))
    mesh = figure(0.4, 0.0)
    mirrored = model.segment_regions(TriangleMesh(mesh.vertices * (-1, 1, 1), mesh.faces[:, ::-1]))
    assert number_of(mirrored, limb("left arm")) == number_of(regions_at_rest, limb("right arm"))
    assert number_of(mirrored, limb("right leg")) == number_of(regions_at_rest, limb("left leg"))


def test_left_is_in_the_direction_of_x(model, regions_at_rest):
    numbers, side = regions_at_rest, model.regions_.side
    for one in ("arm", "leg"):
        assert side[number_of(numbers, limb(f"left {one}"))] == 1
        assert side[number_of(numbers, limb(f"right {one}"))] == -1
    assert side[number_of(numbers, limb("head"))] == 0


def test_rest_pose_tells_left_from_right():
    poses = [figure(0.2, 0.1, 3), figure(0.5, 0.0, 3)]
    turned = [TriangleMesh(mesh.vertices * (-1, -1, 1), mesh.faces) for mesh in poses]
    fitted = PoseSegmentation(6, n_eigenpairs=100, n_energies=60).fit(turned, rest=figure(subdivisions=3))
    numbers = fitted.segment_regions(turned[0])
    assert fitted.regions_.side[number_of(numbers, limb("left arm", 3))] == 1
    with pytest.raises(ValueError, match="rest has other faces than the first pose"):
        PoseSegmentation(6, n_eigenpairs=100, n_energies=60).fit(turned, rest=figure(subdivisions=2))


def test_polygons_on_both_sides_have_a_side(model):
    mesh = figure(0.3, 0.1)
    polygon_of = np.arange(mesh.n_faces)
    labels = model.segment_polygons([mesh], [polygon_of])
    side = model.polygon_sides([mesh], [polygon_of], labels)
    for one in ("arm", "leg"):
        assert (side[limb(f"left {one}")] == 1).all()
        assert (side[limb(f"right {one}")] == -1).all()
    assert (side[limb("head")] == 0).all()


def test_poses_vote_on_the_sides_of_a_mesh(model, monkeypatch):
    mesh = figure(subdivisions=3)
    given = {0.0: [1, 1, 1, 0, -1, 1], 0.1: [1, 1, 0, 0, 1, 1], 0.2: [1, -1, 0, 0, -1, 0], 0.3: [1, 1, 0, 0, -1, 0]}
    poses = [TriangleMesh(mesh.vertices + (0, 0, height), mesh.faces) for height in given]
    votes = iter(given.values())
    monkeypatch.setattr(labeler, "sides_in_pose", lambda *arguments: np.array(next(votes)))
    found = model.polygon_sides(poses, [np.arange(mesh.n_faces) % 6] * 4, np.zeros(6, int))
    assert found.tolist() == [1, 1, 0, 0, -1, 0]


def test_some_of_many_poses_vote_on_sides(model):
    poses = [figure(0.3, 0.1 * i) for i in range(8)]
    polygons = [np.arange(poses[0].n_faces)] * 8
    labels, seen = model.segment_polygons(poses, polygons), []
    side = model.polygon_sides(poses, polygons, labels, seen.append)
    assert seen == sorted(seen)
    assert seen[-1] == pytest.approx(1.0)
    for one in ("arm", "leg"):
        assert (side[limb(f"left {one}")] == 1).all()
        assert (side[limb(f"right {one}")] == -1).all()


def test_poses_with_different_triangles_vote_together(model):
    """A polygon may be triangulated differently in each pose."""
    poses = [figure(0.3, 0.1), figure(0.0, 0.3)]
    order = np.random.default_rng(0).permutation(poses[1].n_faces)
    poses[1] = TriangleMesh(poses[1].vertices, poses[1].faces[order])
    polygons = [np.arange(len(order)), order]
    labels = model.segment_polygons(poses, polygons)
    side = model.polygon_sides(poses, polygons, labels)
    for one in ("arm", "leg"):
        assert (side[limb(f"left {one}")] == 1).all()
        assert (side[limb(f"right {one}")] == -1).all()


def test_polygons_must_fit_the_poses(model):
    mesh = figure(subdivisions=3)
    with pytest.raises(ValueError, match="there are 1 poses, but polygons for 0"):
        model.polygon_sides([mesh], [], np.zeros(6, int))


def test_region_in_the_middle_has_no_side_in_bent_poses(model):
    """The tail has about the size and the segment of a foot, and is nearer to one foot than to the other."""
    for left, right in ((0.5, -0.3), (-0.3, 0.5), (0.0, 0.6)):
        mesh = figure(left, right)
        ends = {"left leg": limb("left leg"), "right leg": limb("right leg"), "tail": limb("tail", radius=0.22)}
        labels = np.any(list(ends.values()), axis=0).astype(int)
        side = model.polygon_sides([mesh], [np.arange(mesh.n_faces)], labels)
        found = {one: np.unique(side[faces]).tolist() for one, faces in ends.items()}
        assert found == {"left leg": [1], "right leg": [-1], "tail": [0]}


def test_saved_model_gives_the_same_names(model, tmp_path):
    model.save(tmp_path / "model.json")
    mesh = figure(0.1, 0.5)
    np.testing.assert_array_equal(
        PoseSegmentation.load(tmp_path / "model.json").segment_regions(mesh), model.segment_regions(mesh)
    )


def test_new_regions_have_higher_numbers_than_learned_ones(model):
    mesh = figure()
    known = len(model.regions_.side)
    regions = model.segment_regions(mesh, min_share=0.0)
    areas = np.bincount(regions, weights=mesh.face_areas)
    assert areas[:known].sum() > 0.9 * mesh.area
    assert (areas[known:] > 0).all()


def test_side_needs_a_counterpart_of_the_same_segment():
    centers = np.array([(1, 0, 0), (-1, 0.1, 0), (0.01, 0, 1), (0.9, 0, -2), (-0.9, 0, -2), (2, 0, 3)])
    none = np.arange(6)
    assert region_sides(centers, np.array([0, 0, 1, 2, 2, 3]), none).tolist() == [1, -1, 0, 1, -1, 0]
    assert region_sides(centers, np.array([0, 1, 1, 2, 2, 3]), none).tolist() == [0, 0, 0, 1, -1, 0]


def test_sides_of_a_bent_pose_follow_from_its_mirror_image():
    """Mirroring brings none of the four limbs close to its counterpart, because they have swung back and forth."""
    centers = np.array([(0.5, 1, 0), (-0.1, 0, 0), (0.4, -2, 0), (-0.2, -1, 0), (0.0, 9, 0)])
    segment = np.zeros(5, dtype=int)
    assert region_sides(centers, segment, np.arange(5)).tolist() != [1, -1, 1, -1, 0]
    assert region_sides(centers, segment, np.array([1, 0, 3, 2, 5])).tolist() == [1, -1, 1, -1, 0]


def test_sides_are_learned_from_bent_poses_alone():
    poses = [figure(0.7, -0.2, 3), figure(0.2, 0.4, 3)]
    model = PoseSegmentation(6, n_eigenpairs=100, n_energies=60).fit(poses)
    regions = model.segment_regions(poses[0])
    for limbs, side in (("left arm", "left leg"), 1), (("right arm", "right leg"), -1):
        assert {int(model.regions_.side[number_of(regions, limb(one, 3))]) for one in limbs} == {side}


def test_regions_of_one_mesh_are_matched_by_their_order(model):
    """In the second pose the traits of left and right are exchanged."""
    known = model.regions_.traits
    order = np.arange(len(known.segment))
    left = int(np.argmax(model.regions_.side == 1))
    right = int(np.argmax((known.segment == known.segment[left]) & (model.regions_.side == -1)))
    order[[left, right]] = right, left
    swapped = Traits(
        known.segment, known.area[order], known.signature[order], known.handedness[order],
        known.distance[np.ix_(order, order)],
    )  # fmt: skip
    assert np.abs(known.handedness[left] - known.handedness[right]).max() > 0.01
    centers = np.zeros((len(order), 3))
    found = RegionAtlas.learned(model.regions_.n_groups, [known, swapped], centers)
    np.testing.assert_allclose(found.traits.handedness, known.handedness)
    in_order = RegionAtlas.learned(model.regions_.n_groups, [known, swapped], centers, alike=True)
    np.testing.assert_allclose(in_order.traits.handedness, (known.handedness + swapped.handedness) / 2)
