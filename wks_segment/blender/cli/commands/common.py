"""What commands share: reading poses, models and settings, and the result that is printed."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import bpy

from ....core import DiskCache, PartNotes, PoseSegmentation
from ....core.progress import Progress
from ...errors import UserError
from ...outputs.overrides import merge_parts
from ...parts import part_ids
from ...props.settings import WKSSegmentSettings
from ...render.contact_sheet import Tile, render_poses
from ...scene import file_formats
from ...scene import poses as reader
from ...scene.characters import Character, armature_of, group, mesh_objects
from ...scene.pose_library import read_actions
from ...scene.poses import Pose
from ...workflow import model_library, pipeline
from ...workflow.model_ranking import NamedModel, models_in_files
from ...workflow.pipeline import LabelRequest, Run
from ...workflow.report import Report
from ..terminal import table
from .options import AUTOMATIC, BAKE_OPTIONS, OPTIONS, OUTPUT_FLAGS, OUTPUT_OPTIONS


def check_outputs(options: argparse.Namespace) -> None:
    """UserError unless what is asked for can be written, before the work begins."""
    if options.output:
        file_formats.check_output(options.output)
    if options.render:
        check_picture(options.render)


def check_picture(path: Path) -> None:
    """UserError unless a picture can be written there."""
    if path.suffix.lower() != ".png":
        raise UserError(f"{path}: a picture is written as .png")
    file_formats.check_folder(path)


def cache_of(options: argparse.Namespace) -> DiskCache | None:
    """Where signatures are kept; None if nothing is said of that. UserError if there can be none."""
    if options.cache is None:
        return None
    try:
        return DiskCache(options.cache, round(1e9 * options.cache_limit))
    except OSError as error:
        raise UserError(f"{options.cache}: it cannot be a cache: {error.strerror or error}") from error


def candidates_in(folder: Path, report: Report) -> list[NamedModel]:
    """The models in a folder; UserError if there is none."""
    if not folder.is_dir():
        raise UserError(f"{folder}: there is no such folder")
    candidates = models_in_files(model_library.in_folder(folder), report)
    if not candidates:
        raise UserError(f"{folder}: there is no model in this folder that can be used")
    return candidates


def read_poses(options: argparse.Namespace, report: Report) -> list[Pose]:
    """All poses of all files."""
    poses: list[Pose] = []
    with report.stage("read"):
        for path, objects in zip(options.files, file_formats.open_files(options.files), strict=True):
            characters = characters_in(path, objects, options.object)
            choose_action(characters, options.action)
            for character in characters:
                if options.shape_keys is not None:
                    poses += reader.read_shape_keys(bpy.context, character, options.shape_keys)
                elif options.markers is not None:
                    poses += reader.read_markers(bpy.context, character, options.markers)
                elif options.actions is not None:
                    poses += read_actions(bpy.context, character, options.actions)
                elif options.frames is not None:
                    first, last, count = options.frames
                    if first is None or last is None:
                        frames = reader.own_frames(bpy.context.scene, character, count)
                    else:
                        frames = reader.evenly(first, last, count)
                    poses += reader.read_frames(bpy.context, character, frames)
                else:
                    poses += reader.read_objects(bpy.context, [character])
    report.poses = poses
    return poses


def characters_in(path: Path, objects: list[bpy.types.Object], names: Sequence[str] | None) -> list[Character]:
    """A .blend file can hold several characters; a file of any other format holds one."""
    scene = mesh_objects(objects)
    # What Blender does not evaluate has no pose: it would come without its modifiers, the same in every frame.
    found = [obj for obj in scene if obj.name in bpy.context.view_layer.objects and not obj.hide_viewport]
    if scene and not found:
        raise UserError(f"{path}: all mesh objects in it are disabled in viewports, or their collections are excluded")
    if names:
        missing = set(names) - {obj.name for obj in found}
        if missing:
            raise UserError(f"{path}: there is no mesh object named {', '.join(sorted(missing))}")
        found = [obj for obj in found if obj.name in names]
    if not found:
        raise UserError(f"{path}: there is no mesh in this file")
    return group(found, together=path.suffix.lower() != ".blend")


def choose_action(characters: Sequence[Character], name: str | None) -> None:
    """Let the characters' armatures move by the action of that name."""
    if name is None:
        return
    action = bpy.data.actions.get(name)
    if action is None:
        known = ", ".join(a.name for a in bpy.data.actions) or "none"
        raise UserError(f'There is no action named "{name}"; there are: {known}')
    for character in characters:
        for block in {armature_of(obj) or obj for obj in character.objects}:
            data = block.animation_data_create()
            data.action = action
            # From 4.4 on an action has slots, and one of another name is not taken by itself.
            if getattr(data, "action_slot", action) is None:
                if not data.action_suitable_slots:
                    raise UserError(f'The action "{name}" does not fit "{block.name}"')
                data.action_slot = data.action_suitable_slots[0]


