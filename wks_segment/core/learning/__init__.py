"""From described poses to segments: Gaussian mixtures, the merging of their components, the choice among candidates."""
