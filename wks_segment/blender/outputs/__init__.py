"""What is written to meshes, and taken back: labels, colors, materials, groups, images."""
