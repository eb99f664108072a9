"""A material of a segment that the artist has changed, renamed or uses elsewhere is never overwritten or removed."""

import bpy
import pytest
from builders import limbed, select
from height_bands import write
from painted_objects import painted, stripes

from wks_segment.blender.outputs.labels import write_labels
from wks_segment.blender.outputs.options import OutputOptions

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment
NAME = "Segment 2"


@pytest.fixture
def obj(settings):
    settings.write_materials = True
    obj = painted(limbed(subdivisions=3))
    select(obj)
    OPS.learn()
    return obj


def shader(material):
    return next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")


def new_node(material):
    material.node_tree.nodes.new("ShaderNodeTexNoise")


def elsewhere(material):
    other = limbed("Other")
    other.data.materials.append(material)


WORK = {
    "new node": new_node,
    "socket": lambda material: setattr(shader(material).inputs["Metallic"], "default_value", 1.0),
    "color": lambda material: setattr(shader(material).inputs["Base Color"], "default_value", (0, 0, 0, 1)),
    "setting": lambda material: setattr(material, "use_backface_culling", True),
    "custom property": lambda material: material.__setitem__("export", "skin"),
    "name": lambda material: setattr(material, "name", "Hero Skin"),
    "animation": lambda material: material.keyframe_insert("roughness", frame=1),
    "used elsewhere": elsewhere,
    "fake user": lambda material: setattr(material, "use_fake_user", True),
}


def state(material):
    sockets = {socket.name: str(getattr(socket, "default_value", "")) for socket in shader(material).inputs}
    colors = tuple(shader(material).inputs["Base Color"].default_value), tuple(material.diffuse_color)
    return material.name, len(material.node_tree.nodes), sockets.keys(), colors, material.use_backface_culling


def learn_fewer(settings):
    settings.n_segments = 2
    OPS.learn()


def live(settings):
    settings.smoothness = 3.0
    OPS.update()


def styled(settings):
    OPS.refresh_segments()
    settings.segments[1].name = "Belly"
    settings.segments[1].color = (0.1, 0.9, 0.3)


def turned_off(settings):
    settings.write_materials = False
    OPS.apply()


STEPS = {
    "apply": lambda settings: OPS.apply(),
    "live": live,
    "learn fewer": learn_fewer,
    "turned off": turned_off,
    "clear": lambda settings: OPS.clear(),
}


