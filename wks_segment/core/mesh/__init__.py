"""Triangle meshes: neighbors, repair, subdivision, islands, and the surface on which eigenpairs are computed."""
