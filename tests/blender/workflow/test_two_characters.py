"""Two characters in one scene: nothing changes that is not selected, and nothing by hand is lost."""

from types import SimpleNamespace

import bpy
import numpy as np
import pytest
from builders import changes, choose, labels_of, limbed, limbed_rigged, mesh_object, select, snapshot
from height_bands import RED, activate, colors_at, style_on, write_labels
from live_settings import click, rest

from wks_segment.blender.operators import clear as clear_module
from wks_segment.blender.outputs.origin import origin_of
from wks_segment.blender.outputs.overrides import by_hand
from wks_segment.blender.scene.characters import Character
from wks_segment.core.progress import Progress

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment


def animated_box(name="Robot"):
    """A long box with a bump, that an action turns."""
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=8, y_subdivisions=40)
    grid = bpy.context.object
    points = np.array([vertex.co for vertex in grid.data.vertices]) * (0.5, 3.0, 1.0)
    points[:, 2] = np.exp(-4 * (points[:, 1] - 1) ** 2)
    faces = [list(polygon.vertices) for polygon in grid.data.polygons]
    bpy.data.objects.remove(grid)
    obj = mesh_object(points, faces, name)
    obj.location.x = 6
    return obj


def learn(obj, **options):
    click(obj)
    assert OPS.learn(**options) == {"FINISHED"}


@pytest.fixture
def man(session, settings):
    settings.source, settings.pose_count = "FRAMES", 2
    return limbed_rigged("Man")


@pytest.fixture
def robot(man):
    return animated_box()


@pytest.fixture
def both(man, robot, settings):
    """A man, and a robot that moves by a rig of its own, both learned."""
    settings.write_materials = True
    learn(man)
    settings.source = "OBJECTS"
    learn(robot)
    return man, robot


def state_of(obj):
    """Mesh, names and colors, and the materials on it."""
    style = style_on(obj)
    parts = np.unique(labels_of(obj)).tolist()
    looks = {part: (style.name_of(part), style.colors_of(np.array(part)).tolist()) for part in parts}
    materials = [(slot.name, tuple(slot.diffuse_color)) for slot in obj.data.materials]
    return {"mesh": snapshot(obj.data), "looks": looks, "materials": materials}


EDITS = {
    "merge": lambda settings: OPS.merge_segments(into=settings.segments[1].number),
    "recolor": lambda settings: setattr(settings.segments[0], "color", RED),
    "rename": lambda settings: setattr(settings.segments[0], "name", "Arm"),
    "palette": lambda settings: setattr(settings, "palette", "maximal"),
    "number": lambda settings: setattr(settings, "n_segments", 3),
}


@pytest.mark.parametrize("edit", EDITS)
@pytest.mark.parametrize("last", ["man", "robot"])
def test_edits_of_one_character_leave_the_other_alone(both, settings, session, edit, last):
    man, robot = both
    if last == "man":
        settings.source = "FRAMES"
        learn(man)
    click(man)
    before, other = state_of(man), state_of(robot)
    EDITS[edit](settings)
    rest(session)
    assert not changes(other, state_of(robot))
    assert changes(before, state_of(man))


def test_meshes_that_share_a_model_share_names_colors_and_merges(man, settings):
    learn(man)
    level = limbed("Level", bend=0.2)
    click(level)
    assert OPS.apply() == {"FINISHED"}
    activate(settings, 0).color = RED
    assert colors_at(man, 0) == colors_at(level, 0) == [[255, 0, 0]]
    OPS.merge_segments(into=1)
    assert 0 not in labels_of(man)


def test_names_follow_a_characters_own_parts_only(both, settings):
    man, robot = both
    click(man)
    part = settings.segments[1].number
    settings.segments[1].name, settings.segments[1].color = "Arm", RED
    arm = labels_of(man) == part
    settings.source = "OBJECTS"
    learn(robot)
    assert "Arm" not in [item.name for item in settings.segments]
    click(man)
    settings.source = "FRAMES"
    for count in (2, 3):
        settings.pose_count = count
        assert OPS.learn() == {"FINISHED"}
        (named,) = [item for item in settings.segments if item.name == "Arm"]
        assert tuple(named.color) == pytest.approx(RED)
        found = labels_of(man) == named.number
        assert (found & arm).sum() > 0.5 * (found | arm).sum()


def test_live_acts_on_what_is_selected(both, settings, session):
    man, robot = both
    first, second = labels_of(man), labels_of(robot)
    click(robot)
    settings.n_segments = 2
    rest(session)
    np.testing.assert_array_equal(labels_of(man), first)
    assert set(labels_of(robot)) == {0, 1}
    click(man)
    assert settings.n_segments == 4, "the field shows the object that was clicked"
    click(robot)
    assert settings.n_segments == 2
    click(man, robot)
    settings.n_segments = 3
    rest(session)
    assert [len(np.unique(labels_of(obj))) for obj in both] == [3, 3]
    assert (labels_of(robot) != second).any()


