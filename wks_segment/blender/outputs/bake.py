"""Bakes parts into UV maps by Cycles, on the CPU: which part each pixel of an image shows."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import bpy
import numpy as np

from ...core.mesh.triangle_mesh import BoolArray, FloatArray, IntArray
from ...core.poses.describe import Progress
from ..errors import UserError
from ..parts.part_style import Style
from ..scene.attributes import new_attribute, read_attribute, read_floats, read_ints, read_pixels, write_ints
from ..scene.characters import Character
from .id_map import NAME, NOTHING, with_margin, write_id_map
from .labels import labels_on
from .ledger import note_of
from .uv_maps import project, write_uv_map

ENGINE = "CYCLES"
VALUE = "wks_segment_value"
"""Attribute of the copy that is baked: the part of each face, from 1, since 0 is where no face is."""
OVERLAP = 0.01
"""A smaller share of faces on top of each other is the raster's, not the artist's."""
SHARED = 0.002
"""Objects of a character that share less of their pixels than this have one image together."""


@dataclass(frozen=True)
class IdMap:
    """An image, and the objects that are in it."""

    image: bpy.types.Image
    objects: tuple[bpy.types.Object, ...]


@dataclass
class _Layer:
    """What objects have in an image: (size, size) parts, from the bottom row up."""

    objects: list[bpy.types.Object]
    part_map: IntArray = field(repr=False)

    @property
    def covered(self) -> BoolArray:
        return self.part_map != NOTHING


def bake_id_maps(
    context: bpy.types.Context, character: Character, style: Style, size: int, margin: int, unwrap: bool,
    warnings: list[str], progress: Progress,
) -> list[IdMap]:  # fmt: skip
    """Bake the parts of a character's objects into their active UV maps.

    Objects whose faces lie beside each other, as where they share a texture, get one image together, others one each.

    Parameters
    ----------
    size, margin
        Of the image and around its islands, in pixels.
    unwrap
        Give an object without a usable UV map one of our own, by Smart UV Project.
    warnings
        What the user should know is added here.

    Raises
    ------
    UserError
        If an object has no parts or no usable UV map, or Cycles is not there.
    """
    objects = [obj for obj in character.objects if len(obj.data.polygons)]
    for obj in objects:
        if labels_on(obj.data) is None:
            raise UserError(f'"{obj.name}" has no segments: use Learn and Segment, or Apply to Selected, first')
        if not (has_uvs(obj.data) or unwrap):
            raise UserError(
                f'"{obj.name}" has no UV map{" with faces in it" * bool(obj.data.uv_layers)}: unwrap it (Unwrap '
                "Segments), or let the bake do it (Unwrap if Needed, --unwrap)"
            )
    layers: list[_Layer] = []
    for i, obj in enumerate(objects):
        progress(f'ID map of "{obj.name}"', i / len(objects))
        if not has_uvs(obj.data):
            write_uv_map(obj.data, project(context, obj.data))
        layer = _Layer([obj], bake_parts(context, obj, size, warnings))
        beside = next((other for other in layers if _is_beside(layer.covered, other.covered)), None)
        if beside is None:
            layers.append(layer)
        else:
            beside.objects.append(obj)
            beside.part_map = np.where(beside.covered, beside.part_map, layer.part_map)
    maps = []
    for layer in layers:
        name = NAME.format(character.name if len(layers) == 1 else layer.objects[0].name)
        meshes = list(dict.fromkeys(obj.data for obj in layer.objects))
        image = write_id_map(meshes, name, with_margin(layer.part_map, margin), style)
        maps.append(IdMap(image, tuple(layer.objects)))
    return maps


def has_uvs(mesh: bpy.types.Mesh) -> bool:
    """Whether the active UV map of a mesh, if any, has a face with an area in the image."""
    if not mesh.uv_layers:
        return False
    areas, inside = _uv_areas(mesh, mesh.uv_layers.active.name)
    return bool((areas[inside] > 0).any())


def bake_parts(context: bpy.types.Context, obj: bpy.types.Object, size: int, warnings: list[str]) -> IntArray:
    """(size, size) part at the middle of each pixel in an object's active UV map, from the bottom row up.

    What is baked is a copy in a scene of its own, so that nothing of the user's changes. The value is the number of
    the part, one sample at the middle of the pixel, and an image of floats, so that nothing is mixed or rounded.
    """
    with _scene(context) as scene, _copy(context, scene, obj) as (copy, image, uv_map):
        layer = scene.view_layers[0]
        with context.temp_override(
            scene=scene, view_layer=layer, active_object=copy, object=copy, selected_objects=[copy]
        ):
            image.scale(size, size)
            bpy.ops.object.bake(type="EMIT", margin=0, use_clear=True, uv_layer=uv_map)
        pixels = read_pixels(image)
        areas, inside = _uv_areas(copy.data, uv_map)
    part_map = np.rint(pixels[:, :, 0]).astype(np.int64) - 1
    covered = np.count_nonzero(part_map != NOTHING) / size**2
    if covered == 0:
        raise UserError(f'"{obj.name}": no face of the UV map "{uv_map}" covers a pixel: take a larger size')
    outside = float(areas[~inside].sum() / areas.sum())
    if outside > OVERLAP:
        warnings.append(f'"{obj.name}": {outside:.0%} of the UV map is outside of the image, from 0 to 1')
    overlap = 1 - covered / float(areas[inside].sum())
    if overlap > OVERLAP:
        warnings.append(
            f'"{obj.name}": {overlap:.0%} of the UV map lies on other faces of it; where these are of different '
            "segments, the image shows one of them"
        )
    return part_map


def _is_beside(first: BoolArray, second: BoolArray) -> bool:
    """Whether what is covered by one is not covered by the other."""
    both = np.count_nonzero(first & second)
    return bool(both <= SHARED * min(np.count_nonzero(first), np.count_nonzero(second)))


def _uv_areas(mesh: bpy.types.Mesh, uv_map: str) -> tuple[FloatArray, BoolArray]:
    """(m,) area of each triangle of a mesh in a UV map, and whether its middle is in the image."""
    mesh.calc_loop_triangles()
    corners = read_ints(mesh.loop_triangles, "loops", 3)
    triangles = read_floats(mesh.uv_layers[uv_map].data, "uv", 2)[corners].astype(np.float64)
    (ux, uy), (vx, vy) = (np.moveaxis(triangles[:, i] - triangles[:, 0], -1, 0) for i in (1, 2))
    middle = triangles.mean(axis=1)
    return np.abs(ux * vy - uy * vx) / 2, ((middle >= 0) & (middle <= 1)).all(axis=1)


@contextmanager
def _scene(context: bpy.types.Context) -> Iterator[bpy.types.Scene]:
    """An empty scene that bakes with Cycles, for as long as it lasts."""
    scene = bpy.data.scenes.new("WKS Segment bake")
    try:
        try:
            scene.render.engine = ENGINE
        except TypeError as error:
            raise UserError(
                "Cycles is turned off: turn on the add-on Cycles Render Engine (Edit > Preferences > Add-ons)"
            ) from error
        scene.cycles.device = "CPU"
        scene.cycles.samples = 1  # the first is at the middle of the pixel
        scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
        scene.render.bake.use_selected_to_active = False
        yield scene
    finally:
        bpy.data.scenes.remove(scene)


@contextmanager
def _copy(
    context: bpy.types.Context, scene: bpy.types.Scene, obj: bpy.types.Object
) -> Iterator[tuple[bpy.types.Object, bpy.types.Image, str]]:  # fmt: skip
    """A copy of what is seen of an object in a scene, the image that it is baked to, and the name of its UV map."""
    mesh, labels = _as_seen(context, obj)
    uv_map = obj.data.uv_layers.active.name
    image = bpy.data.images.new("WKS Segment bake", 1, 1, alpha=False, float_buffer=True, is_data=True)
    material = _emitter(image)
    copy = bpy.data.objects.new("WKS Segment bake", mesh)
    try:
        mesh.materials.clear()
        mesh.materials.append(material)
        write_ints(mesh.polygons, "material_index", np.zeros(len(mesh.polygons)))
        new_attribute(mesh, VALUE, "FLOAT", "FACE", labels + 1)
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
    """A copy of an object's mesh behind its modifiers and the part of each polygon; without, if they lose UVs or parts.

    Modifiers move UVs (Subdivision) and add faces (Mirror), and textures are seen on what they make.
    """
    depsgraph = context.evaluated_depsgraph_get()
    mesh = bpy.data.meshes.new_from_object(
        obj.evaluated_get(depsgraph), preserve_all_data_layers=True, depsgraph=depsgraph
    )
    labels = read_attribute(mesh, note_of(obj.data)["faces"])
    if labels is None or obj.data.uv_layers.active.name not in mesh.uv_layers:
        bpy.data.meshes.remove(mesh)
        mesh = obj.data.copy()
        labels = labels_on(mesh)
    return mesh, np.asarray(labels, dtype=np.int64)


def _emitter(image: bpy.types.Image) -> bpy.types.Material:
    """A material that shines with the value of each face, and that bakes to an image."""
    material = bpy.data.materials.new("WKS Segment bake")
    if bpy.app.version < (5, 0, 0):  # from then on always true, and touching it warns
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    value, shine, output, target = (
        tree.nodes.new(f"ShaderNode{kind}") for kind in ("Attribute", "Emission", "OutputMaterial", "TexImage")
    )
    value.attribute_name = VALUE
    tree.links.new(value.outputs["Fac"], shine.inputs["Color"])
    tree.links.new(shine.outputs["Emission"], output.inputs["Surface"])
    target.image = image
    tree.nodes.active = target
    return material
