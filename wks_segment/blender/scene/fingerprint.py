"""Fingerprints of data-blocks: hashes of everything that an artist can change of them, to tell whether it was changed.

Nothing is listed that counts as work: all properties that Blender has are read, those of add-ons and custom properties
among them, except the few that change without an artist. What a data-block owns belongs to it (nodes, shape keys, the
mesh of an object); what it only uses counts by its label, which is its name or its number in this session.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from hashlib import blake2b
from typing import Any, TypeAlias
from uuid import uuid4

import bpy
import numpy as np

from .attributes import read_numbers, read_pixels

CHANGING_BY_THEMSELVES = frozenset({
    # Kept by Blender for itself, other from session to session.
    "rna_type", "original", "users", "use_extra_user", "tag", "session_uid", "preview", "library",
    "library_weak_reference", "override_library", "is_valid", "texture_paint_images", "texture_paint_slots",
    "paint_active_slot", "paint_clone_slot", "from", "id_root", "storage_type",
    # Computed from other properties.
    "name_full", "dimensions", "matrix_world", "matrix_local", "matrix_basis", "bound_box", "loop_triangles",
    "loop_triangle_polygons", "vertex_normals", "polygon_normals", "corner_normals", "color_attributes",
    "vertex_colors", "normal", "area", "center", "index", "texspace_location", "texspace_size", "pixels",
    # What was clicked on, or is open in a panel.
    "select", "select_control_point", "select_left_handle", "select_right_handle", "show_expanded", "mode",
    # Reading these adds attributes in Blender 4.2; attributes are read anyway.
    "vertex_selection", "edge_selection", "pin", "select_edge", "uv_layer_clone", "uv_layer_stencil",
})  # fmt: skip
"""Properties that change without work of an artist."""
LASTING_CHOICES = ("active_render", "active_clone")
"""Properties whose names start with "active" as those of selections do, and that an artist chooses to last."""
DONE_BY_BUTTONS = frozenset({"is_bind", "is_bound", "is_baked", "is_cached", "is_edited"})
"""Read-only properties that tell what an artist did with a button: bind a modifier, bake a simulation, comb hair."""
SELECTION_ATTRIBUTES = (".select_", ".uv_select_", ".vs.", ".es.")
"""What the names of attributes start with that hold selections."""
OUR_PREFIX = "wks_segment"
"""What the names of all our custom properties start with."""
DEEPEST = 40
"""Levels of properties within properties; Blender's own have fewer than ten."""
THIS_SESSION = uuid4().hex
"""Tells this session of Blender from others."""
Label: TypeAlias = Callable[[bpy.types.ID], str]


def label_of(block: bpy.types.ID) -> str:
    """Type and name of a data-block."""
    return f"{block.bl_rna.identifier} {block.name_full}"


def label_here(block: bpy.types.ID) -> str:
    """A label of a data-block that stays if it is renamed, but holds in this session of Blender only."""
    return f"{block.bl_rna.identifier} {block.session_uid}"


def made_as(hash_with: Callable[[Label], str]) -> dict[str, str]:
    """How something is made, to be kept with it.

    Parameters
    ----------
    hash_with : callable
        Gives a hash of it, in which other data-blocks have a label.
    """
    hashes = {"as": hash_with(label_of), "here": hash_with(label_here)}
    return {**hashes, "session": THIS_SESSION, "by": bpy.app.version_string}


def is_made_as(made: Mapping[str, Any], hash_with: Callable[[Label], str]) -> bool:
    """Whether something is as it was made, by this version of Blender; what it uses may have other names by now."""
    here = made.get("session") == THIS_SESSION and made["here"] == hash_with(label_here)
    return here or bool(made["as"] == hash_with(label_of))


def fingerprint(*blocks: bpy.types.ID, ignored: Collection[str] = (), label: Label = label_of) -> str:
    """Hash of data-blocks with all that they own, but for their names.

    The same in another session of the same version of Blender, if the label of other data-blocks is.

    Parameters
    ----------
    ignored
        Names of properties that do not count.
    label : callable
        Label of a data-block that is used.
    """
    reader = _Reader(blocks, ignored, label)
    digest = blake2b(bpy.app.version_string.encode(), digest_size=16)
    for block in blocks:
        for piece in reader.read(block):
            digest.update(piece if isinstance(piece, bytes) else f"{piece}\n".encode())
    return digest.hexdigest()


