"""The list of segments: its rows, the names and colors that the user gives, and how the meshes follow."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import replace

import bpy
import numpy as np

from ...core.message import Message
from ...core.user_labels import LONGEST_NAME
from ..outputs.color_attribute import recolor_faces
from ..outputs.labels import rewrite_labels
from ..outputs.origin import origin_of
from ..outputs.overrides import by_hand
from ..outputs.part_attributes import has_labels, labels_on
from ..outputs.part_materials import LABELS_PROPERTY, part_of, restyle_material
from ..outputs.separate import followed
from ..outputs.ucupaint import recolor_ids
from ..outputs.vertex_groups import rename_group
from ..parts import part_ids
from ..parts.palette import MAX_COLORS
from ..parts.part_style import Style
from ..props.label_set import notes_of, style_of
from ..props.settings import WKSSegmentSettings
from ..scene.attributes import read_bools, read_floats
from ..scene.characters import mesh_objects, same_body, with_rigged
from ..scene.simulations import may_change
from .all_or_nothing import all_or_nothing

OTHER_COLORS = range(24, MAX_COLORS)
"""Colors of the palette for parts that a person makes: no segment has these, since models hardly have so many."""


def labeled(settings: WKSSegmentSettings) -> list[bpy.types.Object]:
    """Objects that buttons work on: those with labels in Edit Mode, or else the selected ones.

    Only those whose labels are of the same set as those of the active object, since a number means nothing in another.
    """
    subject = shown_object(settings)
    if subject is None:
        return []
    labels = origin_of(subject.data).labels
    return [obj for obj in chosen(settings) if origin_of(obj.data).labels == labels]


def shown_object(settings: WKSSegmentSettings) -> bpy.types.Object | None:
    """The object whose segments are listed: the active one if it has labels, or else the first chosen one."""
    candidates, active = chosen(settings), _active(settings)
    return active if active in candidates else next(iter(candidates), None)


def chosen(settings: WKSSegmentSettings) -> list[bpy.types.Object]:
    """Objects with labels that are in Edit Mode, or else those that are selected, or that a selected armature moves.

    With nothing selected, the active one, or else the first one.
    """
    objects = settings.id_data.objects
    # In Object Mode, an object is in Edit Mode only in another window or beside the active one.
    if bpy.context.mode == "EDIT_MESH":
        in_edit_mode = [obj for obj in _with_labels(objects) if obj.mode == "EDIT"]
        if in_edit_mode:
            return in_edit_mode
    selected = [obj for obj in objects if obj.select_get()]
    if selected:
        return _with_labels(with_rigged(selected, (obj for obj in objects if obj.visible_get())))
    everywhere, active = _with_labels(objects), _active(settings)
    return [active] if active in everywhere else everywhere[:1]


def objects_with(labels: str) -> list[bpy.types.Object]:
    """All objects of the file whose labels are of a set."""
    return [obj for obj in _with_labels(bpy.data.objects) if origin_of(obj.data).labels == labels]


def _active(settings: WKSSegmentSettings) -> bpy.types.Object | None:
    """The active object, if it is in the scene of these settings."""
    active = bpy.context.view_layer.objects.active
    return active if bpy.context.scene == settings.id_data else None


def _with_labels(objects: Iterable[bpy.types.Object]) -> list[bpy.types.Object]:
    """Objects of this file with labels."""
    found = mesh_objects(obj for obj in objects if obj.type == "MESH" and has_labels(obj.data))
    return [obj for obj in found if obj.library is None and obj.data.library is None]


def meshes_of(objects: list[bpy.types.Object]) -> list[bpy.types.Mesh]:
    """Meshes of objects, each once."""
    return list(dict.fromkeys(obj.data for obj in objects))


def fill(settings: WKSSegmentSettings) -> None:
    """List the parts of the active object's character with their shares of its area. The active part stays active.

    The fields keep what they show: `followed_settings.follow_active` changes them, too.
    """
    active, subject = active_part(settings), shown_object(settings)
    settings.shown = "" if subject is None else subject.data.name
    area: dict[int, float] = {}
    visible: dict[int, bool] = {}
    settings.faces_by_hand = sum(_count_by_hand(mesh) for mesh in meshes_of(labeled(settings)) if _is_readable(mesh))
    for obj in [] if subject is None else _character_of(subject):
        labels = labels_on(obj.data)
        if labels is None or not _is_readable(obj.data):
            continue
        # An object's scale counts, since the objects of a character can have different ones.
        scale = abs(np.linalg.det(np.array(obj.matrix_world)[:3, :3])) ** (2 / 3)
        areas = scale * read_floats(obj.data.polygons, "area")
        shown = ~read_bools(obj.data.polygons, "hide")
        for part in np.unique(labels).tolist():
            in_part = labels == part
            area[part] = area.get(part, 0.0) + float(areas[in_part].sum())
            visible[part] = visible.get(part, False) or bool(shown[in_part].any())
    total = sum(area.values()) or 1.0
    settings.segments.clear()
    for part in part_ids.unique_parts(np.array(list(area), dtype=np.int64)):
        item = settings.segments.add()
        item.labels = "" if subject is None else origin_of(subject.data).labels
        item.number, item.share, item.hidden = part, 100 * area[part] / total, not visible[part]
        if part == active:
            settings.active_segment = len(settings.segments) - 1
    settings.active_segment = max(min(settings.active_segment, len(settings.segments) - 1), 0)


def _is_readable(mesh: bpy.types.Mesh) -> bool:
    """Whether the labels of a mesh can be read: Blender gives whole attributes only outside of Edit Mode."""
    return not mesh.is_editmode


def _count_by_hand(mesh: bpy.types.Mesh) -> int:
    return int((by_hand(mesh) >= 0).sum())


def _character_of(subject: bpy.types.Object) -> list[bpy.types.Object]:
    """The objects of one character, with labels of the same set."""
    alike = objects_with(origin_of(subject.data).labels)
    return same_body(subject, alike)


def active_part(settings: WKSSegmentSettings) -> int | None:
    """Number of the active part in the list; None if the list is empty."""
    index = settings.active_segment
    return settings.segments[index].number if index < len(settings.segments) else None


def count_of(settings: WKSSegmentSettings) -> Message:
    """Text with the number of segments in the list, and of parts if they have sides."""
    numbers = np.array([item.number for item in settings.segments])
    return part_ids.count_text(len(np.unique(part_ids.segments_of(numbers))), len(numbers))


def active_labels(settings: WKSSegmentSettings) -> str:
    """Key of the label set that the list shows."""
    return str(settings.segments[0].labels) if settings.segments else ""


def activate(settings: WKSSegmentSettings, part: int) -> None:
    """Make a part the active one, if it is in the list."""
    numbers = [item.number for item in settings.segments]
    if part in numbers:
        settings.active_segment = numbers.index(part)


def rewrite_all(settings: WKSSegmentSettings, labels: str, objects: list[bpy.types.Object] | None = None) -> list[str]:
    """Write the labels of objects (None: all of a label set) again with the user's current edits, and list them.

    Returns
    -------
    list of str
        What was not taken back of the labels before, and why.
    """
    warnings: list[str] = []
    written = objects_with(labels) if objects is None else objects
    with followed(written):
        for mesh in meshes_of(written):
            rewrite_labels(mesh, style_of(labels), notes_of(labels).joined, warnings)
    fill(settings)
    return warnings


def rename(settings: WKSSegmentSettings, labels: str, part: int, name: str) -> None:
    """Rename a part of a label set and its other side, with the suffix of each side, wherever the names are written.

    A name that another part has gets a number. An empty name restores the default.
    """
    notes, style = notes_of(labels), style_of(labels)
    siblings = part_ids.siblings_of(part)
    listed = {item.number for item in settings.segments if item.labels == labels}
    numbers = {*range(part_ids.number_of(labels)), *listed, *notes.names} - set(siblings)
    taken = {style.name_of(number) for number in numbers}
    base = "".join(letter for letter in name if letter.isprintable()).strip()
    new_names = {sibling: _suffixed(base, sibling) for sibling in siblings}
    repeated = 1
    while base and taken & set(new_names.values()):
        repeated += 1
        number = f"{'.' if base[-1].isdigit() else ' '}{repeated}"
        new_names = {sibling: _suffixed(base, sibling, number) for sibling in siblings}
    other_names = {number: other for number, other in notes.names.items() if number not in siblings}
    unnamed = style_without(style, siblings)
    names = {sibling: new for sibling, new in new_names.items() if base and new != unnamed.name_of(sibling)}
    settings.keep_notes(replace(notes, names=other_names | names), labels)
    for sibling in siblings:
        restyle(labels, sibling, color=False)


def style_without(style: Style, parts: Iterable[int]) -> Style:
    """A style without the user's names of some parts."""
    names = {part: name for part, name in style.names.items() if part not in set(parts)}
    return replace(style, names=names)


