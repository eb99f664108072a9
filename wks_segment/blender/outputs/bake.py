"""Bakes parts into UV maps by Cycles on the CPU: each pixel of an image shows the part whose faces cover it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import bpy
import numpy as np

from ...core.mesh.triangle_mesh import BoolArray, FloatArray, IntArray
from ...core.message import Message
from ...core.progress import Progress
from ..errors import UserError
from ..props.label_set import style_of
from ..scene.attributes import new_attribute, read_attribute, read_floats, read_ints, read_pixels, write_ints
from ..scene.characters import Character
from .id_map import IMAGE_NAME, NO_PART, with_margin, write_id_map
from .ledger import Ledger
from .origin import origin_of
from .part_attributes import labels_on
from .unwrapping import ALONG_SEAMS, unwrap_parts
from .uv_maps import write_uv_map

BAKE_ENGINE = "CYCLES"
BAKE_NAME = "WKS Segment bake"
"""Name of the temporary scene, object, material and image."""
BAKED_ATTRIBUTE = "wks_segment_value"
"""Attribute of the copy that is baked: the part of each face plus 1, since pixels without a face are 0."""
LEAST_FAULT = 0.01
"""Smallest share of a UV map that is worth a warning if it is outside of the image or lies on other faces; smaller
shares come from pixels that a face covers in part."""
MOST_SHARED = 0.002
"""Objects that share at most this part of their pixels lie beside each other; islands that touch share some."""


@dataclass(frozen=True)
class BakeOptions:
    """How parts are baked.

    Attributes
    ----------
    size, margin : int
        Size of the image and width of the margin around its islands, in pixels.
    unwrap : bool
        Whether an object without a usable UV map gets one of ours, by Smart UV Project.
    """

    size: int
    margin: int
    unwrap: bool


@dataclass(frozen=True)
class IdMap:
    """An image, and the objects whose parts it shows."""

    image: bpy.types.Image
    objects: tuple[bpy.types.Object, ...]


@dataclass
class _Layer:
    """(size, size) parts of some objects in an image, from the bottom row up."""

    objects: list[bpy.types.Object]
    labels: str
    """Key of the label set of the parts."""
    part_map: IntArray = field(repr=False)

    @property
    def covered(self) -> BoolArray:
        return self.part_map != NO_PART


def bake_id_maps(
    context: bpy.types.Context, character: Character, options: BakeOptions, warnings: list[str], progress: Progress
) -> list[IdMap]:
    """Bake the parts of a character's objects into their active UV maps.

    Objects whose faces lie beside each other in the UV map, as where they share a texture, get one image together;
    others get an image each.

    Parameters
    ----------
    warnings
        Gets what the user should know.

    Raises
    ------
    UserError
        If an object has no parts or no usable UV map, or Cycles is turned off.
    """
    objects = [obj for obj in character.objects if len(obj.data.polygons)]
    for obj in objects:
        _check(obj, options)
    layers: list[_Layer] = []
    for i, obj in enumerate(objects):
        progress(i / len(objects), Message('ID map of "{name}"', name=obj.name))
        labels = labels_on(obj.data)
        if labels is not None and not has_uvs(obj.data):
            write_uv_map(obj.data, unwrap_parts(context, obj, labels, ALONG_SEAMS))
        layer = _Layer([obj], origin_of(obj.data).labels, bake_parts(context, obj, options.size, warnings))
        alike = (other for other in layers if other.labels == layer.labels)
        shared = next((other for other in alike if _are_disjoint(layer.covered, other.covered)), None)
        if shared is None:
            layers.append(layer)
        else:
            shared.objects.append(obj)
            shared.part_map = np.where(shared.covered, shared.part_map, layer.part_map)
    maps = []
    for layer in layers:
        name = IMAGE_NAME.format(character.name if len(layers) == 1 else layer.objects[0].name)
        meshes = list(dict.fromkeys(obj.data for obj in layer.objects))
        part_map = with_margin(layer.part_map, options.margin)
        image = write_id_map(meshes, name, part_map, style_of(layer.labels), warnings)
        maps.append(IdMap(image, tuple(layer.objects)))
    return maps


def _check(obj: bpy.types.Object, options: BakeOptions) -> None:
    """UserError if an object has no parts, or no UV map to bake them to."""
    if labels_on(obj.data) is None:
        raise UserError('"{name}" has no segments: use Learn and Segment, or Apply to Selected, first', name=obj.name)
    if has_uvs(obj.data) or options.unwrap:
        return
    if obj.data.uv_layers:
        raise UserError(
            '"{name}" has no UV map with faces in it: unwrap it (Unwrap Segments), or let the bake do it (Unwrap if '
            "Needed, --unwrap)",
            name=obj.name,
        )
    raise UserError(
        '"{name}" has no UV map: unwrap it (Unwrap Segments), or let the bake do it (Unwrap if Needed, --unwrap)',
        name=obj.name,
    )


def has_uvs(mesh: bpy.types.Mesh) -> bool:
    """Whether a mesh has an active UV map with a face that has an area within the image."""
    if not mesh.uv_layers:
        return False
    areas, inside = _uv_areas(mesh, mesh.uv_layers.active.name)
    return bool((areas[inside] > 0).any())


def bake_parts(context: bpy.types.Context, obj: bpy.types.Object, size: int, warnings: list[str]) -> IntArray:
    """(size, size) part at the center of each pixel in an object's active UV map, from the bottom row up.

    A copy in a temporary scene is baked, so that nothing of the user's changes. Numbers of parts are baked, with one
    sample at the center of the pixel, to an image of floats, so that nothing is mixed or rounded.
    """
    with _bake_scene() as scene, _bake_copy(context, scene, obj) as (copy, image, uv_map):
        layer = scene.view_layers[0]
        with context.temp_override(
            scene=scene, view_layer=layer, active_object=copy, object=copy, selected_objects=[copy]
        ):
            image.scale(size, size)
            bpy.ops.object.bake(type="EMIT", margin=0, use_clear=True, uv_layer=uv_map)
        pixels = read_pixels(image)
        areas, inside = _uv_areas(copy.data, uv_map)
    part_map = np.rint(pixels[:, :, 0]).astype(np.int64) - 1
    covered = np.count_nonzero(part_map != NO_PART) / size**2
    if covered == 0:
        raise UserError(
            '"{name}": no face of the UV map "{uv_map}" covers a pixel: take a larger size',
            name=obj.name,
            uv_map=uv_map,
        )
    outside = float(areas[~inside].sum() / areas.sum())
    if outside > LEAST_FAULT:
        warnings.append(
            Message(
                '"{name}": {share:.0%} of the UV map is outside of the image, which is from 0 to 1',
                name=obj.name,
                share=outside,
            )
        )
    overlap = 1 - covered / float(areas[inside].sum())
    if overlap > LEAST_FAULT:
        warnings.append(
            Message(
                '"{name}": {share:.0%} of the UV map lies on other faces; where they are of different segments, the '
                "image shows one of them",
                name=obj.name,
                share=overlap,
            )
        )
    return part_map


def _are_disjoint(first: BoolArray, second: BoolArray) -> bool:
    """Whether two (size, size) masks of covered pixels share no or hardly any pixels."""
    both = np.count_nonzero(first & second)
    return bool(both <= MOST_SHARED * min(np.count_nonzero(first), np.count_nonzero(second)))


def _uv_areas(mesh: bpy.types.Mesh, uv_map: str) -> tuple[FloatArray, BoolArray]:
    """(m,) area of each triangle of a mesh in a UV map, and whether its center is in the image."""
    mesh.calc_loop_triangles()
    corners = read_ints(mesh.loop_triangles, "loops", 3)
    triangles = read_floats(mesh.uv_layers[uv_map].data, "uv", 2)[corners].astype(np.float64)
    (ux, uy), (vx, vy) = (np.moveaxis(triangles[:, i] - triangles[:, 0], -1, 0) for i in (1, 2))
    center = triangles.mean(axis=1)
    return np.abs(ux * vy - uy * vx) / 2, ((center >= 0) & (center <= 1)).all(axis=1)


@contextmanager
def _bake_scene() -> Iterator[bpy.types.Scene]:
    """A temporary empty scene that bakes with Cycles."""
    scene = bpy.data.scenes.new(BAKE_NAME)
    try:
        try:
            scene.render.engine = BAKE_ENGINE
        except TypeError as error:
            raise UserError(
                "Cycles is turned off: turn on the add-on Cycles Render Engine (Edit > Preferences > Add-ons)"
            ) from error
        scene.cycles.device = "CPU"
        scene.cycles.samples = 1  # the first sample is at the center of the pixel
        scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
        scene.render.bake.use_selected_to_active = False
        yield scene
    finally:
        bpy.data.scenes.remove(scene)


@contextmanager
def _bake_copy(
    context: bpy.types.Context, scene: bpy.types.Scene, obj: bpy.types.Object
) -> Iterator[tuple[bpy.types.Object, bpy.types.Image, str]]:  # fmt: skip
    """A temporary copy of an object in a scene, the image that it is baked to, and the name of its UV map."""
    mesh, labels = _as_seen(context, obj)
    uv_map = obj.data.uv_layers.active.name
    image = bpy.data.images.new(BAKE_NAME, 1, 1, alpha=False, float_buffer=True, is_data=True)
    material = _emitter(image)
    copy = bpy.data.objects.new(BAKE_NAME, mesh)
    try:
        mesh.materials.clear()
        mesh.materials.append(material)
        write_ints(mesh.polygons, "material_index", np.zeros(len(mesh.polygons)))
        new_attribute(mesh, BAKED_ATTRIBUTE, "FLOAT", "FACE", labels + 1)
        scene.collection.objects.link(copy)
        scene.view_layers[0].objects.active = copy
        copy.select_set(True, view_layer=scene.view_layers[0])
        yield copy, image, uv_map
    finally:
        bpy.data.objects.remove(copy)
        bpy.data.meshes.remove(mesh)
        bpy.data.materials.remove(material)
        bpy.data.images.remove(image)


def _as_seen(context: bpy.types.Context, obj: bpy.types.Object) -> tuple[bpy.types.Mesh, IntArray]:
    """A copy of an object's mesh with its modifiers applied, and the (p,) parts of its polygons.

    Modifiers move UVs (Subdivision) and add faces (Mirror), and textures are seen on the result. The copy is without
    modifiers if these lose the UV map or the parts.
    """
    depsgraph = context.evaluated_depsgraph_get()
    mesh = bpy.data.meshes.new_from_object(
        obj.evaluated_get(depsgraph), preserve_all_data_layers=True, depsgraph=depsgraph
    )
    labels = read_attribute(mesh, Ledger(obj.data)["faces"])
    if labels is None or obj.data.uv_layers.active.name not in mesh.uv_layers:
        bpy.data.meshes.remove(mesh)
        mesh = obj.data.copy()
        labels = labels_on(mesh)
    return mesh, np.asarray(labels, dtype=np.int64)


def _emitter(image: bpy.types.Image) -> bpy.types.Material:
    """A material that emits the value of each face, and is baked to an image."""
    material = bpy.data.materials.new(BAKE_NAME)
    if bpy.app.version < (5, 0, 0):  # always true since then, and setting it warns
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    value, emission, output, target = (
        tree.nodes.new(f"ShaderNode{kind}") for kind in ("Attribute", "Emission", "OutputMaterial", "TexImage")
    )
    value.attribute_name = BAKED_ATTRIBUTE
    tree.links.new(value.outputs["Fac"], emission.inputs["Color"])
    tree.links.new(emission.outputs["Emission"], output.inputs["Surface"])
    target.image = image
    tree.nodes.active = target
    return material
