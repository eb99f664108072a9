"""Labels carried from one triangulation of a surface to another."""

import numpy as np

from benchmarks.deformations import nearest_faces


def test_a_flipped_square_takes_the_labels_of_its_place():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0], [2, 1, 0]])
    faces = np.array([[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]])
    flipped = np.array([[1, 4, 2], [4, 5, 2], [0, 2, 3], [0, 1, 2]])
    square = np.array([0, 0, 1, 1])
    np.testing.assert_array_equal(square[nearest_faces(vertices, flipped, faces)], [1, 1, 0, 0])
    np.testing.assert_array_equal(nearest_faces(vertices, faces, faces), np.arange(4))