def users_of(*blocks: bpy.types.ID) -> dict[bpy.types.ID, list[bpy.types.ID]]:
    """The data-blocks that use each data-block, ordered by name, other than windows, which show everything."""
    windows = (bpy.types.Screen, bpy.types.WindowManager, bpy.types.WorkSpace)
    users = bpy.data.user_map(subset=blocks) if blocks else {}
    return {
        block: sorted((user for user in users[block] if not isinstance(user, windows)), key=label_of)
        for block in blocks
    }  # fmt: skip


class _Reader:
    """Reads all properties of some data-blocks and of what they own, each once."""

    def __init__(self, owned: tuple[bpy.types.ID, ...], ignored: Collection[str], label: Label) -> None:
        self._ignored, self._label = CHANGING_BY_THEMSELVES | set(ignored), label
        self._owned = {block.session_uid for block in owned}
        self._seen: set[tuple[int, str]] = set()
        self._animated: set[str] = set()

    def read(self, block: bpy.types.ID) -> Iterator[str | bytes]:
        """What a data-block has, in a fixed order."""
        before, self._animated = self._animated, _animated_paths(block)
        yield from self._struct(block, 0)
        if isinstance(block, bpy.types.Mesh):
            yield from _mesh_arrays(block)
        if isinstance(block, bpy.types.Image):
            yield read_pixels(block).tobytes()
        self._animated = before

    def _struct(self, struct: Any, depth: int) -> Iterator[str | bytes]:
        identifier = struct.bl_rna.identifier
        self._seen.add((struct.as_pointer(), identifier))
        yield identifier
        for prop in struct.bl_rna.properties:
            name = prop.identifier
            if depth == 0 and name == "name":  # gets a number when a file is appended
                continue
            if name in self._ignored or (name.startswith("active") and name not in LASTING_CHOICES):
                continue
            if prop.type == "COLLECTION":
                yield f"{name}:"
                yield from self._collection(getattr(struct, name), depth)
                yield from self._choices(getattr(struct, name))
            elif prop.type == "POINTER":
                yield f"{name}:"
                yield from self._pointer(getattr(struct, name), depth)
            elif self._is_chosen(struct, prop):
                yield f"{name}={_plain(getattr(struct, name), self._label)}"
        yield from _custom_properties(struct, self._label)

    def _is_chosen(self, struct: Any, prop: bpy.types.Property) -> bool:
        """Whether a property has a value that an artist chooses, rather than animation or Blender."""
        # Read-only types tell what a thing is; other read-only values follow from the rest, or from the frame.
        if prop.is_readonly and prop.type != "ENUM":
            return prop.identifier in DONE_BY_BUTTONS
        if prop.identifier == "use_nodes" and bpy.app.version >= (5, 0, 0):
            return False  # always true since then
        return not (self._animated and _path(struct, prop.identifier) in self._animated)

    def _pointer(self, value: Any, depth: int) -> Iterator[str | bytes]:
        if value is None:
            yield "None"
        elif isinstance(value, bpy.types.ID):
            # Shape keys belong to one mesh, node trees of materials and the like to what they are embedded in.
            owned = value.is_embedded_data or isinstance(value, bpy.types.Key) or value.session_uid in self._owned
            if owned and (value.as_pointer(), value.bl_rna.identifier) not in self._seen:
                yield from self.read(value)
            else:
                yield self._label(value)
        elif (value.as_pointer(), value.bl_rna.identifier) in self._seen or depth > DEEPEST:
            yield str(getattr(value, "name", value.bl_rna.identifier))
        else:
            yield from self._struct(value, depth + 1)

    def _choices(self, items: Any) -> Iterator[str]:
        """What was chosen of a collection as a whole, as which colors are rendered."""
        for prop in items.bl_rna.properties if hasattr(items, "bl_rna") else ():
            name = prop.identifier
            if prop.type in ("INT", "STRING") and not prop.is_readonly and not name.startswith("active"):
                yield f"{name}={getattr(items, name)}"

    def _collection(self, items: Any, depth: int) -> Iterator[str | bytes]:
        if len(items) == 0:
            return
        if _is_array(items[0]):
            yield from _array(items)
            return
        if isinstance(items[0], bpy.types.Attribute):  # Edit Mode orders them anew
            items = sorted(items, key=lambda attribute: attribute.name)
            items = [attribute for attribute in items if not attribute.name.startswith(SELECTION_ATTRIBUTES)]
        for item in items:
            yield from self._pointer(item, depth) if isinstance(item, bpy.types.ID) else self._struct(item, depth + 1)