def settings_of(options: argparse.Namespace) -> WKSSegmentSettings:
    """Default settings, whatever the file holds, with what the command line says."""
    settings: WKSSegmentSettings = bpy.context.scene.wks_segment
    settings.property_unset("write_colors")
    for name in (OPTIONS | OUTPUT_OPTIONS | BAKE_OPTIONS).values():
        settings.property_unset(name)
        value = getattr(options, name, None)
        automatic = name in AUTOMATIC and value == "auto"
        if name in AUTOMATIC:
            setattr(settings, AUTOMATIC[name], automatic)
        if value is not None and not automatic:
            setattr(settings, name, value)
    for name, _ in OUTPUT_FLAGS.values():
        setattr(settings, name, getattr(options, name, False))
    return settings


def label(
    model: PoseSegmentation, poses: list[Pose], described: list[Any], settings: WKSSegmentSettings,
    options: argparse.Namespace, report: Report, progress: Progress, renumbered: bool = False,
) -> None:  # fmt: skip
    """Label the poses by a model, write that to their meshes, and render them, as far as is asked for."""
    request, at_end = (
        LabelRequest.of(settings, (pose.character for pose in poses)),
        Run(report, progress.part(1.0, 1.0)),
    )
    labels = pipeline.label(model, poses, described, request, at_end)
    if options.output:
        soft = pipeline.soften(model, poses, described, labels, request, at_end)
        pipeline.write_outputs(settings, labels, request, report, soft, renumbered)
    elif renumbered:
        settings.keep_notes(PartNotes())
    if options.render:
        with report.stage("render"):
            joined = settings.notes().joined
            tiles = [Tile(pose, merge_parts(labels[pose.character], joined), pose.name) for pose in poses]
            render_poses(tiles, options.render, style=settings.style())


def save_model(model: PoseSegmentation, path: Path) -> None:
    """Write a model to a file; UserError if it cannot be written."""
    try:
        model.save(path)
    except ValueError as error:
        raise UserError(f"{path}: {error}") from error
    except OSError as error:
        raise UserError(f"{path}: the model could not be written: {error.strerror or error}") from error


def result_of(options: argparse.Namespace, report: Report) -> dict[str, Any]:
    """What a command prints: one JSON object."""
    outputs = {name: getattr(options, name, None) for name in ("model", "output", "render")}
    return {
        "poses": [
            {
                "name": pose.name,
                "vertices": pose.mesh.n_vertices,
                "triangles": pose.mesh.n_faces,
                "laplacian": laplacian,
            }
            for pose, laplacian in zip(report.poses, report.laplacians, strict=True)
        ],
        "segments": report.n_segments,
        **({"parts": report.parts} if report.parts else {}),
        **({} if report.certainty is None else {"certainty": report.certainty}),
        "notes": report.notes,
        "seconds": {name: round(seconds, 3) for name, seconds in report.seconds.items()},
        "warnings": report.warnings,
        "files": {name: str(path) for name, path in outputs.items() if path is not None},
    }


def text_of(result: dict[str, Any]) -> str:
    """A result as a person reads it."""
    with_agreement = "agreement" in result["poses"][0]
    header = ["pose", "vertices", *(["", "agreement"] if with_agreement else [])]
    rows = [
        [pose["name"], f"{pose['vertices']:,}"]
        + (["learned" if pose["learned"] else "unseen", f"{pose['agreement']:.3f}"] if with_agreement else [])
        for pose in result["poses"]
    ]
    stages = [[name, f"{seconds:.1f}"] for name, seconds in result["seconds"].items()]
    found = part_ids.count_text(result["segments"], len(result.get("parts", {})))
    lines = [table(header, rows), "", table(["stage", "seconds"], stages), "", found]
    if with_agreement:
        lines.append(f"agreement of unseen poses: {result['agreement']:.3f} of the area has the learned label")
    lines += result["notes"]
    lines += [f"warning: {warning}" for warning in result["warnings"]]
    lines += [f"{name}: {path}" for name, path in result["files"].items()]
    return "\n".join(lines)
