"""Reads poses: the surface of a character as the artist sees it, with the artist's own polygon of each triangle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import bpy
import numpy as np

from ...core import TriangleMesh
from ...core.mesh.triangle_mesh import FloatArray, IntArray, repeats_a_vertex
from ...core.message import Message, message_of
from ..errors import OtherFacesError, UserError
from .bone_sides import left_by_bones
from .characters import Character, armature_of, polygon_ranges, quoted, vertex_ranges
from .simulations import must_not_change
from .surfaces import DEFORMING, origins_of, read_surface

SAME_SURFACE = 1e-5
"""Two poses are the same if no vertex moves by more than this fraction of the character's size; rounding of single
precision is below it."""
POINTS = "{names} has no faces, only points of a point cloud (a scan, Gaussian splats): make a mesh of them first"
NO_FACES = "{names} has no faces: there is no surface to find segments on"
NO_FACES_BUT_NODES = (
    "{names} has no faces: there is no surface to find segments on; if it consists of instances, add a Realize "
    "Instances node"
)


@dataclass(frozen=True)
class Pose:
    """A character in one pose.

    Attributes
    ----------
    name : str
        Name for messages: with the object, and the frame or the shape key.
    character : Character
    mesh : TriangleMesh
        All objects of the character as they are seen, in world space.
    polygon_of : (m,) int array
        The polygon that each triangle comes from; the polygons of all objects are numbered one object after another.
        −1 for triangles that a modifier made of something else than the character's polygons.
    vertex_of : (n,) int array
        The character's own vertex that each vertex of `mesh` is, numbered like polygons, one object after another; −1
        on objects whose modifiers change faces: there, only `polygon_of` connects the pose with the character.
    axes : (3, 3) array
        The character's own x, y and z axes in world space, as columns. x usually points to its left.
    left : (3,) array, optional
        Direction in world space from bones with names on the right to bones with names on the left, if there are any.
    rest : TriangleMesh, optional
        The same triangles in the rest position of the character's armature, if it has one: there
        islands lie where the artist has placed them. The axes are then those of the rest position.
    """

    name: str
    character: Character
    mesh: TriangleMesh
    polygon_of: IntArray
    vertex_of: IntArray
    axes: FloatArray
    left: FloatArray | None = None
    rest: TriangleMesh | None = None

    @property
    def upright(self) -> TriangleMesh:
        """The rest position, or the pose if there is none, turned so that it is symmetric in x, which points left."""
        from ...core.mesh.symmetry import upright_axes

        mesh = self.mesh if self.rest is None else self.rest
        axes = upright_axes(mesh, self.axes, () if self.left is None else (self.left,))
        return TriangleMesh(mesh.vertices @ axes, mesh.faces)

    def is_like(self, other: Pose) -> bool:
        """Whether the other pose is the same surface at the same place."""
        a, b = self.mesh.vertices, other.mesh.vertices
        return (
            self.is_mesh_of(other)
            and bool(np.abs(a - b).max() <= SAME_SURFACE * np.ptp(a, axis=0).max())
            and np.array_equal(self.polygon_of, other.polygon_of)
        )

    def is_mesh_of(self, other: Pose) -> bool:
        """Whether the other pose has the same triangles and the same number of vertices."""
        return self.mesh.n_vertices == other.mesh.n_vertices and np.array_equal(self.mesh.faces, other.mesh.faces)

    def triangulated_as(self, other: Pose) -> Pose:
        """The pose with the triangles of another one, if these are of the same polygons; else the pose itself.

        Blender triangulates a polygon that is not flat differently in different poses.
        """
        if self.is_mesh_of(other) or not self._has_polygons_of(other):
            return self
        rest = None if self.rest is None else TriangleMesh(self.rest.vertices, other.mesh.faces)
        return replace(self, mesh=TriangleMesh(self.mesh.vertices, other.mesh.faces), rest=rest)

    def _has_polygons_of(self, other: Pose) -> bool:
        """Whether the other pose has the same polygons and number of vertices, however polygons are triangulated."""
        count = self.mesh.n_vertices
        if count != other.mesh.n_vertices or not np.array_equal(self.polygon_of, other.polygon_of):
            return False
        ours, theirs = (np.unique(np.repeat(p.polygon_of, 3) * count + p.mesh.faces.ravel()) for p in (self, other))
        return np.array_equal(ours, theirs)


def read_objects(context: bpy.types.Context, characters: Sequence[Character]) -> list[Pose]:
    """One pose of each character, as it is now."""
    return in_one_triangulation(
        [with_rest(context, [read_pose(context, character, character.name)])[0] for character in characters]
    )


def read_frames(
    context: bpy.types.Context, character: Character, frames: Sequence[int], names: Sequence[str] | None = None,
    left_out: list[str] | None = None,
) -> list[Pose]:  # fmt: skip
    """A character at frames of its animation, with these names; the scene is at its own frame again afterward.

    Parameters
    ----------
    context
    character
    frames
    names : optional
        A name for each frame.
    left_out : list, optional
        Gets a message for each frame in which the character has other faces, which is then left out.

    Raises
    ------
    UserError
        If a frame cannot be read, or all would be left out.
    """
    scene = context.scene
    before, subframe = scene.frame_current, scene.frame_subframe
    names = names or [Message("frame {frame}", frame=frame) for frame in frames]
    poses: list[Pose] = []
    refused: list[Message] = []
    try:
        for frame, name in zip(frames, names, strict=True):
            scene.frame_set(frame)
            try:
                poses.append(read_pose(context, character, _named(character, name)))
            except OtherFacesError as error:
                refused.append(message_of(error))
        poses = _with_same_faces(poses, refused)
        if refused and (left_out is None or not poses):
            raise OtherFacesError(refused[0])
        if left_out is not None:
            left_out += refused
        return with_rest(context, poses)
    finally:
        scene.frame_set(before, subframe=subframe)


def _with_same_faces(poses: list[Pose], refused: list[Message]) -> list[Pose]:
    """The poses with the faces that most of them have, if nodes change the faces; messages on the others are added.

    Other modifiers may change faces: those of Decimate depend on the pose, and are traced.
    """
    objects = poses[0].character.objects if poses else ()
    making = {m.type for obj in objects for m in obj.modifiers if m.show_viewport} - DEFORMING
    if making != {"NODES"}:
        return poses
    alike = [[pose.triangulated_as(other).is_mesh_of(other) for pose in poses] for other in poses]
    most = max(alike, key=sum)
    first = poses[most.index(True)]
    refused += [
        Message(
            '"{pose}": {names} has other faces there than in "{first}": its nodes change them from frame to frame. '
            "Take frames in which the faces stay the same, or turn the nodes off",
            pose=pose.name, names=quoted(obj.name for obj in objects), first=first.name,
        )
        for pose, is_alike in zip(poses, most, strict=True) if not is_alike
    ]  # fmt: skip
    return [pose for pose, is_alike in zip(poses, most, strict=True) if is_alike]


def marked_frames(scene: bpy.types.Scene, count: int) -> dict[int, str]:
    """Name by frame of at most `count` markers of the timeline, evenly chosen; UserError if there are none."""
    names: dict[int, str] = {}
    for marker in sorted(scene.timeline_markers, key=lambda marker: marker.frame):
        names.setdefault(marker.frame, marker.name)
    if not names:
        raise UserError("There are no markers in the timeline: add some (M), or take poses from elsewhere")
    return {frame: names[frame] for frame in [list(names)[i] for i in evenly(0, len(names) - 1, count)]}


def read_markers(context: bpy.types.Context, character: Character, count: int) -> list[Pose]:
    """A character at the frames of at most `count` markers; UserError if there are none."""
    names = marked_frames(context.scene, count)
    return read_frames(context, character, list(names), list(names.values()))


def read_shape_keys(context: bpy.types.Context, character: Character, count: int) -> list[Pose]:
    """A character in at most `count` of its shape keys, evenly chosen; each alone at its full value.

    A shape key moves all objects of the character that have one of this name; the others show their basis.

    Raises
    ------
    UserError
        If there are no shape keys except the basis, or all are muted.
    """
    keyed, names = _keyed(character), shape_key_names(character)
    if not names:
        raise UserError(
            '"{name}" has no shape keys that are not muted: add some, or take poses from elsewhere', name=character.name
        )
    before = [(obj, obj.active_shape_key_index, obj.show_only_shape_key) for obj in keyed]
    try:
        poses = []
        for name in (names[i] for i in evenly(0, len(names) - 1, count)):
            for obj in keyed:
                obj.show_only_shape_key = True
                obj.active_shape_key_index = max(obj.data.shape_keys.key_blocks.find(name), 0)
            poses.append(read_pose(context, character, _named(character, name)))
        return with_rest(context, poses)
    finally:
        for obj, active, pinned in before:
            obj.active_shape_key_index, obj.show_only_shape_key = active, pinned


def shape_key_names(character: Character) -> list[str]:
    """Names of the shape keys of a character that are not muted, with the basis; none if there is only the basis."""
    names = dict.fromkeys(
        block.name for obj in _keyed(character) for block in obj.data.shape_keys.key_blocks if not block.mute
    )
    return list(names) if len(names) > 1 else []


def _keyed(character: Character) -> list[bpy.types.Object]:
    return [obj for obj in character.objects if obj.data.shape_keys is not None]


def evenly(first: int, last: int, count: int) -> list[int]:
    """At most `count` different integers from `first` to `last` in equal steps, with both ends."""
    return np.unique(np.linspace(first, last, max(count, 1)).round().astype(int)).tolist()


def own_frames(scene: bpy.types.Scene, character: Character, count: int) -> list[int]:
    """At most `count` frames over a character's own animation, or over the scene's range if it has none.

    They are the middles of equal spans, since the first and the last frame of a cycle are the same pose.
    """
    ranges = character.frame_ranges() or [(scene.frame_start, scene.frame_end)]
    first, last = min(first for first, _ in ranges), max(last for _, last in ranges)
    middles = first + (np.arange(count) + 0.5) * (last - first) / count
    return np.unique(middles.round().astype(int)).tolist()


def in_one_triangulation(poses: Sequence[Pose]) -> list[Pose]:
    """The poses; those with the same polygons get the same triangles."""
    result: list[Pose] = []
    for pose in poses:
        candidates = (pose.triangulated_as(other) for other in result)
        same = (cut for cut, other in zip(candidates, result, strict=True) if cut.is_mesh_of(other))
        result.append(next(same, pose))
    return result


def with_rest(context: bpy.types.Context, poses: list[Pose]) -> list[Pose]:
    """Poses of one character with its rest position, if it has an armature and the same polygons at rest.

    Without it if a simulation would lose its frames by that.
    """
    poses = in_one_triangulation(poses)
    character = poses[0].character
    armatures = dict.fromkeys(obj.data for obj in map(armature_of, character.objects) if obj is not None)
    if not armatures or must_not_change(context.scene, character):
        return poses
    before = {armature: armature.pose_position for armature in armatures}
    try:
        for armature in armatures:
            armature.pose_position = "REST"
        rest = read_pose(context, character, Message("{name}, rest position", name=character.name))
        rest = rest.triangulated_as(poses[0])
    finally:
        for armature, position in before.items():
            armature.pose_position = position
        context.view_layer.update()
    return [
        replace(pose, rest=rest.mesh, axes=rest.axes, left=rest.left) if pose.is_mesh_of(rest) else pose
        for pose in poses
    ]


def read_pose(context: bpy.types.Context, character: Character, name: str) -> Pose:
    """A character as it is seen now: modifiers, armature and shape keys applied, in world space.

    Raises
    ------
    UserError
        If the character has no faces, a modifier hides where its faces come from, or a coordinate is not finite.
    """
    vertices: list[FloatArray] = []
    triangles: list[IntArray] = []
    owners: list[IntArray] = []
    own: list[IntArray] = []
    n_vertices = 0
    with origins_of(context.scene, character) as origins:
        depsgraph = context.evaluated_depsgraph_get()
        for (obj, polygons), (_, its) in zip(polygon_ranges(character), vertex_ranges(character), strict=True):
            surface = read_surface(obj, depsgraph, origins, name)
            points, polygon_of, vertex_of = surface.vertices, surface.polygon_of, surface.vertex_of
            bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
            if bad.size:
                raise UserError(
                    '"{pose}": vertex {vertex} of "{object}" has a coordinate that is not finite '
                    "({count} such vertices)",
                    pose=name, vertex=bad[0], object=obj.name, count=bad.size,
                )  # fmt: skip
            vertices.append(points)
            triangles.append(surface.triangles + n_vertices)
            owners.append(np.where(polygon_of < 0, -1, polygon_of + polygons.start))
            own.append(np.where(vertex_of < 0, -1, vertex_of + its.start))
            n_vertices += len(points)
        axes, left = _axes(character, depsgraph), left_by_bones(character)
    faces, polygon_of = np.concatenate(triangles), np.concatenate(owners)
    proper = ~repeats_a_vertex(faces)
    if not (proper.any() and (polygon_of >= 0).any()):
        names = quoted(obj.name for obj in character.objects)
        if n_vertices and not any(len(obj.data.edges) for obj in character.objects):
            raise UserError(POINTS, names=names)
        nodes = any(modifier.type == "NODES" for obj in character.objects for modifier in obj.modifiers)
        raise UserError(NO_FACES_BUT_NODES if nodes else NO_FACES, names=names)
    try:
        mesh = TriangleMesh(np.concatenate(vertices), faces[proper])
    except ValueError as error:
        raise UserError('"{name}": {reason}', name=name, reason=message_of(error)) from error
    return Pose(name, character, mesh, polygon_of[proper], np.concatenate(own), axes, left)


def _named(character: Character, name: str) -> Message:
    """The name of a pose."""
    return Message("{character}, {pose}", character=character.name, pose=name)


def _axes(character: Character, depsgraph: bpy.types.Depsgraph) -> FloatArray:
    """(3, 3) the axes of the character's armature, or of its largest object, as columns.

    The names .L and .R refer to these axes, however the character is turned.
    """
    armatures = [armature for armature in map(armature_of, character.objects) if armature is not None]
    body = armatures[0] if armatures else max(character.objects, key=lambda obj: len(obj.data.polygons))
    # A quaternion knows no mirroring: of a mirrored object, what is seen on the left is left.
    return np.array(body.evaluated_get(depsgraph).matrix_world.to_quaternion().to_matrix(), dtype=np.float64)
