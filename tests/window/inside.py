"""Answer questions about Blender's window and data; runs inside the Blender of the window tests.

Blender runs this file at its start. The driver writes the name of a function and its arguments to a file, and reads the
result from another one. A function that yields is continued after the next redraw. Positions are in pixels from the top
left of the screen.
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
TIMER_SECONDS = 0.04
"""Time between two checks for a question."""
PROBE_STEP = 9
"""Vertical distance of the points that `button` probes: half the height of a button."""
PROBE_COLUMNS = (0.62, 0.4, 0.85, 0.2)
"""Horizontal positions that it probes, relative to the width: fields and wide buttons, halves and thirds of rows."""


def ready():
    """Whether the window is drawn."""
    yield from settle()
    return True


def settle():
    """Wait for events and redraws."""
    for _ in range(2):
        _view3d().tag_redraw()
        yield


def antialias(on):
    """Draw smooth edges, for pictures: without a graphics card each redraw takes half a second then."""
    bpy.context.preferences.system.viewport_aa = "8" if on else "OFF"
    yield from settle()


def region(kind):
    """[x, y, width, height] of a region of the 3D viewport: WINDOW, UI, HUD, HEADER."""
    found = _region(kind)
    return [found.x, _window().height - found.y - found.height, found.width, found.height]


def tab():
    """The open tab of the side panel; "" while it is hidden."""
    return _region("UI").active_panel_category if _view3d().spaces.active.show_region_ui else ""


def buttons(wanted="", below=0, kind="UI"):
    """{name: [x, y]} of the buttons of operators and properties in a region below a height: all, or up to a wanted one.

    The mouse is moved down one column after the other. At each point Blender tells what Ctrl-C would copy there.
    """
    left, top, width, height = region(kind)
    found = {}
    for across in PROBE_COLUMNS:
        x = int(left + across * width)
        for y in range(max(top, below) + PROBE_STEP, top + height, PROBE_STEP):
            _window().cursor_warp(x, _window().height - y)
            yield
            here = _hovered(kind)
            if here and here == wanted:
                yield from settle()  # while a job runs, Blender lags behind the mouse: it may still be where it was
                here = _hovered(kind)
            if here:
                found.setdefault(here, [x, y + PROBE_STEP // 3])  # a list has its name in each row
            if here and here == wanted:
                return found
            last = max((place[1] for place in found.values()), default=max(top + 400, below))
            if not here and y > last + 26 * PROBE_STEP:
                break  # below the last panel
    return found


def button_at(x, y, kind="UI"):
    """Operator or property at a point of a region; "" if there is none."""
    _window().cursor_warp(x, _window().height - y)
    yield from settle()
    return _hovered(kind)


def place_of(name):
    """[x, y] of the vertex of an object that is nearest to the viewer; a click there selects the object."""
    area, space = _region("WINDOW"), _view3d().spaces.active.region_3d
    obj = bpy.data.objects[name]
    points = [obj.matrix_world @ vertex.co for vertex in obj.evaluated_get(_depsgraph()).data.vertices]
    depths = [(space.view_matrix @ point).z for point in points]
    spot = location_3d_to_region_2d(area, space, points[depths.index(max(depths))])
    return [int(area.x + spot.x), int(_window().height - area.y - spot.y)]


def place_at(name, point):
    """[x, y] of a point in the space of an object."""
    area, space = _region("WINDOW"), _view3d().spaces.active.region_3d
    spot = location_3d_to_region_2d(area, space, bpy.data.objects[name].matrix_world @ Vector(point))
    return [int(area.x + spot.x), int(_window().height - area.y - spot.y)]


def view():
    """Numbers of the view matrix."""
    return [value for row in _view3d().spaces.active.region_3d.view_matrix for value in row]


def zoom_to_all(azimuth=-60.0, height=75.0):
    """View everything from the side, as the start of a test."""
    area = _view3d()
    area.spaces.active.region_3d.view_rotation = Euler((radians(height), 0, radians(azimuth))).to_quaternion()
    yield from settle()
    with bpy.context.temp_override(window=_window(), area=area, region=_region("WINDOW")):
        bpy.ops.view3d.view_all()
    yield from settle()
    # Move it to the left, so that the side panel does not cover it.
    eye = area.spaces.active.region_3d
    eye.view_location += eye.view_rotation @ Vector((0.13 * eye.view_distance, 0, 0))
    eye.view_distance *= 1.15
    yield from settle()


def state():
    """Selection, settings, model and file."""
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
    """{part: number of faces} of an object; empty if it has no segments."""
    mesh = bpy.data.objects[name].data
    if "wks_segment" not in mesh.attributes:
        return {}
    found = np.unique(_values(mesh, "wks_segment"), return_counts=True)
    return {str(part): int(count) for part, count in zip(*found, strict=True)}


def parts_of_faces(name):
    """Number of the part of each face of an object that has segments."""
    return _values(bpy.data.objects[name].data, "wks_segment").tolist()


def clipboard():
    """The text of the clipboard."""
    return bpy.context.window_manager.clipboard


def color_ids(name):
    """The (linear) colors that masks of Ucupaint find on an object."""
    mesh = bpy.data.objects[name].data
    attribute = mesh.color_attributes.get("__yp_color_id")
    return [] if attribute is None else np.unique([list(value.color) for value in attribute.data], axis=0).tolist()


def rows():
    """The list of segments: [name, share, hidden, number of selected faces] of each."""
    mesh = _window().view_layer.objects.active.data
    chosen = []
    if mesh.is_editmode:  # the mesh itself has the state before Edit Mode
        faces = bmesh.from_edit_mesh(mesh).faces
        part = faces.layers.int["wks_segment"]
        chosen = [face[part] for face in faces if face.select]
    return [
        [item.name, item.share, item.hidden, chosen.count(item.number)] for item in _window().scene.wks_segment.segments
    ]


def face_sets(name):
    """Number of face sets of an object."""
    return len(np.unique(_values(bpy.data.objects[name].data, ".sculpt_face_set")))


def image_colors(name):
    """Number of pixels of each color of an image; a color is "r g b a" in bytes."""
    image = bpy.data.images.get(name)
    if image is None:
        return {}
    pixels = np.empty(len(image.pixels), dtype=np.float32)
    image.pixels.foreach_get(pixels)
    found, count = np.unique((pixels.reshape(-1, 4) * 255).round().astype(int), axis=0, return_counts=True)
    return {" ".join(map(str, color)): int(n) for color, n in zip(found, count, strict=True)}


def images():
    """Name of each image."""
    return sorted(image.name for image in bpy.data.images)


def objects():
    """Name and parent of each object."""
    return {obj.name: obj.parent.name if obj.parent else None for obj in bpy.data.objects}


def make_active(name):
    """Make an object active that cannot be clicked, since it lies inside another one."""
    _window().view_layer.objects.active = bpy.data.objects[name]
    yield from settle()


def select_also(*names):
    """Select objects that cannot be clicked, since they lie inside one another."""
    for name in names:
        bpy.data.objects[name].select_set(True, view_layer=_window().view_layer)
    yield from settle()


def edit_material(name, metallic, new_name):
    """Set a value of a material's shader and rename the material, as an artist does in the Properties editor."""
    material = bpy.data.materials[name]
    shader = next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
    shader.inputs["Metallic"].default_value = metallic
    material.name = new_name
    with bpy.context.temp_override(window=_window(), area=_view3d()):
        bpy.ops.ed.undo_push(message="Edit Material")


