"""Fixtures of the operators' tests."""

import bpy
import pytest
from builders import limbed_poses, select


@pytest.fixture
def learned(settings):
    """Three objects in three poses, learned from and labeled."""
    poses = limbed_poses(0.0, 0.3, 0.6)
    select(*poses)
    assert bpy.ops.wks_segment.learn() == {"FINISHED"}
    return poses
