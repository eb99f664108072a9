"""Command `bake`: bake the parts of a file to ID maps."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from copy import copy
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ....core.progress import Progress
from ...errors import UserError
from ...outputs.bake import BakeOptions, bake_id_maps, has_uvs
from ...outputs.id_map import save_image
from ...outputs.origin import Origin
from ...outputs.part_attributes import labels_on
from ...outputs.unwrapping import unwrapped_message
from ...props.settings import WKSSegmentSettings
from ...scene import file_formats
from ...scene.characters import Character
from ...scene.poses import Pose
from ...workflow import describing, model_library, pipeline
from ...workflow.describing import Run
from ...workflow.followed_settings import values_of
from ...workflow.pipeline import LabelRequest
from ...workflow.report import Report
from ..command_options import BAKE_OPTIONS, add_labeling_settings, add_object, add_settings, settings_from
from ..option_types import named_path
from ..reading import read_poses
from ..results import check_picture, result_of


def add(commands: Any) -> None:
    """Add the command to the subparsers of the command line."""
    bake = commands.add_parser("bake", help="bake the parts in a file, or those that a model finds, to an ID map")
    bake.add_argument("files", type=named_path, nargs=1, metavar="FILE", help=", ".join(file_formats.IMPORTERS))
    bake.add_argument(
        "--output", type=named_path, required=True, metavar="PNG",
        help="write the image to this file; if there are several, each to a file with the name of its object",
    )  # fmt: skip
    bake.add_argument("--model", type=named_path, help="find the parts with this model, even if the file has parts")
    add_object(bake)
    bake.add_argument("--unwrap", action="store_true", help="unwrap objects without a UV map by segments; see --blend")
    bake.add_argument("--blend", type=named_path, help="also write the scene to this file, with UV maps and images")
    add_labeling_settings(bake)
    add_settings(bake, BAKE_OPTIONS)
    bake.set_defaults(run=_bake, action=None, frames=None, shape_keys=None, markers=None, actions=None)


def _bake(options: argparse.Namespace, progress: Progress) -> dict[str, Any]:
    check_picture(options.output)
    if options.blend:
        file_formats.check_output(options.blend)
    run = Run(Report([]), progress)
    poses = read_poses(options, run.report, single=False, writes=False)
    settings = settings_from(options)
    characters = list(dict.fromkeys(pose.character for pose in poses))
    present = [labels_on(obj.data) for character in characters for obj in character.objects if len(obj.data.polygons)]
    labels = [values for values in present if values is not None]
    if options.model or len(labels) < len(present):
        _label(poses, characters, settings, options, run)
    else:
        run.report.laplacians = ["none"] * len(poses)
        run.report.add_labels(np.concatenate(labels))
    files = _bake_images(characters, settings, options, run)
    if options.blend:
        file_formats.save_scene(options.blend)
        files["blend"] = options.blend
    return result_of(options, run.report) | {"files": {name: str(path) for name, path in files.items()}}


def _label(
    poses: Sequence[Pose], characters: Sequence[Character], settings: WKSSegmentSettings,
    options: argparse.Namespace, run: Run,
) -> None:  # fmt: skip
    """Label the objects with the model of the options, or that of the file."""
    if not (options.model or settings.model):
        raise UserError(
            "{path}: there are no segments in it: give a model to find them with --model", path=options.files[0]
        )
    model = model_library.loaded(options.model) if options.model else pipeline.stored_model(settings)
    if options.model:
        model_library.add_model(settings, copy(model), options.model.stem, [f"From {options.model.name}"])
    if options.smoothness is not None:
        model.smoothness = settings.smoothness
    pipeline.check_limits(model, poses, settings)
    described = describing.describe(model, poses, run)
    request = LabelRequest.of(settings, characters)
    labels = pipeline.label(model, poses, described, request, run)
    origin = Origin(settings.labels(), values_of(settings))
    pipeline.write_outputs(settings, labels, request, run.report, origin=origin)


def _bake_images(
    characters: Sequence[Character], settings: WKSSegmentSettings, options: argparse.Namespace, run: Run
) -> dict[str, Path]:
    """Bake an ID map for each image of the characters; name and file of each."""
    files: dict[str, Path] = {}
    bake_options = BakeOptions(settings.bake_size, settings.bake_margin, options.unwrap)
    objects = [obj for character in characters for obj in character.objects if len(obj.data.polygons)]
    without_uvs = [obj for obj in objects if not has_uvs(obj.data)]
    with run.report.stage("bake"):
        id_maps = [
            id_map
            for character, progress in run.progress.each(characters)
            for id_map in bake_id_maps(bpy.context, character, bake_options, run.report.warnings, progress)
        ]
        for id_map in id_maps:
            suffix = "" if len(id_maps) == 1 else f"_{bpy.path.clean_name(id_map.objects[0].name)}"
            files[id_map.image.name] = options.output.with_stem(options.output.stem + suffix)
            save_image(id_map.image, files[id_map.image.name])
    run.report.unwrapped += [unwrapped_message(obj) for obj in without_uvs]
    return files
