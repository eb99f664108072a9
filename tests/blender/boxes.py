"""Boxes, and a way to read any objects as one pose."""

import bpy
import numpy as np
from builders import (
    mesh_object,
)

from wks_segment.blender.scene import poses as reader
from wks_segment.blender.scene.characters import Character

CUBE = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]


def box(low=-1.0, high=1.0, name="Box"):
    return mesh_object(low + (high - low) * (CUBE + 1) / 2, QUADS, name)


def read(*objects):
    bpy.context.view_layer.update()
    return reader.read_pose(bpy.context, Character(objects), "a pose")