def test_going_back_to_a_number_gives_back_what_was_there(man, settings, session):
    learn(man, n_segments=6)
    activate(settings, 2)
    OPS.merge_segments(into=1)
    activate(settings, 3).name = "Limb"
    chosen = np.arange(len(man.data.polygons)) < 80
    activate(settings, 3)
    choose(man, chosen)
    OPS.assign_faces()
    OPS.new_segment(name="Belt")
    bpy.ops.object.mode_set(mode="OBJECT")
    before, hand = labels_of(man), by_hand(man.data)
    listed = [(item.name, tuple(item.color)) for item in settings.segments]
    for number in (3, 5, 2):
        settings.n_segments = number
        rest(session)
        assert len(np.unique(labels_of(man)[chosen])) == 1, "by hand stays by hand"
        settings.n_segments = 6
        rest(session)
        np.testing.assert_array_equal(labels_of(man), before)
        np.testing.assert_array_equal(by_hand(man.data), hand)
        assert [(item.name, tuple(item.color)) for item in settings.segments] == listed


def test_faces_by_hand_go_along_to_every_number(man, settings, session):
    learn(man, n_segments=5)
    for number in (4, 5):  # both were there before
        settings.n_segments = number
        rest(session)
    settings.n_segments = 4
    rest(session)
    activate(settings, 1)
    chosen = np.arange(len(man.data.polygons)) < 30
    choose(man, chosen)
    OPS.assign_faces()
    bpy.ops.object.mode_set(mode="OBJECT")
    settings.n_segments = 5
    rest(session)
    assert (by_hand(man.data) >= 0).sum() == 30
    choose(man, chosen)
    OPS.forget_faces()
    bpy.ops.object.mode_set(mode="OBJECT")
    settings.n_segments = 4
    rest(session)
    assert not (by_hand(man.data) >= 0).any(), "forgotten, wherever it was"


