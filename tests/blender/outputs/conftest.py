"""Fixtures of the outputs' tests."""

import bpy  # noqa: F401  # makes bmesh, which the builders import, available
import pytest
from builders import (
    limbed,
    limbed_rigged,
    select,
)
from painted_objects import painted, stripes

from wks_segment.blender.outputs.labels import write_labels


@pytest.fixture(params=["plain", "painted"])
def obj(request, settings):
    made = limbed()
    if request.param == "painted":
        painted(made)
    select(made)
    return made


@pytest.fixture
def labeled(obj):
    write_labels(obj.data, stripes(obj.data))
    return obj


@pytest.fixture
def rigged(settings):
    """A character on an armature, with a locked and an active group of the artist, learned from by frames."""
    obj = limbed_rigged()
    obj.vertex_groups["root"].lock_weight = True
    obj.vertex_groups.new(name="Mask").add(range(0, 600, 7), 0.25, "REPLACE")
    obj.vertex_groups.active_index = 1
    settings.source, settings.pose_count = "FRAMES", 3
    return obj