def materials():
    """How metallic each material is, by name."""
    shaders = {material.name: material.node_tree.nodes.get("Principled BSDF") for material in bpy.data.materials}
    return {name: shader.inputs["Metallic"].default_value for name, shader in shaders.items() if shader is not None}


def job_runs():
    """Whether a job is running."""
    with bpy.context.temp_override(window=_window(), area=_view3d()):
        return bpy.ops.wks_segment.cancel.poll()


def job_is_over():
    """Whether no job is running."""
    return not job_runs()


def first_colors():
    """Number of triangles that are drawn in provisional colors."""
    return len(bpy.context.window_manager.wks_segment_first_colors.preview.corners) // 3


def subdivide(name):
    """Give an object four times its faces, so that learning it takes long."""
    obj = bpy.data.objects[name]
    with bpy.context.temp_override(window=_window(), area=_view3d(), region=_region("WINDOW")):
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.mesh.select_all(action="SELECT")
        bpy.ops.mesh.subdivide()
        bpy.ops.object.mode_set(mode="OBJECT")
        bpy.ops.ed.undo_push(message="Subdivide")
    yield from settle()
    return len(obj.data.polygons)


def n_segments(name, count):
    """Whether an object has a number of segments."""
    return len(segments(name)) == count


def other_segments(name, known):
    """Whether the segments of an object are others than known ones."""
    return segments(name) != known