@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("work", WORK)
def test_a_changed_material_stays_as_it_is(obj, settings, tmp_path, work, step):
    material = bpy.data.materials[NAME]
    WORK[work](material)
    before = state(material)
    STEPS[step](settings)
    assert state(material) == before
    path = str(tmp_path / "saved.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    assert state(bpy.data.materials[before[0]]) == before, "also in the file"


@pytest.mark.parametrize("work", WORK)
def test_a_new_name_and_color_of_a_segment_leave_what_the_artist_chose(obj, settings, work):
    material = bpy.data.materials[NAME]
    WORK[work](material)
    before, base = state(material), tuple(shader(material).inputs["Base Color"].default_value)
    styled(settings)
    after = state(material)
    if work == "used elsewhere":
        assert after == before
        return
    assert after[1:3] + after[4:] == before[1:3] + before[4:]
    assert after[0] == ("Hero Skin" if work == "name" else "Belly")
    assert (tuple(shader(material).inputs["Base Color"].default_value) == base) == (work == "color")
    OPS.clear()
    assert material.name == after[0], "it is still there"


def test_new_labels_use_the_changed_material(obj, settings):
    material = bpy.data.materials["Segment 1"]
    new_node(material)
    material.name = "Hero Skin"
    for step in (STEPS["apply"], STEPS["live"]):
        step(settings)
        assert material in list(obj.data.materials)
        assert "Segment 1" not in bpy.data.materials


@pytest.mark.parametrize("how", ["update", "learn"])
def test_another_number_of_segments_and_back_use_the_changed_material(obj, settings, how):
    """Where the part has a successor; the material is never made twice."""
    material = bpy.data.materials["Segment 1"]
    new_node(material)
    material.name = "Hero Skin"
    faces = {}
    for number in (4, 3, 2, 4, 3):
        settings.n_segments = number
        getattr(OPS, how)()
        slots = [slot.material for slot in obj.material_slots]
        assert slots.count(material) == 1
        shown = [slots[polygon.material_index] == material for polygon in obj.data.polygons]
        assert faces.setdefault(number, shown) == shown
        assert sum(shown) > 0
    names = [name for name in bpy.data.materials.keys() if name not in ("Skin", "Cloth")]  # noqa: SIM118
    assert "Hero Skin" in names
    assert "Hero Skin.001" not in names
    OPS.clear()
    assert material.use_fake_user
    assert [each.name for each in obj.data.materials] == ["Skin", "Cloth"]


def test_a_changed_material_stays_with_another_character(obj, settings):
    """Which has its labels of the old set, as a second pose does that is not selected."""
    other = limbed("Other", 0.4)
    select(other)
    OPS.apply()
    material = bpy.data.materials["Segment 1"]
    new_node(material)
    select(obj)
    settings.n_segments = 3
    OPS.update()
    assert material in list(other.data.materials)
    assert material not in list(obj.data.materials)
    settings.n_segments = 4
    OPS.update()
    assert material in list(obj.data.materials)


def test_clear_names_what_it_keeps(obj, printed):
    before = ["Skin", "Cloth"]
    new_node(bpy.data.materials[NAME])
    printed()
    OPS.clear()
    assert f'You have changed these materials, they stay in the file: "{NAME}"' in printed().out
    assert [material.name for material in obj.data.materials] == before
    assert sorted(bpy.data.materials.keys()) == ["Cloth", NAME, "Skin"]


def test_materials_as_made_are_restyled_and_removed(obj, settings):
    styled(settings)
    material = bpy.data.materials["Belly"]
    assert material.diffuse_color[1] > 0.7
    settings.segments[1].name = "Back"
    assert material.name == "Back"
    OPS.clear()
    assert sorted(bpy.data.materials.keys()) == ["Cloth", "Skin"]


def test_a_changed_copy_of_our_material_in_one_more_slot_stays_on_its_faces(obj):
    mine = bpy.data.materials[NAME].copy()
    mine.name = "Mine"
    new_node(mine)
    obj.data.materials.append(mine)
    obj.data.polygons[7].material_index = len(obj.data.materials) - 1
    OPS.clear()
    assert [material.name for material in obj.data.materials] == ["Skin", "Cloth", "Mine"]
    assert [polygon.material_index for polygon in obj.data.polygons][5:9] == [1, 0, 2, 0]


def test_a_changed_copy_of_a_template_stays(settings):
    template = bpy.data.materials.new("Rough")
    if bpy.app.version < (5, 0, 0):
        template.use_nodes = True
    settings.write_materials, settings.material_template = True, template
    obj = limbed()
    write(settings, obj)
    changed, *others = (material.name for material in obj.data.materials)
    shader(bpy.data.materials[changed]).inputs["Roughness"].default_value = 0.9
    shader(template).inputs["Metallic"].default_value = 1.0
    write(settings, obj)
    assert shader(bpy.data.materials[changed]).inputs["Roughness"].default_value == pytest.approx(0.9)
    assert shader(bpy.data.materials[others[0]]).inputs["Metallic"].default_value == 1.0
    select(obj)
    OPS.clear()
    assert sorted(bpy.data.materials.keys()) == sorted(["Rough", changed])


def test_our_material_in_a_slot_of_the_artist_stays(settings):
    """The artist takes a segment's material for another object, which is labeled later."""
    first, second = limbed("First"), limbed("Second")
    write_labels(first.data, stripes(first.data), OutputOptions(materials=True))
    second.data.materials.append(bpy.data.materials[NAME])
    write_labels(second.data, stripes(second.data), OutputOptions(materials=True))
    select(second)
    OPS.clear()
    assert [material.name for material in second.data.materials] == [NAME]
