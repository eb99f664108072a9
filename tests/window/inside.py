"""What runs inside the Blender of the window tests: answers questions, presses nothing.

Blender runs this at its start. The driver names a function of this file and its arguments in a file, and gets what it
returns; a function that yields goes on after the next redraw. Positions are those of the screen, from its top left.
"""

import itertools
import json
import os
import re
import time
import traceback
import zlib
from math import radians

import bmesh
import bpy
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d
from mathutils import Euler, Vector

FOLDER = "/window/"
TICK = 0.04
"""Seconds between looks at the question."""
STEP = 9
"""Pixels between places that `button` looks at: half a button's height."""
COLUMNS = (0.62, 0.4, 0.85, 0.2)
"""Where across a panel it looks: in fields and wide buttons, in both halves of a row, in the first third of one."""


def ready():
    """Whether the window draws."""
    yield from settle()
    return True


def settle():
    """Let events and redraws happen."""
    for _ in range(2):
        _view3d().tag_redraw()
        yield


def region(kind):
    """[x, y, width, height] of a region of the 3D viewport: WINDOW, UI, HUD, HEADER."""
    found = _region(kind)
    return [found.x, _window().height - found.y - found.height, found.width, found.height]


def tab():
    """The open tab of the side panel; "" while it is hidden."""
    return _region("UI").active_panel_category if _view3d().spaces.active.show_region_ui else ""