def groups(name, beginning):
    """Names of the vertex groups of an object with a common beginning."""
    return [group.name for group in bpy.data.objects[name].vertex_groups if group.name.startswith(beginning)]


def contents(name):
    """Hash or value of everything of an object that a user could lose: attributes, slots, groups, weights."""
    obj = bpy.data.objects[name]
    mesh = obj.data
    found = {
        f"attribute {each.name}": [each.domain, each.data_type, _hash_values(each)]
        for each in mesh.attributes
        if not each.name.startswith(".")  # Blender gives some of its own ones a wrong type
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
    """Redraw the viewport all the time, and record the time of each redraw."""
    bpy.app.driver_namespace["redraws"] = times = []
    draw = bpy.types.SpaceView3D.draw_handler_add(lambda: times.append(time.perf_counter()), (), "WINDOW", "POST_PIXEL")

    def again():
        if bpy.app.driver_namespace.get("redraws") is not times:
            bpy.types.SpaceView3D.draw_handler_remove(draw, "WINDOW")
            return None
        _view3d().tag_redraw()
        return TIMER_SECONDS

    bpy.app.timers.register(again)


def redraws():
    """Seconds between redraws since `watch_redraws`, which is ended."""
    times = bpy.app.driver_namespace.pop("redraws")
    return [after - before for before, after in itertools.pairwise(times)]


def _values(mesh, name):
    """Values of an attribute of faces; zeros if there is none."""
    values = np.zeros(len(mesh.polygons), dtype=np.int32)
    attribute = mesh.attributes.get(name)
    if attribute is not None:
        attribute.data.foreach_get("value", values)
    return values


def _hash_values(attribute):
    prop, width = {
        "FLOAT_VECTOR": ("vector", 3), "FLOAT2": ("vector", 2), "BYTE_COLOR": ("color", 4), "FLOAT_COLOR": ("color", 4),
        "INT16_2D": ("value", 2), "INT32_2D": ("value", 2), "QUATERNION": ("value", 4), "FLOAT4X4": ("value", 16),
    }.get(attribute.data_type, ("value", 1))  # fmt: skip
    values = np.empty(len(attribute.data) * width, dtype=np.float64)
    attribute.data.foreach_get(prop, values)
    return zlib.crc32(values.tobytes())


def _hovered(kind):
    """Operator or property under the mouse, such as `wks_segment.learn` or `n_segments`; "" if there is none."""
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


class Responder:
    """Answers one question at a time, one step of it at each call of the timer."""

    def __init__(self):
        self.number, self.steps = 0, None

    def advance(self):
        """Read a question, or continue with the current one; called by a timer."""
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
        return TIMER_SECONDS


if __name__ == "__main__":
    bpy.context.preferences.view.show_splash = False
    antialias(False)
    bpy.app.timers.register(Responder().advance, first_interval=1.0, persistent=True)