def _is_array(item: Any) -> bool:
    """Whether an item of a collection is one of many elements of a mesh, an attribute or a shape key."""
    name = item.bl_rna.identifier
    many = ("AttributeValue", "ShapeKeyPoint", "ShapeKeyCurvePoint", "MeshUVLoop", "MeshLoopColor", "MeshSkinVertex")
    return isinstance(
        item, bpy.types.MeshVertex | bpy.types.MeshEdge | bpy.types.MeshLoop | bpy.types.MeshPolygon
    ) or name.endswith(many)


def _array(items: Any) -> Iterator[str | bytes]:
    """The numbers of all elements of a collection, property by property."""
    for prop in items[0].bl_rna.properties:
        if prop.identifier in CHANGING_BY_THEMSELVES or prop.type not in ("BOOLEAN", "INT", "FLOAT"):
            continue
        if prop.is_readonly and not isinstance(items[0], bpy.types.MeshPolygon | bpy.types.MeshLoop):
            continue
        if isinstance(items[0], bpy.types.MeshPolygon) and prop.identifier == "vertices":
            continue  # as many as the polygon has, which cannot be read at once; its loops have them
        numbers = read_numbers(items, prop)
        if numbers is not None:
            yield prop.identifier
            yield numbers.tobytes()


def _mesh_arrays(mesh: bpy.types.Mesh) -> Iterator[str | bytes]:
    """What a mesh has that is not in the properties of its elements: weights and custom normals."""
    weights = [(i, g.group, g.weight) for i, vertex in enumerate(mesh.vertices) for g in vertex.groups]
    yield np.array(weights, dtype=np.float64).tobytes()
    if mesh.has_custom_normals:
        yield np.array([tuple(normal.vector) for normal in mesh.corner_normals], dtype=np.float32).tobytes()


def _custom_properties(struct: Any, label: Label) -> Iterator[str]:
    """Custom properties that are neither ours nor properties of an add-on, which are read with all others."""
    try:
        items = sorted(struct.items(), key=lambda item: item[0])
    except (TypeError, AttributeError):  # a type that has none
        return
    for key, value in items:
        if not key.startswith(OUR_PREFIX) and key not in struct.bl_rna.properties:
            yield f"[{key}]={_plain(value, label)}"


def _plain(value: Any, label: Label) -> Any:
    """A value in a form that prints the same in every session."""
    if isinstance(value, bpy.types.ID):
        return label(value)
    if hasattr(value, "to_dict"):
        return {key: _plain(value[key], label) for key in sorted(value.keys())}
    if isinstance(value, set):
        return sorted(value)
    if hasattr(value, "to_list"):
        return value.to_list()
    if not isinstance(value, str) and hasattr(value, "__len__"):
        return [_plain(each, label) for each in value]
    # Custom properties that are true or false can be numbers when a file is opened again.
    return repr(int(value) if isinstance(value, bool) else value)


def _path(struct: Any, name: str) -> str:
    try:
        return str(struct.path_from_id(name))
    except ValueError:
        return ""


def _animated_paths(block: bpy.types.ID) -> set[str]:
    """Paths of the properties of a data-block that actions, strips and drivers move."""
    data = getattr(block, "animation_data", None)
    if data is None:
        return set()
    actions = [data.action, *(strip.action for track in data.nla_tracks for strip in track.strips)]
    curves = [*data.drivers, *(curve for action in actions if action is not None for curve in _curves(action))]
    return {curve.data_path for curve in curves}


def _curves(action: bpy.types.Action) -> Iterator[bpy.types.FCurve]:
    """The curves of an action, of all its slots."""
    if hasattr(action, "fcurves"):
        yield from action.fcurves
        return
    for layer in action.layers:
        for strip in layer.strips:
            for bag in strip.channelbags:
                yield from bag.fcurves
