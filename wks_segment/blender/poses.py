"""How poses are read, for scripts."""

from .scene.poses import Pose, own_frames, read_frames, read_markers, read_objects, read_pose, read_shape_keys

__all__ = ["Pose", "own_frames", "read_frames", "read_markers", "read_objects", "read_pose", "read_shape_keys"]
