"""Triangle meshes: arrays, neighbors, repair, subdivision, islands, and the closed surface they become."""
