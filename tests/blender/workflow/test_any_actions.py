"""Whatever is done, undone and redone: fields, list, names, colors and meshes agree, and each step is back as it was.

`make fuzz` tries a thousand sequences.
"""

import bpy
import hypothesis
import numpy as np
import pytest
from builders import changes, choose, labels_of, limbed, limbed_rigged, listed, said, snapshot
from height_bands import colors_at, style_on
from hypothesis import event, given
from hypothesis import strategies as st
from live_settings import click, rest

from wks_segment.blender.outputs.ledger import LEDGER
from wks_segment.blender.outputs.origin import origin_of
from wks_segment.blender.outputs.part_attributes import has_labels
from wks_segment.blender.workflow import followed_settings
from wks_segment.blender.workflow.live_session import session_of

pytestmark = pytest.mark.usefixtures("extension")
OPS = bpy.ops.wks_segment
NAMES = ("Man", "Robot")
MOST_STEPS = 64


def begin():
    """Two characters, both learned; the undo stack begins here."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.context.preferences.edit.undo_steps = MOST_STEPS
    settings = bpy.context.scene.wks_segment
    settings.n_segments, settings.n_eigenpairs, settings.n_energies, settings.pose_count = 4, 30, 40, 2
    settings.write_materials, settings.vertex_groups = True, "hard"
    limbed_rigged("Man")
    limbed("Robot", bend=0.4, subdivisions=3)
    for name, source in zip(NAMES, ("FRAMES", "OBJECTS"), strict=True):
        click(bpy.data.objects[name])
        settings.source = source
        assert OPS.learn() == {"FINISHED"}
    bpy.ops.ed.undo_push(message="begin")


def row_of(settings, number):
    return settings.segments[number % len(settings.segments)] if settings.segments else None


def rename(settings, number):
    row = row_of(settings, number)
    if row is not None:
        row.name = f"Part {number}"


def recolor(settings, number):
    row = row_of(settings, number)
    if row is not None:
        row.color = (number / 9, 0.5, 1 - number / 9)


def with_row(operator):
    def run(settings, number):
        if settings.segments:
            settings.active_segment = number % len(settings.segments)
            if operator.poll():
                operator()

    return run


def merge(settings, number):
    if len(settings.segments) > 1:
        settings.active_segment = number % len(settings.segments)
        OPS.merge_segments(into=settings.segments[(number + 1) % len(settings.segments)].number)


def assign(settings, number):
    obj = bpy.context.view_layer.objects.active
    if not settings.segments or obj is None or not has_labels(obj.data):
        return
    settings.active_segment = number % len(settings.segments)
    choose(obj, np.arange(len(obj.data.polygons)) // 25 == number)
    (OPS.new_segment if number % 2 else OPS.assign_faces)()
    bpy.ops.object.mode_set(mode="OBJECT")


def run(operator):
    def act(settings, number):
        if operator.poll():
            operator()

    return act


ACTIONS = {
    "click one": lambda settings, number: click(bpy.data.objects[NAMES[number % 2]]),
    "click both": lambda settings, number: click(*(bpy.data.objects[name] for name in NAMES[:: 1 - 2 * (number % 2)])),
    "number": lambda settings, number: setattr(settings, "n_segments", 2 + number % 5),
    "smoothness": lambda settings, number: setattr(settings, "smoothness", number / 5),
    "smallest part": lambda settings, number: setattr(settings, "min_share", number / 2),
    "palette": lambda settings, number: setattr(settings, "palette", ("calm", "distinct", "color_blind")[number % 3]),
    "materials": lambda settings, number: setattr(settings, "write_materials", bool(number % 3)),
    "groups": lambda settings, number: setattr(settings, "vertex_groups", ("none", "hard", "soft")[number % 3]),
    "live": lambda settings, number: setattr(settings, "live", bool(number % 4)),
    "rename": rename,
    "recolor": recolor,
    "merge": merge,
    "assign": assign,
    "split": with_row(OPS.split_segment),
    "restore": with_row(OPS.restore_segments),
    "forget": with_row(OPS.forget_faces),
    "model": lambda settings, number: setattr(settings, "active_model", number % max(len(settings.models), 1)),
    "apply": run(OPS.apply),
    "learn": run(OPS.learn),
    "clear": run(OPS.clear),
}
STEPS = st.one_of(
    st.tuples(st.sampled_from(sorted(ACTIONS)), st.integers(0, 9)),
    st.tuples(st.sampled_from(["undo", "redo"]), st.just(0)),
)


def settled():
    """What follows when a user waits for a moment."""
    bpy.types.WindowManager.wks_segment_active_object.on_timer()
    session = session_of(bpy.context)
    if bpy.app.timers.is_registered(session.timer):
        rest(session)


def state():
    """All that a user sees."""
    settings = bpy.context.scene.wks_segment
    objects = [bpy.data.objects[name] for name in NAMES]
    return {
        "fields": {**followed_settings.values_of(settings), "palette": settings.palette, "live": settings.live},
        "list": [*listed(settings), *(tuple(item.color) for item in settings.segments)],
        "by hand": settings.faces_by_hand,
        "selected": [obj.select_get() for obj in objects],
        "models": [(row.name, row.uid, row.n_segments) for row in settings.models],
        "used": (settings.used_model, settings.model, settings.model_summary),
        "notes": {row.name: said(row) for row in settings.label_sets},
        "meshes": {obj.name: snapshot(obj.data) for obj in objects},
        "groups": {obj.name: [group.name for group in obj.vertex_groups] for obj in objects},
    }


def agrees():
    """Whether what is shown of the active object is what is on its mesh, and all outputs say the same."""
    settings = bpy.context.scene.wks_segment
    for name in NAMES:
        obj = bpy.data.objects[name]
        if not has_labels(obj.data):
            assert not obj.vertex_groups or name == "Man"
            continue
        style = style_on(obj)
        for part in np.unique(labels_of(obj)).tolist():
            np.testing.assert_allclose(
                colors_at(obj, part), [np.rint(255 * style.colors_of(np.array(part)))], atol=1, err_msg=name
            )
            if "first_slot" in obj.data[LEDGER]:
                at = np.flatnonzero(labels_of(obj) == part)[0]
                assert obj.data.materials[obj.data.polygons[at].material_index].name.startswith(style.name_of(part))
            if obj.data[LEDGER].get("vertex_groups"):
                assert f"WKS {style.name_of(part)}" in obj.vertex_groups
    active = bpy.context.view_layer.objects.active
    if active is None or not has_labels(active.data) or not active.select_get():
        return
    assert {item.number for item in settings.segments} == set(labels_of(active).tolist())
    session = session_of(bpy.context)
    if settings.live and settings.shown == active.data.name and not session.message:
        now, origin = followed_settings.values_of(settings), origin_of(active.data)
        assert followed_settings.are_alike(origin.settings, now), (origin.settings, now, session.message)


@given(st.lists(STEPS, min_size=30, max_size=30))
@hypothesis.settings(phases=[hypothesis.Phase.explicit, hypothesis.Phase.generate])
def test_any_actions_undone_and_redone_agree(steps):
    """A sequence that fails is printed as it is: to find a shorter one would take minutes."""
    check(steps)


def check(steps):
    """Do the steps, and compare everything after each of them."""
    begin()
    settled()
    states, at = [state()], 0
    for name, number in steps:
        event(name)
        if name == "undo":
            if at > 0:
                assert bpy.ops.ed.undo() == {"FINISHED"}
                at -= 1
        elif name == "redo":
            if at < len(states) - 1:
                assert bpy.ops.ed.redo() == {"FINISHED"}
                at += 1
        else:
            ACTIONS[name](bpy.context.scene.wks_segment, number)
            bpy.ops.ed.undo_push(message=name)
            at += 1
            del states[at:]
        settled()
        agrees()
        if at == len(states):
            states.append(state())
        assert not changes(states[at], state()), (name, number)
