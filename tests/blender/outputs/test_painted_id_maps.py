"""ID maps that the artist has painted on, or changed, are kept by Clear and by another bake."""

import bpy
import numpy as np
import pytest
from builders import limbed, select
from painted_objects import stripes

from wks_segment.blender.outputs.labels import write_labels

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment


@pytest.fixture
def image(settings):
    obj = limbed(subdivisions=2)
    write_labels(obj.data, stripes(obj.data))
    select(obj)
    settings.bake_size, settings.bake_unwrap = 64, True
    OPS.bake()
    return bpy.data.images["Limbed ID Map"]


def paint(image):
    image.pixels.foreach_set(np.full(64 * 64 * image.channels, 0.25, dtype=np.float32))
    image.update()


def paint_and_pack(image):
    paint(image)
    image.pack()


CHANGES = {
    "unsaved paint": paint,
    "packed paint": paint_and_pack,
    "color space": lambda image: setattr(image.colorspace_settings, "name", "sRGB"),
    "custom property": lambda image: image.__setitem__("export", 1),
}


@pytest.mark.parametrize("step", ["clear", "bake"])
@pytest.mark.parametrize("change", CHANGES)
def test_a_changed_image_stays(image, printed, change, step):
    CHANGES[change](image)
    before = np.array(image.pixels)
    printed()
    getattr(OPS, step)()
    assert 'The image "Limbed ID Map" has been changed since it was baked, and stays' in printed().out
    assert image == bpy.data.images["Limbed ID Map"]
    assert image.use_fake_user
    np.testing.assert_array_equal(np.array(image.pixels), before)
    assert len(bpy.data.images) == (1 if step == "clear" else 2)


@pytest.mark.parametrize("reopened", [False, True])
def test_an_image_as_baked_is_replaced_and_removed(image, tmp_path, reopened):
    OPS.bake()
    assert len(bpy.data.images) == 1
    if reopened:
        path = str(tmp_path / "baked.blend")
        bpy.ops.wm.save_as_mainfile(filepath=path)
        bpy.ops.wm.open_mainfile(filepath=path)
        select(bpy.data.objects["Limbed"])
    OPS.clear()
    assert not bpy.data.images
