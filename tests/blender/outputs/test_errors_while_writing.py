"""An error at any point of writing leaves everything as it was.

Each operator is run again and again, and each time another step of the writers raises: all steps in turn.
"""

import sys
from pathlib import Path

import bpy
import numpy as np
import pytest
from builders import changes, groups_snapshot, limbed, mesh_object, scene_snapshot, select
from height_bands import bands
from painted_objects import painted

from wks_segment.blender.operators import unwrap
from wks_segment.blender.outputs.labels import write_labels
from wks_segment.blender.outputs.options import OutputOptions

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment
PACKAGE = Path(sys.modules["wks_segment"].__file__).parent / "blender"
BRING_BACK = {
    "restore_point.py", "mesh_state.py", "property_state.py", "material_slots.py", "all_or_nothing.py", "ledger.py",
    "own_property.py",
}  # fmt: skip
"""Modules that bring back what was there, or that only help others to write."""
WRITERS = {
    str(path)
    for path in [*(PACKAGE / "outputs").glob("*.py"), *(PACKAGE / "workflow").glob("*.py")]
    if path.name not in BRING_BACK
}


WRITING = {
    "write", "take_back", "write_labels", "clear_labels", "separate", "unite", "write_id_map", "write_uv_map",
    "write_outputs", "rewrite_all", "change_sets", "enter_origin", "learned", "adjusted", "_keep_model", "store_active",
}  # fmt: skip
"""Functions of which every line raises in turn: what they call is complete or raises there."""


class InjectedError(Exception):
    """The error that is raised."""


class Injector:
    """Raises at the first step of the writers that has not raised yet."""

    def __init__(self, files):
        self.files = {path for path in WRITERS if not files or Path(path).name in files}
        self.raised = set()
        self.on = False

    def __call__(self, frame, event, argument):
        is_writing = frame.f_code.co_filename in self.files and frame.f_code.co_name in WRITING
        return self.line if self.on and is_writing and not in_bring_back(frame) else None

    def line(self, frame, event, argument):
        if self.on and event == "line":
            self.step(frame)
        return self.line

    def step(self, frame):
        place = Path(frame.f_code.co_filename).name, frame.f_lineno
        if place not in self.raised:
            self.raised.add(place)
            self.on = False
            raise InjectedError(f"{place[0]}:{place[1]}")


def in_bring_back(frame):
    while frame is not None:
        if frame.f_code.co_name in ("restore", "finish", "bring_back", "leaving_edit_mode", "poll"):
            return True
        frame = frame.f_back
    return False


@pytest.fixture
def character(settings):
    """A small object of an artist with everything, labeled with everything, and with an ID map."""
    points, faces = small()
    obj = painted(mesh_object(points, faces, "Limbed"))
    obj.vertex_groups[0].lock_weight = True
    for loop, uv in zip(obj.data.loops, obj.data.uv_layers["Second"].uv, strict=True):
        uv.vector = [0.5 + 0.15 * number for number in obj.data.vertices[loop.vertex_index].co.xy]
    settings.write_materials = settings.write_face_sets = settings.write_seams = settings.bake_unwrap = True
    settings.write_ucupaint = True
    settings.vertex_groups, settings.bake_size = "hard", 64
    options = OutputOptions(ucupaint=True, materials=True, vertex_groups="hard", face_sets=True, seams=True)
    write_labels(obj.data, bands(obj), options)
    select(obj)
    OPS.refresh_segments()
    OPS.bake()
    return obj


def small():
    obj = limbed("Small", subdivisions=1)
    points = [tuple(vertex.co) for vertex in obj.data.vertices]
    faces = [tuple(polygon.vertices) for polygon in obj.data.polygons]
    mesh = obj.data
    bpy.data.objects.remove(obj)
    bpy.data.meshes.remove(mesh)
    return points, faces


def in_edit_mode(operator):
    for mode in ("EDIT", "OBJECT"):  # which changes the selection
        bpy.ops.object.mode_set(mode=mode)

    def run():
        bpy.ops.object.mode_set(mode="EDIT")
        try:
            operator()
        finally:
            bpy.ops.object.mode_set(mode="OBJECT")

    return run


def separated_and_cleared():
    OPS.separate()
    return OPS.clear


def unwrapped():
    """With any UVs: to compute them takes seconds."""
    unwrap.unwrap_parts = lambda context, obj, labels, method: np.full((len(obj.data.loops), 2), 0.5, dtype=np.float32)
    return OPS.unwrap


def in_other_colors():
    bpy.context.scene.wks_segment.palette = "maximal"
    return lambda: OPS.segments_from(source="FACE_SETS")


def learned():
    settings = bpy.context.scene.wks_segment
    settings.n_segments, settings.vertex_groups = 2, "none"
    OPS.learn()
    settings.n_segments = 3
    return OPS.learn


def bake_smaller():
    bpy.context.scene.wks_segment.bake_size = 32
    return OPS.bake


OPERATORS = {
    "segments from face sets": (in_other_colors, ()),
    "clear": (lambda: OPS.clear, ()),
    "separate": (lambda: OPS.separate, ()),
    "clear of separated objects": (separated_and_cleared, ("separate.py", "id_map.py")),
    "unwrap": (unwrapped, ()),
    "bake": (bake_smaller, ("id_map.py",)),
    "learn": (learned, ("segmentation_job.py", "pipeline.py", "model_library.py", "carry_over.py", "origin.py")),
    "merge": (lambda: lambda: OPS.merge_segments(into=1), ("segment_list.py", "labels.py")),
    "new segment": (lambda: in_edit_mode(lambda: OPS.new_segment(name="Mine")), ()),
}
"""What is run, and the modules whose steps raise, if not those of all: some operators compute for long."""


def state():
    materials = {
        material.name: (tuple(material.diffuse_color), material.use_fake_user, material.users)
        for material in bpy.data.materials
    }
    groups = {obj.name: groups_snapshot(obj) for obj in bpy.data.objects if obj.type == "MESH"}
    return {**scene_snapshot(), "looks": materials, "weights": groups, "meshes in the file": bpy.data.meshes.keys()}


@pytest.mark.parametrize("name", OPERATORS)
def test_an_error_leaves_everything_as_it_was(character, name, monkeypatch):
    monkeypatch.setattr(unwrap, "unwrap_parts", unwrap.unwrap_parts)
    make, files = OPERATORS[name]
    operator = make()
    before, injector = state(), Injector(files)
    traced, tried = sys.gettrace(), 0
    while True:
        injector.on, failed = True, ""
        sys.settrace(injector)
        try:
            operator()
        except RuntimeError as error:
            failed = str(error)
        finally:
            sys.settrace(traced)
            reached_all, injector.on = injector.on, False
        if reached_all:
            break
        assert "Injected" in failed, f"{failed}: the error was swallowed"
        tried += 1
        assert not changes(before, state()), failed.splitlines()[-2:]
    assert tried > 5
    assert changes(before, state()), "without an error it writes"