def recolor(settings: WKSSegmentSettings, labels: str, part: int, color: tuple[float, float, float]) -> None:
    """Give a part of a label set a color wherever its color is written."""
    notes = notes_of(labels)
    settings.keep_notes(replace(notes, colors={**notes.colors, part: color}), labels)
    restyle(labels, part, name=False)


def choose_palette(settings: WKSSegmentSettings) -> None:
    """Give the chosen objects, and those that share their model, the colors of the palette in the settings."""
    models = {origin_of(obj.data).model for obj in chosen(settings)}
    for labels in [row.name for row in settings.label_sets if part_ids.model_of(row.name) in models]:
        settings.keep_notes(replace(notes_of(labels), palette=settings.palette), labels)
        restyle(labels, name=False)


def restyle(labels: str, part: int | None = None, name: bool = True, color: bool = True) -> None:
    """Write the current name or color of a part of a label set (None: of all) wherever it is written already."""
    style, objects = style_of(labels), objects_with(labels)
    with leaving_edit_mode(bpy.context) if color else nullcontext(), followed(objects):
        # A mesh can be in Edit Mode in another window; one whose simulation is not baked follows with its next labels.
        meshes = [mesh for mesh in meshes_of(objects) if may_change(mesh)]
        for mesh in (mesh for mesh in meshes if not mesh.is_editmode or not color):
            present = labels_on(mesh) if part is None else None
            for each in [part] if part is not None else [] if present is None else np.unique(present).tolist():
                if name:
                    rename_group(mesh, each, style)
                if color:
                    recolor_faces(mesh, each, style)
                    recolor_ids(mesh, each, style)
        for material in bpy.data.materials:
            shown = part_of(material)
            if shown is not None and part in (None, shown) and material.get(LABELS_PROPERTY, "") == labels:
                restyle_material(material, style, name, color)


def make_part(settings: WKSSegmentSettings, labels: str, name: str, side: int = 0) -> int:
    """Add a part to a label set with this name, and a color that no other part has; return its number."""
    notes, style = notes_of(labels), style_of(labels)
    listed = {item.number for item in settings.segments if item.labels == labels}
    model = part_ids.model_of(labels)
    # No other set of the model has this number either, so that faces by hand mean the same in all of them.
    others = [notes_of(row.name) for row in settings.label_sets if part_ids.model_of(row.name) == model]
    taken = {part for each in others for part in (*each.names, *each.colors, *each.looks, *each.joined)} | listed
    for mesh in bpy.data.meshes:
        if has_labels(mesh) and origin_of(mesh).model == model and _is_readable(mesh):
            taken |= set(np.unique(by_hand(mesh)).tolist())
    taken.discard(-1)
    part = part_ids.free_part(taken, side)
    colored = np.array(sorted({*range(OTHER_COLORS.start), *listed, *notes.colors, *notes.looks}), dtype=np.int64)
    look = style.free_look(colored, OTHER_COLORS)
    settings.keep_notes(replace(notes, looks={**notes.looks, part % part_ids.SIDE_STEP: look}), labels)
    rename(settings, labels, part, name)
    return part


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
