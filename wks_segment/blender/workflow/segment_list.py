"""The list of segments: what stands in it, what a person notes on them, and how the meshes follow."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from typing import TYPE_CHECKING

import bpy
import numpy as np

from ...core import PartNotes
from ...core.mesh.triangle_mesh import IntArray
from ...core.user_labels import LONGEST_NAME
from ..outputs.labels import has_labels, labels_on
from ..outputs.ledger import NOTE, note_of
from ..outputs.materials import COMPONENT, recolor_material
from ..outputs.overrides import by_hand, keep_by_hand, model_labels, rewrite
from ..outputs.vertex_groups import rename_group
from ..parts import part_ids
from ..parts.palette import most_different
from ..parts.part_style import Style
from ..scene.attributes import read_bools, read_floats, write_attribute
from ..scene.characters import Character, mesh_objects, with_rigged
from ..scene.poses import polygon_ranges
from ..scene.topology import at_corners

if TYPE_CHECKING:
    from ..props.settings import WKSSegmentSettings

SAME = 0.5
"""Share of two parts' common area above which one of a new model is the other of the old one. Only one can be."""


def labeled(settings: WKSSegmentSettings, everywhere: bool = False) -> list[bpy.types.Object]:
    """Objects of the scene with labels: those in Edit Mode, or the selected ones, or all if there are none of either.

    All, too, if all are asked for.
    """
    ours = [obj for obj in settings.id_data.objects if obj.type == "MESH" and has_labels(obj.data)]
    found = [obj for obj in mesh_objects(ours) if obj.library is None and obj.data.library is None]
    if everywhere:
        return found
    in_edit_mode = [obj for obj in found if obj.mode == "EDIT"]
    objects = settings.id_data.objects
    chosen = with_rigged((obj for obj in objects if obj.select_get()), (obj for obj in objects if obj.visible_get()))
    return in_edit_mode or [obj for obj in found if obj in chosen] or found


def meshes_of(objects: list[bpy.types.Object]) -> list[bpy.types.Mesh]:
    """Meshes of objects, each once."""
    return list(dict.fromkeys(obj.data for obj in objects))


def fill(settings: WKSSegmentSettings) -> None:
    """List the segments that the labeled objects have now, with their shares of the area; the active one stays."""
    active = active_part(settings)
    area: dict[int, float] = {}
    seen: dict[int, bool] = {}
    settings.faces_by_hand = 0
    for obj in labeled(settings):
        labels = labels_on(obj.data)
        if labels is None:
            continue
        # An object's scale counts, since a character's objects can have different ones.
        scale = abs(np.linalg.det(np.array(obj.matrix_world)[:3, :3])) ** (2 / 3)
        areas = scale * read_floats(obj.data.polygons, "area")
        shown = ~read_bools(obj.data.polygons, "hide")
        for part in np.unique(labels).tolist():
            mine = labels == part
            area[part] = area.get(part, 0.0) + float(areas[mine].sum())
            seen[part] = seen.get(part, False) or bool(shown[mine].any())
        settings.faces_by_hand += int((by_hand(obj.data) >= 0).sum())
    total = sum(area.values()) or 1.0
    settings.segments.clear()
    for part in part_ids.unique_parts(np.array(list(area), dtype=np.int64)):
        item = settings.segments.add()
        item.number, item.share, item.hidden = part, 100 * area[part] / total, not seen[part]
        if part == active:
            settings.active_segment = len(settings.segments) - 1
    settings.active_segment = max(min(settings.active_segment, len(settings.segments) - 1), 0)


def active_part(settings: WKSSegmentSettings) -> int | None:
    """Number of the segment that is active in the list; None if the list is empty."""
    index = settings.active_segment
    return settings.segments[index].number if index < len(settings.segments) else None


def activate(settings: WKSSegmentSettings, part: int) -> None:
    """Make a segment of the list the active one."""
    numbers = [item.number for item in settings.segments]
    if part in numbers:
        settings.active_segment = numbers.index(part)


def rewrite_all(settings: WKSSegmentSettings, objects: list[bpy.types.Object] | None = None) -> None:
    """Write the labels of objects (None: of all in the scene) anew with the edits of now, and list them."""
    notes = settings.notes()
    for mesh in meshes_of(labeled(settings, everywhere=True) if objects is None else objects):
        rewrite(mesh, settings.style(), notes.joined)
    fill(settings)


def rename(settings: WKSSegmentSettings, part: int, name: str) -> None:
    """Call a part by a name, and what it is on the other side by the same with the other suffix, everywhere.

    A name that another part has gets a number. An empty one gives back the part's own.
    """
    notes, style = settings.notes(), settings.style()
    siblings = part_ids.siblings_of(part)
    numbers = {*notes.names, *(item.number for item in settings.segments)} - set(siblings)
    taken = {style.name_of(number) for number in numbers}
    base = "".join(letter for letter in name if letter.isprintable()).strip()
    wanted = {sibling: _suffixed(base, sibling) for sibling in siblings}
    repeated = 1
    while base and taken & set(wanted.values()):
        repeated += 1
        wanted = {
            sibling: _suffixed(base, sibling, f"{'.' if base[-1].isdigit() else ' '}{repeated}") for sibling in siblings
        }
    others = {number: other for number, other in notes.names.items() if number not in siblings}
    names = {sibling: new for sibling, new in wanted.items() if base and new != part_ids.default_name(sibling)}
    settings.keep_notes(replace(notes, names=others | names))
    for sibling in siblings:
        restyle(settings, sibling, color=False)


