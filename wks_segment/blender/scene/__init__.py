"""What is read from Blender: characters, poses, mesh arrays, files."""
