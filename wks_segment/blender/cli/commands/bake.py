"""`bake`."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ....core.progress import Progress
from ...errors import UserError
from ...outputs.bake import BakeOptions, bake_id_maps
from ...outputs.id_map import save_image
from ...outputs.part_attributes import labels_on
from ...scene import file_formats
from ...workflow import model_library, pipeline
from ...workflow.pipeline import LabelRequest, Run
from ...workflow.report import Report
from .common import check_picture, read_poses, result_of, settings_of
from .options import BAKE_OPTIONS, add_labeling, add_settings


def add(commands: Any) -> None:
    """Add the command to a parser's."""
    bake = commands.add_parser("bake", help="bake the parts in a file, or those that a model finds, to an ID map")
    bake.add_argument("files", type=Path, nargs=1, metavar="FILE", help=", ".join(file_formats.IMPORTERS))
    bake.add_argument(
        "--output", type=Path, required=True, metavar="PNG",
        help="write the image to this file; of several images, each to one with the name of its object",
    )  # fmt: skip
    bake.add_argument("--model", type=Path, help="find the parts by this model, whatever the file has")
    bake.add_argument(
        "--object", action="append", metavar="NAME", help="use this object only; may be given several times"
    )
    bake.add_argument(
        "--unwrap", action="store_true", help="Smart UV Project for objects without a UV map; see --blend"
    )
    bake.add_argument("--blend", type=Path, help="write the scene to this file as well, with UV maps and images")
    add_labeling(bake)
    add_settings(bake, BAKE_OPTIONS)
    bake.set_defaults(run=_bake, action=None, frames=None, shape_keys=None, markers=None, actions=None)


def _bake(options: argparse.Namespace, progress: Progress) -> dict[str, Any]:
    check_picture(options.output)
    if options.blend:
        file_formats.check_output(options.blend)
    report = Report([])
    poses = read_poses(options, report)
    settings = settings_of(options)
    characters = list(dict.fromkeys(pose.character for pose in poses))
    there = [labels_on(obj.data) for of in characters for obj in of.objects if len(obj.data.polygons)]
    if options.model or any(of_object is None for of_object in there):
        if not (options.model or settings.model):
            raise UserError(f"{options.files[0]}: there are no segments in it: give the --model that finds them")
        model = model_library.loaded(options.model) if options.model else pipeline.stored_model(settings)
        if options.smoothness is not None:
            model.smoothness = settings.smoothness
        pipeline.check_limits(model, poses, settings)
        run, request = Run(report, progress), LabelRequest.of(settings, characters)
        described = pipeline.describe(model, poses, run)
        labels = pipeline.label(model, poses, described, request, run)
        pipeline.write_outputs(settings, labels, request, report)
    else:
        report.laplacians = ["none"] * len(poses)
        report.add_labels(np.concatenate([of_object for of_object in there if of_object is not None]))
    written: dict[str, Path] = {}
    bake_options = BakeOptions(settings.bake_size, settings.bake_margin, options.unwrap, settings.style())
    with report.stage("bake"):
        id_maps = [
            id_map
            for i, character in enumerate(characters)
            for id_map in bake_id_maps(
                bpy.context,
                character,
                bake_options,
                report.warnings,
                progress.part(i / len(characters), (i + 1) / len(characters)),
            )
        ]
        for id_map in id_maps:
            of = "" if len(id_maps) == 1 else f"_{bpy.path.clean_name(id_map.objects[0].name)}"
            written[id_map.image.name] = options.output.with_stem(options.output.stem + of)
            save_image(id_map.image, written[id_map.image.name])
    if options.blend:
        file_formats.save_scene(options.blend)
        written["blend"] = options.blend
    return result_of(options, report) | {"files": {name: str(path) for name, path in written.items()}}
