"""Materials of parts as colored copies of a material of the artist."""

import bpy
import numpy as np
import pytest
from builders import (
    labels_of,
)

from wks_segment.blender.outputs.part_materials import PART_PROPERTY
from wks_segment.blender.parts.part_style import Style

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment


@pytest.fixture
def template():
    """A material whose Base Color comes from an RGB node, with a rough surface."""
    material = bpy.data.materials.new("Rough")
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = True
    tree = material.node_tree
    shader, rgb = tree.nodes["Principled BSDF"], tree.nodes.new("ShaderNodeRGB")
    shader.inputs["Roughness"].default_value = 0.9
    tree.links.new(rgb.outputs[0], shader.inputs["Base Color"])
    return material


def rgb_of(material):
    """The color of a material's RGB node."""
    (node,) = (node for node in material.node_tree.nodes if node.type == "RGB")
    return tuple(node.outputs[0].default_value[:3])


def test_materials_are_colored_copies_of_the_template(obj, settings, template):
    before = {"materials": sorted(material.name for material in bpy.data.materials), "rgb": rgb_of(template)}
    settings.write_materials, settings.material_template = True, template
    OPS.learn()
    ours = [material for material in obj.data.materials if PART_PROPERTY in material]
    assert len(ours) == len(np.unique(labels_of(obj)))
    for material in ours:
        assert material.node_tree.nodes["Principled BSDF"].inputs["Roughness"].default_value == pytest.approx(0.9)
        linear = np.array(rgb_of(material))
        srgb = np.where(linear < 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
        np.testing.assert_allclose(srgb, Style().colors_of(np.array(material[PART_PROPERTY])), atol=1e-3)
    assert rgb_of(template) == before["rgb"]
    OPS.clear()
    assert sorted(material.name for material in bpy.data.materials) == before["materials"]
