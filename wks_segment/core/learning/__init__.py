"""Learning of segments from described poses: Gaussian mixtures, their choice, and the merging of components."""
