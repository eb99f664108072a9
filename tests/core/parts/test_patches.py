import numpy as np
import pytest
from shapes import creature, figure, grid, icosphere, shaken, together

from wks_segment.core import TriangleMesh
from wks_segment.core.mesh.adjacency import FaceAdjacency, connected_regions
from wks_segment.core.mesh.mirror import mirrored_faces
from wks_segment.core.parts.patches import N_PATCHES, SINGLE_FACES, patches_of


def adjacency_of(mesh):
    return FaceAdjacency.of(mesh.faces, mesh.vertices / np.sqrt(mesh.area))


def patches(mesh, curvature=None, image=None):
    adjacency = adjacency_of(mesh)
    curvature = np.zeros(len(adjacency.pairs)) if curvature is None else curvature
    return patches_of(mesh.unit_face_centers, mesh.face_areas / mesh.area, adjacency, curvature, image)


def reordered(mesh, seed):
    order = np.random.default_rng(seed).permutation(mesh.n_faces)
    return TriangleMesh(mesh.vertices, mesh.faces[order]), order


def number_of_pairs(first, second):
    return len(np.unique(np.stack([first, second], axis=1), axis=0))


def test_faces_of_a_small_mesh_are_patches_of_their_own():
    mesh = icosphere(2)
    assert mesh.n_faces <= SINGLE_FACES
    np.testing.assert_array_equal(patches(mesh), np.arange(mesh.n_faces))


def test_a_larger_mesh_has_a_few_hundred_connected_patches_of_similar_size():
    mesh = shaken(icosphere(4))
    patch = patches(mesh)
    assert set(patch) == set(range(patch.max() + 1))
    assert N_PATCHES <= patch.max() + 1 <= N_PATCHES + 2
    assert len(np.unique(connected_regions(patch, adjacency_of(mesh)))) == patch.max() + 1
    assert np.bincount(patch, mesh.face_areas).max() < 5 * mesh.area / N_PATCHES


def test_no_patch_lies_on_two_islands_and_each_island_has_one():
    balls = [TriangleMesh(size * icosphere(2).vertices + (5 * i, 0, 0), icosphere(2).faces)
             for i, size in enumerate((1, 1, 0.5, 0.01))]  # fmt: skip
    mesh = together(*balls)
    island = np.repeat(np.arange(4), icosphere(2).n_faces)
    patch = patches(mesh)
    assert number_of_pairs(patch, island) == patch.max() + 1
    assert set(island[np.unique(patch, return_index=True)[1]]) == {0, 1, 2, 3}


def test_patches_end_at_a_crease():
    mesh = grid(40, 40)
    adjacency = adjacency_of(mesh)
    # A crease that no row of patches would follow by itself.
    right = mesh.face_centers[:, 0] + 0.3 * mesh.face_centers[:, 1] > 0.62
    crease = right[adjacency.pairs[:, 0]] != right[adjacency.pairs[:, 1]]

    def share_of_crease(curvature):
        patch = patches(mesh, curvature)
        return (patch[adjacency.pairs[crease, 0]] != patch[adjacency.pairs[crease, 1]]).mean()

    sharp, flat = share_of_crease(np.where(crease, -15.0, 0)), share_of_crease(None)
    assert sharp > 0.85
    assert sharp > flat + 0.15
    # Convex edges do not hold patches up.
    assert share_of_crease(np.where(crease, 15.0, 0)) == flat


@pytest.mark.parametrize("seed", [None, 0, 1, 2])
def test_patches_of_a_symmetric_mesh_are_mirror_images(seed):
    mesh = figure(subdivisions=3)
    mesh = mesh if seed is None else reordered(mesh, seed)[0]
    image = mirrored_faces(mesh)
    assert mesh.n_faces > SINGLE_FACES
    patch = patches(mesh, image=image)
    # A face that is its own mirror image, in the middle, belongs to either side.
    paired = image != np.arange(mesh.n_faces)
    assert number_of_pairs(patch[paired], patch[image[paired]]) == len(np.unique(patch[paired]))


def test_faces_without_a_mirror_image_have_patches_too():
    mesh = creature(0.0, 3)
    image = mirrored_faces(mesh)
    image = np.full(mesh.n_faces, -1) if image is None else image.copy()
    without = mesh.face_centers[:, 2] > 0.5
    image[without] = -1
    image[np.isin(image, np.flatnonzero(without))] = -1
    patch = patches(mesh, image=image)
    assert patch.min() == 0
    assert N_PATCHES <= patch.max() + 1 <= N_PATCHES + 3


@pytest.mark.parametrize("seed", range(3))
def test_patches_do_not_depend_on_the_order_of_faces(seed):
    mesh = shaken(creature(0.3, 4))
    other, order = reordered(mesh, seed)
    patch, again = patches(mesh)[order], patches(other)
    assert number_of_pairs(patch, again) == patch.max() + 1 == again.max() + 1
