"""The list of segments: its rows, the names and colors that the user gives, and how the meshes follow."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager, nullcontext
from dataclasses import replace

import bpy
import numpy as np

from ...core import PartNotes
from ...core.mesh.triangle_mesh import IntArray
from ...core.user_labels import LONGEST_NAME
from ..outputs.color_attribute import recolor_faces
from ..outputs.labels import rewrite_labels
from ..outputs.overrides import by_hand, keep_by_hand, model_labels
from ..outputs.part_attributes import has_labels, labels_on
from ..outputs.part_materials import part_of, restyle_material
from ..outputs.separate import followed
from ..outputs.vertex_groups import rename_group
from ..parts import part_ids
from ..parts.palette import most_different
from ..props.settings import WKSSegmentSettings
from ..scene.attributes import read_bools, read_floats
from ..scene.characters import Character, mesh_objects, polygon_ranges, with_rigged
from ..scene.simulations import may_change
from .all_or_nothing import all_or_nothing

SUCCESSOR_OVERLAP = 0.5
"""Common area of an old and a new part, as a share of what they cover together, above which the new part is the old
one's successor. At one half or more a part has at most one successor."""


def labeled(settings: WKSSegmentSettings, everywhere: bool = False) -> list[bpy.types.Object]:
    """Objects of the scene with labels: those in Edit Mode, or else the selected ones, or else all.

    With `everywhere` always all of them.
    """
    with_labels = [obj for obj in settings.id_data.objects if obj.type == "MESH" and has_labels(obj.data)]
    local = [obj for obj in mesh_objects(with_labels) if obj.library is None and obj.data.library is None]
    if everywhere:
        return local
    # In Object Mode, an object is in Edit Mode only in another window or beside the active one.
    in_edit_mode = [obj for obj in local if obj.mode == "EDIT" and bpy.context.mode == "EDIT_MESH"]
    objects = settings.id_data.objects
    selected = with_rigged((obj for obj in objects if obj.select_get()), (obj for obj in objects if obj.visible_get()))
    return in_edit_mode or [obj for obj in local if obj in selected] or local


def meshes_of(objects: list[bpy.types.Object]) -> list[bpy.types.Mesh]:
    """Meshes of objects, each once."""
    return list(dict.fromkeys(obj.data for obj in objects))


def fill(settings: WKSSegmentSettings) -> None:
    """List the parts on the labeled objects with their shares of the area. The active part stays active."""
    active = active_part(settings)
    area: dict[int, float] = {}
    visible: dict[int, bool] = {}
    settings.faces_by_hand = 0
    for obj in labeled(settings):
        labels = labels_on(obj.data)
        if labels is None or (obj.data.is_editmode and bpy.context.mode != "EDIT_MESH"):
            continue
        # An object's scale counts, since the objects of a character can have different ones.
        scale = abs(np.linalg.det(np.array(obj.matrix_world)[:3, :3])) ** (2 / 3)
        areas = scale * read_floats(obj.data.polygons, "area")
        shown = ~read_bools(obj.data.polygons, "hide")
        for part in np.unique(labels).tolist():
            in_part = labels == part
            area[part] = area.get(part, 0.0) + float(areas[in_part].sum())
            visible[part] = visible.get(part, False) or bool(shown[in_part].any())
        settings.faces_by_hand += int((by_hand(obj.data) >= 0).sum())
    total = sum(area.values()) or 1.0
    settings.segments.clear()
    for part in part_ids.unique_parts(np.array(list(area), dtype=np.int64)):
        item = settings.segments.add()
        item.number, item.share, item.hidden = part, 100 * area[part] / total, not visible[part]
        if part == active:
            settings.active_segment = len(settings.segments) - 1
    settings.active_segment = max(min(settings.active_segment, len(settings.segments) - 1), 0)


def active_part(settings: WKSSegmentSettings) -> int | None:
    """Number of the active part in the list; None if the list is empty."""
    index = settings.active_segment
    return settings.segments[index].number if index < len(settings.segments) else None


def activate(settings: WKSSegmentSettings, part: int) -> None:
    """Make a part the active one, if it is in the list."""
    numbers = [item.number for item in settings.segments]
    if part in numbers:
        settings.active_segment = numbers.index(part)


def rewrite_all(settings: WKSSegmentSettings, objects: list[bpy.types.Object] | None = None) -> list[str]:
    """Write the labels of objects (None: of all in the scene) again with the user's current edits, and list them.

    Returns
    -------
    list of str
        What was not taken back of the labels before, and why.
    """
    warnings: list[str] = []
    notes, written = settings.notes(), labeled(settings, everywhere=True) if objects is None else objects
    with followed(written):
        for mesh in meshes_of(written):
            rewrite_labels(mesh, settings.style(), notes.joined, warnings)
    fill(settings)
    return warnings


def rename(settings: WKSSegmentSettings, part: int, name: str) -> None:
    """Rename a part and its other side, with the suffix of each side, wherever their names are written.

    A name that another part has gets a number. An empty name restores the default.
    """
    notes, style = settings.notes(), settings.style()
    siblings = part_ids.siblings_of(part)
    numbers = {*notes.names, *(item.number for item in settings.segments)} - set(siblings)
    taken = {style.name_of(number) for number in numbers}
    base = "".join(letter for letter in name if letter.isprintable()).strip()
    new_names = {sibling: _suffixed(base, sibling) for sibling in siblings}
    repeated = 1
    while base and taken & set(new_names.values()):
        repeated += 1
        number = f"{'.' if base[-1].isdigit() else ' '}{repeated}"
        new_names = {sibling: _suffixed(base, sibling, number) for sibling in siblings}
    other_names = {number: other for number, other in notes.names.items() if number not in siblings}
    names = {sibling: new for sibling, new in new_names.items() if base and new != part_ids.default_name(sibling)}
    settings.keep_notes(replace(notes, names=other_names | names))
    for sibling in siblings:
        restyle(settings, sibling, color=False)