@pytest.mark.parametrize("palette", ["calm", "distinct", "color_blind"])
def test_made_segments_have_colors_of_their_own(man, settings, session, palette):
    settings.palette = palette
    learn(man, n_segments=3)
    for i in range(2):
        activate(settings, 0)
        choose(man, np.arange(len(man.data.polygons)) // 40 == i)
        OPS.new_segment(name="Piece")
        bpy.ops.object.mode_set(mode="OBJECT")
    settings.n_segments = 9
    rest(session)
    colors = [tuple(np.round(item.color, 3)) for item in settings.segments]
    assert len(settings.segments) > 7
    assert len(set(colors)) == len(colors)


def test_palette_recolors_at_once_and_nothing_else(man, settings):
    learn(man)
    outfit = limbed("Outfit")
    outfit.scale = (1.05, 1.05, 1.05)
    select(man, outfit)
    bpy.context.view_layer.update()
    assert OPS.transfer() == {"FINISHED"}
    labels, before = labels_of(outfit), snapshot(outfit.data)
    settings.palette = "maximal"
    for obj in (man, outfit):
        for part in np.unique(labels_of(obj)).tolist():
            expected = np.rint(255 * style_on(obj).colors_of(np.array(part)))
            np.testing.assert_allclose(colors_at(obj, part), [expected], atol=1)
    np.testing.assert_array_equal(labels_of(outfit), labels)
    color = "/attributes/wks_segment_color"
    assert [path for path in changes(before, snapshot(outfit.data)) if not path.startswith(color)] == []


def test_transferred_segments_are_no_pose(man, settings):
    learn(man)
    outfit = limbed("Outfit")
    select(man, outfit)
    OPS.transfer()
    before = snapshot(outfit.data)
    settings.smoothness = 0.5
    assert OPS.apply() == {"FINISHED"}
    assert not changes(before, snapshot(outfit.data))
    assert origin_of(man.data).settings["smoothness"] == 0.5
    settings.source = "OBJECTS"
    assert OPS.learn() == {"FINISHED"}
    assert not changes(before, snapshot(outfit.data))
    # Asked for the outfit alone, its segments are those of the model from then on.
    select(outfit)
    assert OPS.apply() == {"FINISHED"}
    assert not origin_of(outfit.data).transferred


def test_what_was_drawn_by_hand_stays(man, settings, session):
    settings.write_face_sets = True
    learn(man)
    drawn = man.data.attributes[".sculpt_face_set"]
    numbers = np.empty(len(man.data.polygons), dtype=np.int32)
    drawn.data.foreach_get("value", numbers)
    numbers[:60] = numbers.max() + 7
    drawn.data.foreach_set("value", numbers)
    assert OPS.segments_from(source="FACE_SETS") == {"FINISHED"}
    part = labels_of(man)[0]
    assert settings.faces_by_hand == 60
    settings.smoothness = 0.2
    rest(session)
    assert set(labels_of(man)[:60]) == {part}
    assert (labels_of(man) == part).sum() == 60
    settings.n_segments = 2
    rest(session)
    assert (labels_of(man)[:60] == labels_of(man)[0]).all()
    assert labels_of(man)[0] >= 500
    OPS.forget_faces()
    assert set(labels_of(man)) == {0, 1}


def test_ticked_outputs_are_written_at_once_to_what_is_selected(both, settings, session):
    man, robot = both
    other = state_of(robot)
    click(man)
    settings.write_face_sets, settings.vertex_groups, settings.write_materials = True, "soft", False
    rest(session)
    assert ".sculpt_face_set" in man.data.attributes
    assert not man.data.materials
    weights = {round(group.weight, 3) for vertex in man.data.vertices for group in vertex.groups}
    assert len(weights) > 10, "soft groups, which need the model"
    assert not changes(other, state_of(robot))
    click(robot)
    assert (settings.write_face_sets, settings.vertex_groups, settings.write_materials) == (False, "none", True)


def test_ticked_outputs_are_written_at_once_without_a_model(man, settings):
    learn(man)
    outfit = limbed("Outfit")
    select(man, outfit)
    OPS.transfer()
    click(outfit)
    labels = labels_of(outfit)
    settings.write_seams, settings.write_colors = True, False
    assert any(edge.use_seam for edge in outfit.data.edges)
    assert "wks_segment_color" not in outfit.data.attributes
    np.testing.assert_array_equal(labels_of(outfit), labels)


def test_number_typed_during_a_job_is_followed(man, settings, session):
    learn(man)
    job = session.job.with_settings(settings)
    job.compute(Progress())
    settings.n_segments = 2  # while the job is computed
    session.write(job)
    session.follow(bpy.context.scene)
    assert session.is_scheduled
    rest(session)
    assert set(labels_of(man)) == {0, 1}
    assert settings.n_segments == 2


def test_live_follows_after_apply_was_undone(man, settings, session):
    learn(man)
    bpy.ops.ed.undo_push(message="learned")
    settings.live, settings.n_segments = False, 3
    assert OPS.apply() == {"FINISHED"}
    bpy.ops.ed.undo_push(message="applied")
    assert bpy.ops.ed.undo() == {"FINISHED"}
    settings = bpy.context.scene.wks_segment
    assert (settings.n_segments, settings.live) == (4, True)
    settings.n_segments = 2
    rest(session)
    assert set(labels_of(bpy.data.objects["Man"])) == {0, 1}


def test_list_is_of_the_active_object(both, settings):
    man, robot = both
    robot.scale = (9, 9, 9)
    click(man, robot)
    alone = [item.share for item in settings.segments]
    assert sum(alone) == pytest.approx(100, abs=0.01)
    areas = [sum(face.area for face in man.data.polygons if labels_of(man)[face.index] == part) for part in range(4)]
    assert alone == pytest.approx([100 * area / sum(areas) for area in areas], rel=1e-3)
    settings.segments[0].name = "Head"
    click(robot, man)
    assert settings.segments[0].name == "Segment 1"
    click(limbed("Stranger"))
    assert not settings.segments


def test_clear_asks_before_it_takes_faces_by_hand(man, settings, monkeypatch):
    learn(man)
    asked, cleared = [], []
    monkeypatch.setattr(clear_module._report, "has_window", lambda context: True)
    manager = SimpleNamespace(invoke_confirm=lambda *_, **texts: asked.append(texts) or {"RUNNING_MODAL"})
    window = SimpleNamespace(
        window_manager=manager, selected_objects=[man], visible_objects=[man], scene=bpy.context.scene
    )
    operator = SimpleNamespace(execute=lambda context: cleared.append(True) or {"FINISHED"})
    invoke = clear_module.WKS_SEGMENT_OT_clear.invoke
    assert invoke(operator, window, None) == {"FINISHED"}
    assert cleared, "there is nothing to ask"
    choose(man, np.arange(len(man.data.polygons)) < 12)
    OPS.assign_faces()
    bpy.ops.object.mode_set(mode="OBJECT")
    assert invoke(operator, window, None) == {"RUNNING_MODAL"}
    assert "12 faces that were assigned by hand" in asked[0]["message"]
    assert len(cleared) == 1


def test_another_count_of_poses_keeps_colors_of_the_same_parts(man, settings):
    settings.n_segments = 6
    learn(man)
    settings.palette = "maximal"
    # As if the model had numbered its segments otherwise.
    old = labels_of(man)
    write_labels(settings, {Character((man,)): (old + 2) % 6}, of="first/6")
    before = {part: colors_at(man, part) for part in np.unique(labels_of(man)).tolist()}
    old = labels_of(man)
    settings.pose_count = 3
    assert OPS.learn() == {"FINISHED"}
    now, kept = labels_of(man), 0
    for part in np.unique(now).tolist():
        for other in np.unique(old).tolist():
            if ((now == part) & (old == other)).sum() > 0.6 * ((now == part) | (old == other)).sum():
                assert colors_at(man, part) == before[other]
                kept += 1
    assert kept > 2
    colors = [tuple(item.color) for item in settings.segments]
    assert len(set(colors)) == len(colors)