def recolor(settings: WKSSegmentSettings, part: int, color: tuple[float, float, float]) -> None:
    """Give a part a color, everywhere."""
    notes = settings.notes()
    settings.keep_notes(replace(notes, colors={**notes.colors, part: color}))
    restyle(settings, part, name=False)


def restyle(settings: WKSSegmentSettings, part: int, name: bool = True, color: bool = True) -> None:
    """Let the name or the color of a part, where it is written, be that of now."""
    style = settings.style()
    meshes = meshes_of(labeled(settings, everywhere=True))
    for mesh in meshes if name else ():
        rename_group(mesh, mesh[NOTE], part, style)
    with object_mode(bpy.context) if color else nullcontext():
        for mesh in meshes if color else ():
            _recolor_faces(mesh, part, style)
    for material in bpy.data.materials:
        if material.get(COMPONENT) == part and material.library is None:
            if name:
                material.name = style.name_of(part)
            if color:
                recolor_material(material, part, style)


def make_part(settings: WKSSegmentSettings, name: str, side: int = 0) -> int:
    """A new part of that name (or one with a number), in a color that is far from all others; gives its number."""
    notes, style = settings.notes(), settings.style()
    taken = {item.number for item in settings.segments} | notes.names.keys() | notes.joined.keys()
    for mesh in meshes_of(labeled(settings, everywhere=True)):
        taken |= set(np.unique(by_hand(mesh)).tolist())
    taken.discard(-1)
    part = part_ids.free_part(taken, side)
    used = {item.number for item in settings.segments} | notes.colors.keys()
    color = most_different(style.colors_of(np.array(sorted(used), dtype=np.int64)))
    red, green, blue = color.tolist()
    settings.keep_notes(replace(notes, colors={**notes.colors, part: (red, green, blue)}))
    rename(settings, part, name)
    return part


def carry_over(settings: WKSSegmentSettings, labels: Mapping[Character, IntArray]) -> None:
    """Let names, colors and what is by hand follow the parts from an old model's numbers to those of a new one.

    To be called with the new labels, before they are written. A part is another one's successor if it covers more than
    half of what the two cover. What was given by hand to a part without a successor is a part of its own from then on.
    """
    notes, style = settings.notes(), settings.style()
    given = {mesh: by_hand(mesh) for mesh in meshes_of(labeled(settings, everywhere=True))}
    present = {part for found in given.values() for part in np.unique(found[found >= 0]).tolist()}
    new = _successors(labels) | {part: part for part in present if part % part_ids.SIDE_STEP >= part_ids.FIRST_MADE}
    settings.keep_notes(
        PartNotes(
            {new[part]: name for part, name in notes.names.items() if part in new},
            {new[part]: color for part, color in notes.colors.items() if part in new},
            {new[part]: new[other] for part, other in notes.joined.items() if part in new and other in new},
        )
    )
    for part in sorted(present - new.keys()):
        new[part] = make_part(settings, style.name_of(part), part // part_ids.SIDE_STEP)
    for mesh, found in given.items():
        if (found >= 0).any():
            keep_by_hand(mesh, np.array([new.get(part, -1) for part in found.tolist()]))


def _successors(labels: Mapping[Character, IntArray]) -> dict[int, int]:
    """For each part that is on meshes now, the one that takes its place among new labels, if there is one."""
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
    rows, columns = np.nonzero(common > SAME * either)
    return dict(zip(old_parts[rows].tolist(), new_parts[columns].tolist(), strict=True))


@contextmanager
def object_mode(context: bpy.types.Context) -> Iterator[None]:
    """Leave Edit Mode while the block lasts: only outside it attributes can be read and written as a whole."""
    if context.mode != "EDIT_MESH":
        yield
        return
    edited_objects = list(context.objects_in_mode)
    selected = {obj: obj.select_get() for obj in context.view_layer.objects}
    bpy.ops.object.mode_set(mode="OBJECT")
    try:
        yield
    finally:
        # Blender enters Edit Mode with all that is selected.
        for obj in selected:
            obj.select_set(obj in edited_objects)
        bpy.ops.object.mode_set(mode="EDIT")
        for obj, was in selected.items():
            obj.select_set(was)


def _suffixed(base: str, part: int, number: str = "") -> str:
    """A name with the suffix of the part's side behind the number, not too long."""
    suffix = part_ids.SIDE_SUFFIXES[part // part_ids.SIDE_STEP]
    base = part_ids.without_side(base) if suffix else base
    return base[: LONGEST_NAME - len(number) - len(suffix)].rstrip() + number + suffix


def _recolor_faces(mesh: bpy.types.Mesh, part: int, style: Style) -> None:
    """Give the corners of a part's faces its color, where colors were written."""
    labels, colors = labels_on(mesh), mesh.color_attributes.get(note_of(mesh).get("colors", ""))
    if labels is None or colors is None:
        return
    corners = at_corners(mesh, labels == part)
    painted = read_floats(colors.data, "color_srgb", 4)
    painted[corners, :3] = style.colors_of(np.array([part]))
    write_attribute(colors, painted)
    mesh.update()