def recolor(settings: WKSSegmentSettings, part: int, color: tuple[float, float, float]) -> None:
    """Give a part a color wherever its color is written."""
    notes = settings.notes()
    settings.keep_notes(replace(notes, colors={**notes.colors, part: color}))
    restyle(settings, part, name=False)


def restyle(settings: WKSSegmentSettings, part: int, name: bool = True, color: bool = True) -> None:
    """Write the current name or color of a part wherever it is written already."""
    style, objects = settings.style(), labeled(settings, everywhere=True)
    with leaving_edit_mode(bpy.context) if color else nullcontext(), followed(objects):
        # A mesh can be in Edit Mode in another window; one whose simulation is not baked follows with its next labels.
        meshes = [mesh for mesh in meshes_of(objects) if may_change(mesh)]
        for mesh in (mesh for mesh in meshes if not mesh.is_editmode or not color):
            if name:
                rename_group(mesh, part, style)
            if color:
                recolor_faces(mesh, part, style)
        for material in bpy.data.materials:
            if part_of(material) == part:
                restyle_material(material, style, name, color)


def make_part(settings: WKSSegmentSettings, name: str, side: int = 0) -> int:
    """Add a part with this name and a color that is far from all others; return its number."""
    notes, style = settings.notes(), settings.style()
    taken = {item.number for item in settings.segments} | notes.names.keys() | notes.joined.keys()
    for mesh in meshes_of(labeled(settings, everywhere=True)):
        taken |= set(np.unique(by_hand(mesh)).tolist())
    taken.discard(-1)
    part = part_ids.free_part(taken, side)
    colored = {item.number for item in settings.segments} | notes.colors.keys()
    color = most_different(style.colors_of(np.array(sorted(colored), dtype=np.int64)))
    red, green, blue = color.tolist()
    settings.keep_notes(replace(notes, colors={**notes.colors, part: (red, green, blue)}))
    rename(settings, part, name)
    return part


def carry_over(settings: WKSSegmentSettings, labels: Mapping[Character, IntArray]) -> None:
    """Carry names, colors and faces by hand over from the parts of an old model to their successors in a new one.

    Call it with the new labels before they are written. A part's successor covers more than half of the area that the
    two cover together. Faces by hand of a part without a successor become a new part.
    """
    notes, style = settings.notes(), settings.style()
    by_hand_on = {mesh: by_hand(mesh) for mesh in meshes_of(labeled(settings, everywhere=True))}
    present = {part for parts in by_hand_on.values() for part in np.unique(parts[parts >= 0]).tolist()}
    made = {part: part for part in present if part % part_ids.SIDE_STEP >= part_ids.FIRST_MADE}
    new = _successors(labels) | made
    settings.keep_notes(
        PartNotes(
            {new[part]: name for part, name in notes.names.items() if part in new},
            {new[part]: color for part, color in notes.colors.items() if part in new},
            {new[part]: new[into] for part, into in notes.joined.items() if part in new and into in new},
        )
    )
    for part in sorted(present - new.keys()):
        new[part] = make_part(settings, style.name_of(part), part // part_ids.SIDE_STEP)
    for mesh, parts in by_hand_on.items():
        if (parts >= 0).any():
            keep_by_hand(mesh, np.array([new.get(part, -1) for part in parts.tolist()]))


def _successors(labels: Mapping[Character, IntArray]) -> dict[int, int]:
    """Successor among new labels of each part that is on the meshes and has one."""
    before, after, areas = [], [], []
    for character, new in labels.items():
        for obj, polygons in polygon_ranges(character):
            old = model_labels(obj.data)
            if old is not None:
                before.append(old)
                after.append(new[polygons])
                areas.append(read_floats(obj.data.polygons, "area"))
    if not before:
        return {}
    old_parts, row = np.unique(np.concatenate(before), return_inverse=True)
    new_parts, column = np.unique(np.concatenate(after), return_inverse=True)
    common = np.zeros((len(old_parts), len(new_parts)))
    np.add.at(common, (row.ravel(), column.ravel()), np.concatenate(areas))
    either = common.sum(axis=1, keepdims=True) + common.sum(axis=0) - common
    rows, columns = np.nonzero(common > SUCCESSOR_OVERLAP * either)
    return dict(zip(old_parts[rows].tolist(), new_parts[columns].tolist(), strict=True))


@contextmanager
def leaving_edit_mode(context: bpy.types.Context) -> Iterator[None]:
    """Leave Edit Mode for the block, because Blender reads and writes whole attributes only outside it.

    An error in the block leaves everything as it was before.
    """
    if context.mode != "EDIT_MESH":
        yield
        return
    edited = list(context.objects_in_mode)
    selected = {obj: obj.select_get() for obj in context.view_layer.objects}
    bpy.ops.object.mode_set(mode="OBJECT")
    try:
        with all_or_nothing(context):
            yield
    finally:
        # Blender enters Edit Mode with all selected objects.
        for obj in selected:
            obj.select_set(obj in edited)
        bpy.ops.object.mode_set(mode="EDIT")
        for obj, was_selected in selected.items():
            obj.select_set(was_selected)


def _suffixed(base: str, part: int, number: str = "") -> str:
    """A name with a number and the suffix of the part's side, shortened if it is too long."""
    suffix = part_ids.SIDE_SUFFIXES[part // part_ids.SIDE_STEP]
    base = part_ids.without_side(base) if suffix else base
    return base[: LONGEST_NAME - len(number) - len(suffix)].rstrip() + number + suffix
