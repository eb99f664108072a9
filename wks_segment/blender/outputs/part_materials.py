"""The materials of parts. One that the artist has changed, renamed or uses elsewhere is the artist's from then on."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from typing import Any

import bpy
import numpy as np

from ..parts.palette import linear
from ..parts.part_ids import default_name
from ..parts.part_style import Style
from ..props.label_set import style_of
from ..scene.fingerprint import fingerprint, is_made_as, made_as, users_of
from .ledger import has_ledger
from .own_property import OwnProperty
from .restore_point import is_removed, on_failure

PART_PROPERTY = "wks_segment_component"
"""Custom property of our materials: the part that they show."""
LABELS_PROPERTY = "wks_segment_labels"
"""Custom property of our materials: key of the label set that the part belongs to."""
SUCCESSORS_PROPERTY = "wks_segment_successors"
"""Custom property of materials of ours that the artist has changed: the part that each shows in other label sets."""
TEMPLATE_PROPERTY = "wks_segment_template"
"""Custom property of our materials that are copies: the name of the material that they were copied from."""
OTHER_DEFAULTS = ("location", "location_absolute", "use_backface_culling_lightprobe_volume")
"""Properties of new materials that are not the same in Blender 4.2 and 5.2; they do not change a look."""
SAME_COLOR = 1e-5
"""Largest difference of channels of a color that was set, as Blender rounds them to single precision."""
_MADE = OwnProperty("wks_segment_made", "as")
"""Custom property of our materials: name, color, and how they were made, see `made_as`."""


def part_of(material: bpy.types.Material | None) -> int | None:
    """The part that a material of ours shows; None for a material of the artist."""
    part = None if material is None else material.get(PART_PROPERTY)
    return part if isinstance(part, int) else None


def material_of_part(part: int, style: Style, template: bpy.types.Material | None) -> bpy.types.Material:
    """The material of a part, the same one on all meshes of its label set.

    One that the artist has changed is taken with these changes, also from another label set: see `hand_over`.
    """
    source = "" if template is None else template.name
    found = [each for each in _ours() if each.get(TEMPLATE_PROPERTY, "") == source]
    material = next((each for each in found if _is_of(each, part, style.labels)), None)
    if material is None:
        material = next((each for each in found if _successors(each).get(style.labels) == part), None)
        if material is None:
            return _new_material(part, style, template)
        _move(material, part, style.labels)
    restyle_material(material, style, name=True, color=True)
    return material


def hand_over(meshes: Collection[bpy.types.Mesh], old: str, new: str, successors: Mapping[int, int]) -> None:
    """Let materials of a label set that the artist has changed show their parts' successors in another set as well.

    Call it before the labels of meshes change from the one set to the other. A material that something else uses stays
    with its set.
    """
    materials = [each for each in _ours() if each.get(LABELS_PROPERTY, "") == old and not is_as_made(each)]
    for material, users in _users(*materials).items():
        before = _successors(material)
        after = {labels: part for labels, part in before.items() if labels != new}
        part = before.get(new, successors.get(material[PART_PROPERTY]))
        if part is not None and users and set(users) <= set(meshes):
            after[new] = part
        if after != before:
            _set(material, SUCCESSORS_PROPERTY, after)


def _move(material: bpy.types.Material, part: int, labels: str) -> None:
    """Make a material that of a part of another label set; going back to the old set moves it back."""
    to = _successors(material) | {material.get(LABELS_PROPERTY, ""): part_of(material)}
    for name, value in ((SUCCESSORS_PROPERTY, to), (PART_PROPERTY, part), (LABELS_PROPERTY, labels)):
        _set(material, name, value)


def _set(material: bpy.types.Material, name: str, value: Any) -> None:
    """Set a custom property of ours; an error later brings back what was there."""
    before = material.get(name)
    before = before.to_dict() if hasattr(before, "to_dict") else before
    on_failure(lambda: material.pop(name, None) if before is None else material.__setitem__(name, before))
    material[name] = value


def _successors(material: bpy.types.Material) -> dict[str, int]:
    """The part that a material shows in other label sets, by their keys."""
    kept = material.get(SUCCESSORS_PROPERTY)
    return dict(kept.to_dict()) if hasattr(kept, "to_dict") else {}


def _ours() -> list[bpy.types.Material]:
    """The materials of parts in this file that are not to be removed."""
    ours = [each for each in bpy.data.materials if part_of(each) is not None and each.library is None]
    return [each for each in ours if not is_removed(each)]


def _is_of(material: bpy.types.Material, part: int, labels: str) -> bool:
    return part_of(material) == part and material.get(LABELS_PROPERTY, "") == labels


def restyle_material(material: bpy.types.Material, style: Style, name: bool, color: bool) -> None:
    """Give a material of ours the name and the color of its part in a style.

    A name or a color that the artist has chosen stays, and so does a material that is used elsewhere.
    """
    part = part_of(material)
    if part is None or material.library is not None or not _is_ours_alone(material):
        return
    was_as_made, made = is_as_made(material), _made_of(material)
    old_name, old_colors = material.name, [(place, tuple(getattr(*place))) for place in _color_places(material)]

    def bring_back() -> None:
        material.name = old_name
        for place, value in old_colors:
            setattr(*place, value)
        _MADE.put(material, made)

    on_failure(bring_back)
    entries = dict(made)
    if name and without_number(material.name) == without_number(made["name"]):
        if without_number(material.name) != style.name_of(part):
            material.name = style.name_of(part)
        entries["name"] = material.name
    if color:
        entries["color"] = _color_of(part, style)
        for place, value in old_colors:
            if np.allclose(value, made["color"], atol=SAME_COLOR):
                setattr(*place, entries["color"])
    _MADE.put(material, entries)
    if was_as_made:
        _enter(material, entries["color"])


def is_as_made(material: bpy.types.Material) -> bool:
    """Whether a material of ours has the content and the name that it was made with."""
    made = _made_of(material)
    if made.get("by") == bpy.app.version_string:
        is_named = without_number(material.name) == without_number(made["name"])
        return is_named and is_made_as(made, lambda label: fingerprint(material, label=label))
    return _is_like_new(material, made["name"])


def keep_unused() -> list[str]:
    """Let files keep those of our materials that nothing uses any more; give their names.

    They are the artist's by now: all others are removed.
    """
    kept = unused()
    for material in kept:
        on_failure(lambda material=material: setattr(material, "use_fake_user", False))
        material.use_fake_user = True
    return [material.name for material in kept]


def unused() -> list[bpy.types.Material]:
    """Our materials that nothing uses, without those that will be removed."""
    ours = [material for material in bpy.data.materials if part_of(material) is not None]
    candidates = [material for material in ours if not (material.use_fake_user or is_removed(material))]
    users = _users(*candidates)
    return [material for material in candidates if not users[material]]


def _users(*materials: bpy.types.Material) -> dict[bpy.types.ID, list[bpy.types.ID]]:
    """What uses materials, other than meshes that will be removed, or that no object has, as joined objects leave."""
    return {
        material: [user for user in users if not (is_removed(user) or _is_left_over(user))]
        for material, users in users_of(*materials).items()
    }


def _is_left_over(block: bpy.types.ID) -> bool:
    return isinstance(block, bpy.types.Mesh) and block.users == 0


def without_number(name: str) -> str:
    """A name without the number that Blender adds to a name that is taken, as when something is appended."""
    return re.sub(r"\.\d{3,}$", "", name)


def _new_material(part: int, style: Style, template: bpy.types.Material | None) -> bpy.types.Material:
    name = style.name_of(part)
    if template is None:
        material = bpy.data.materials.new(name)
        if bpy.app.version < (5, 0, 0):  # always true since then, and setting it warns
            material.use_nodes = True
    else:
        material = template.copy()
        material.use_fake_user = False
        material.name = name
        material[TEMPLATE_PROPERTY] = template.name
        if material.asset_data is not None:
            material.asset_clear()
    material[PART_PROPERTY] = part
    if style.labels:
        material[LABELS_PROPERTY] = style.labels
    color = _color_of(part, style)
    _paint(material, color)
    _enter(material, color)
    return material


def _color_of(part: int, style: Style) -> tuple[float, ...]:
    return (*linear(style.colors_of(np.array([part]))[0]).tolist(), 1.0)


def _paint(material: bpy.types.Material, color: tuple[float, ...]) -> None:
    """Set the color in Solid view, and where the shader has a color of its own."""
    for place in _color_places(material):
        setattr(*place, color)


def _enter(material: bpy.types.Material, color: tuple[float, ...]) -> None:
    """Keep how the material is made."""
    made = made_as(lambda label: fingerprint(material, label=label))
    _MADE.put(material, {"name": material.name, "color": color, **made})


def _made_of(material: bpy.types.Material) -> dict[str, Any]:
    """How a material was made, as far as files of older versions know."""
    made, part = _MADE.of(material), part_of(material)
    if made is not None:
        return dict(made.to_dict())
    assert part is not None
    names = [default_name(part), style_of(material.get(LABELS_PROPERTY, "")).name_of(part)]
    name = next((name for name in names if name == without_number(material.name)), names[0])
    return {"name": name, "color": tuple(material.diffuse_color)}


def _is_ours_alone(material: bpy.types.Material) -> bool:
    """Whether only meshes with labels use a material."""
    return all(isinstance(user, bpy.types.Mesh) and has_ledger(user) for user in _users(material)[material])


def _is_like_new(material: bpy.types.Material, name: str) -> bool:
    """Whether a material that another version has made is like one of this name that is made now."""
    part = part_of(material)
    if part is None or without_number(material.name) != without_number(name):
        return False
    template = bpy.data.materials.get(material.get(TEMPLATE_PROPERTY, ""))
    new = _new_material(part, Style(), template)
    _paint(new, tuple(material.diffuse_color))
    try:
        return fingerprint(new, ignored=OTHER_DEFAULTS) == fingerprint(material, ignored=OTHER_DEFAULTS)
    finally:
        bpy.data.materials.remove(new)


def _color_places(material: bpy.types.Material) -> list[tuple[Any, str]]:
    """What has a color of the part, and the name of the property."""
    return [(material, "diffuse_color"), *((socket, "default_value") for socket in _color_sockets(material))]


def _color_sockets(material: bpy.types.Material) -> list[bpy.types.NodeSocket]:
    """Sockets where the color of a material is chosen: an open Base Color, or the RGB node that feeds one."""
    sockets = []
    for node in material.node_tree.nodes if material.node_tree is not None else []:
        base = node.inputs.get("Base Color")
        if base is None:
            continue
        if not base.is_linked:
            sockets.append(base)
        elif base.links[0].from_node.type == "RGB":
            sockets.append(base.links[0].from_node.outputs[0])
    return sockets