def button(name, kind="UI"):
    """[x, y] of the button of an operator or property in a region; if it is not there, what is.

    The mouse goes down a column, then the next, and Blender says what its own Ctrl-C would copy there.
    """
    left, top, width, height = region(kind)
    found = {}
    for across in COLUMNS:
        x = int(left + across * width)
        for y in range(top + STEP, top + height, STEP):
            _window().cursor_warp(x, _window().height - y)
            yield
            here = _hovered(kind)
            if here == name:
                return [x, y + STEP // 3]
            found[here] = [x, y]
            if here == "" and y > STEP * 26 + max((place[1] for key, place in found.items() if key), default=top + 400):
                break  # below the last panel
    return {key: place for key, place in found.items() if key}


def place_of(name):
    """[x, y] on the screen of the vertex of an object that is nearest to the eye: a click there takes the object."""
    area, space = _region("WINDOW"), _view3d().spaces.active.region_3d
    obj = bpy.data.objects[name]
    points = [obj.matrix_world @ vertex.co for vertex in obj.evaluated_get(_depsgraph()).data.vertices]
    depths = [(space.view_matrix @ point).z for point in points]
    spot = location_3d_to_region_2d(area, space, points[depths.index(max(depths))])
    return [int(area.x + spot.x), int(_window().height - area.y - spot.y)]


def view():
    """Where the eye is, as numbers."""
    return [value for row in _view3d().spaces.active.region_3d.view_matrix for value in row]


def zoom_to_all(azimuth=-60.0, height=75.0):
    """A view of all, from the side: a starting point, not a step of the way."""
    area = _view3d()
    area.spaces.active.region_3d.view_rotation = Euler((radians(height), 0, radians(azimuth))).to_quaternion()
    yield from settle()
    with bpy.context.temp_override(window=_window(), area=area, region=_region("WINDOW")):
        bpy.ops.view3d.view_all()
    yield from settle()
    # To the left, out of the way of the side panel.
    eye = area.spaces.active.region_3d
    eye.view_location += eye.view_rotation @ Vector((0.13 * eye.view_distance, 0, 0))
    eye.view_distance *= 1.15
    yield from settle()


def state():
    """What the user works with: mode, selection, settings, file."""
    scene, layer = _window().scene, _window().view_layer
    settings = scene.wks_segment
    return {
        "selected": sorted(obj.name for obj in layer.objects if obj.select_get(view_layer=layer)),
        "active": layer.objects.active.name if layer.objects.active else None,
        "settings": {
            each.identifier: sorted(value) if isinstance(value := getattr(settings, each.identifier), set) else value
            for each in settings.bl_rna.properties
            if each.type not in {"POINTER", "COLLECTION"} and not each.identifier.startswith(("model", "name"))
        },
        "model": bool(settings.model),
        "summary": settings.model_summary.splitlines(),
        "frame": scene.frame_current,
        "file": bpy.data.filepath,
        "saved": not bpy.data.is_dirty,
        "colors": _view3d().spaces.active.shading.color_type,
    }


def segments(name):
    """{part: number of faces} of an object; empty without segments."""
    mesh = bpy.data.objects[name].data
    if "wks_segment" not in mesh.attributes:
        return {}
    found = np.unique(_values(mesh, "wks_segment"), return_counts=True)
    return {str(part): int(count) for part, count in zip(*found, strict=True)}


def rows():
    """The list of segments: [name, share, hidden, number of selected faces] of each."""
    mesh = _window().view_layer.objects.active.data
    chosen = []
    if mesh.is_editmode:  # what the mesh itself holds is that of before
        faces = bmesh.from_edit_mesh(mesh).faces
        part = faces.layers.int["wks_segment"]
        chosen = [face[part] for face in faces if face.select]
    return [
        [item.name, item.share, item.hidden, chosen.count(item.number)] for item in _window().scene.wks_segment.segments
    ]


def face_sets(name):
    """How many face sets an object has."""
    return len(np.unique(_values(bpy.data.objects[name].data, ".sculpt_face_set")))


def image_colors(name):
    """How many pixels of an image have each color, as "r g b a" in bytes."""
    image = bpy.data.images.get(name)
    if image is None:
        return {}
    pixels = np.empty(len(image.pixels), dtype=np.float32)
    image.pixels.foreach_get(pixels)
    found, count = np.unique((pixels.reshape(-1, 4) * 255).round().astype(int), axis=0, return_counts=True)
    return {" ".join(map(str, color)): int(n) for color, n in zip(found, count, strict=True)}


def objects():
    """Name and parent of each object."""
    return {obj.name: obj.parent.name if obj.parent else None for obj in bpy.data.objects}


def make_active(name):
    """Make an object the active one: what lies inside another cannot be clicked."""
    _window().view_layer.objects.active = bpy.data.objects[name]
    yield from settle()


def job_runs():
    """Whether there is something to cancel."""
    with bpy.context.temp_override(window=_window(), area=_view3d()):
        return bpy.ops.wks_segment.cancel.poll()


def job_is_over():
    """Whether there is nothing to cancel."""
    return not job_runs()


def n_segments(name, count):
    """Whether an object has that many segments."""
    return len(segments(name)) == count


def groups(name, beginning):
    """Names of an object's vertex groups that begin so."""
    return [group.name for group in bpy.data.objects[name].vertex_groups if group.name.startswith(beginning)]


def contents(name):
    """A fingerprint of each thing that an artist could miss of an object: attributes, slots, groups, weights."""
    obj = bpy.data.objects[name]
    mesh = obj.data
    found = {
        f"attribute {each.name}": [each.domain, each.data_type, _fingerprint(each)]
        for each in mesh.attributes
        if not each.name.startswith(".")  # of its own ones Blender gives some a wrong type
    }
    found |= {f"vertex group {group.name}": group.index for group in obj.vertex_groups}
    weights = [[(each.group, each.weight) for each in vertex.groups] for vertex in mesh.vertices]
    found["weights"] = zlib.crc32(repr(weights).encode())
    found["slots"] = [material.name if material else None for material in mesh.materials]
    found["shown colors"] = [mesh.attributes.active_color_name, mesh.attributes.default_color_name]
    found["own properties"] = sorted(mesh.keys())
    found["seams"] = sum(edge.use_seam for edge in mesh.edges)
    found["uv layers"] = [layer.name for layer in mesh.uv_layers]
    found["objects"] = sorted(each.name for each in bpy.data.objects)
    return found


def watch_redraws():
    """Begin to note when the viewport is drawn; it is asked to, all the time."""
    bpy.app.driver_namespace["redraws"] = times = []
    draw = bpy.types.SpaceView3D.draw_handler_add(lambda: times.append(time.perf_counter()), (), "WINDOW", "POST_PIXEL")

    def again():
        if bpy.app.driver_namespace.get("redraws") is not times:
            bpy.types.SpaceView3D.draw_handler_remove(draw, "WINDOW")
            return None
        _view3d().tag_redraw()
        return TICK

    bpy.app.timers.register(again)


def redraws():
    """Seconds between redraws since `watch_redraws`, and the end of it."""
    times = bpy.app.driver_namespace.pop("redraws")
    return [after - before for before, after in itertools.pairwise(times)]


def _values(mesh, name):
    """Numbers of an attribute of faces; zeros where there is none."""
    values = np.zeros(len(mesh.polygons), dtype=np.int32)
    attribute = mesh.attributes.get(name)
    if attribute is not None:
        attribute.data.foreach_get("value", values)
    return values


def _fingerprint(attribute):
    prop, width = {
        "FLOAT_VECTOR": ("vector", 3), "FLOAT2": ("vector", 2), "BYTE_COLOR": ("color", 4), "FLOAT_COLOR": ("color", 4),
    }.get(attribute.data_type, ("value", 1))  # fmt: skip
    values = np.empty(len(attribute.data) * width, dtype=np.float64)
    attribute.data.foreach_get(prop, values)
    return zlib.crc32(values.tobytes())


def _hovered(kind):
    """The operator or property under the mouse, as `wks_segment.learn` or `n_segments`; "" if there is none."""
    manager = bpy.context.window_manager
    with bpy.context.temp_override(window=_window(), area=_view3d(), region=_region(kind)):
        if bpy.ops.ui.copy_python_command_button.poll():
            bpy.ops.ui.copy_python_command_button()
            return re.sub(r"^bpy\.ops\.|\(.*$", "", manager.clipboard)
        found = bpy.context.property
        return found[1].rpartition(".")[2] if found else ""


def _depsgraph():
    return _window().view_layer.depsgraph


def _window():
    return bpy.context.window_manager.windows[0]


def _view3d():
    return max((area for area in _window().screen.areas if area.type == "VIEW_3D"), key=lambda area: area.width)


def _region(kind):
    return next(region for region in _view3d().regions if region.type == kind)


def _answer(number, failed, value):
    with open(FOLDER + "draft_answer", "w") as file:
        json.dump([number, failed, value], file)
    os.rename(FOLDER + "draft_answer", FOLDER + "answer")


class Desk:
    """Takes a question at a time and works on it, a step a tick."""

    def __init__(self):
        self.number, self.steps = 0, None

    def tick(self):
        """Called by a timer."""
        try:
            if self.steps is None and os.path.exists(FOLDER + "question"):
                with open(FOLDER + "question") as file:
                    self.number, name, arguments = json.load(file)
                os.remove(FOLDER + "question")
                value = globals()[name](*arguments)
                if hasattr(value, "send"):
                    self.steps = value
                else:
                    _answer(self.number, False, value)
            elif self.steps is not None:
                next(self.steps)
        except StopIteration as end:
            self.steps = None
            _answer(self.number, False, end.value)
        except Exception:
            self.steps = None
            _answer(self.number, True, traceback.format_exc())
        return TICK


if __name__ == "__main__":
    bpy.context.preferences.view.show_splash = False
    if not os.path.exists(FOLDER + "beautiful"):  # without a graphics card each redraw would take half a second
        bpy.context.preferences.system.viewport_aa = "OFF"
    bpy.app.timers.register(Desk().tick, first_interval=1.0, persistent=True)
