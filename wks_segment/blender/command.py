"""The command line: `blender --command wks_segment …` and `python -m wks_segment …`."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ..core import PartNotes, PoseSegmentation
from ..core.description import Progress
from . import demo, files, parts, tasks
from . import poses as reader
from .bake import bake_id_maps
from .characters import Character, armature_of, group, mesh_objects
from .edits import merged
from .errors import UserError
from .id_map import save
from .labels import labels_on
from .picture import Tile, render_poses
from .pose_library import read_actions
from .poses import Pose
from .report import Report, pose_warnings, segment_warnings
from .settings import WKSSegmentSettings
from .tasks import Wanted
from .terminal import only_result_on_stdout, table, terminal_progress

OPTIONS = {
    "--segments": "n_segments",
    "--seed": "random_state",
    "--eigenpairs": "n_eigenpairs",
    "--energies": "n_energies",
    "--covariance": "covariance_type",
    "--scaling": "scaling",
    "--pieces": "pieces",
    "--laplacian": "laplacian",
    "--limit-minutes": "limit_minutes",
    "--limit-memory": "limit_memory",
    "--smallest-part": "min_share",
    "--smoothness": "smoothness",
    "--preset": "preset",
}
"""Options that are settings: their text, limits and defaults come from the property group."""
OUTPUT_OPTIONS = {
    "--vertex-groups": "vertex_groups", "--snap-to": "snap_to", "--sides": "sides", "--palette": "palette",
}  # fmt: skip
"""The same for commands that write labels."""
OUTPUT_FLAGS = {
    "--materials": ("write_materials", "also write a material for each segment"),
    "--face-sets": ("write_face_sets", "also write a face set for each segment"),
    "--seams": ("write_seams", "also mark the borders of segments as seams"),
}
"""The same that are on or off, and what they do."""
BAKE_OPTIONS = {"--size": "bake_size", "--margin": "bake_margin", "--palette": "palette", "--sides": "sides"}
"""Settings of `bake`."""
AUTOMATIC = {"n_segments": "auto_segments"}
"""Numbers that can be left open by the word "auto", and the settings that do it."""


def run(arguments: list[str]) -> int:
    """Run one command; its exit code: 0, 1 (failed, the reason on standard error) or 2 (wrong usage)."""
    options = _parser().parse_args(arguments)
    with only_result_on_stdout() as stdout:
        try:
            with terminal_progress() as progress:
                result = options.run(options, progress)
        except UserError as error:
            print(f"wks_segment: {error}", file=sys.stderr)
            if options.json:
                print(json.dumps({"error": str(error)}), file=stdout)
            return 1
        print(json.dumps(result) if options.json else _text(result), file=stdout)
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="wks_segment", description="The same parts, labels and colours in every pose of a character."
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    segment = commands.add_parser("segment", help="learn parts from the poses in files, and write them")
    _add_poses(segment)
    _add_settings(segment)
    segment.add_argument("--model", type=Path, help="write the model to this file")
    _add_outputs(segment)
    segment.set_defaults(run=_segment)

    learn = commands.add_parser("learn", help="learn a model from the poses in files")
    _add_poses(learn)
    _add_settings(learn)
    learn.add_argument("--model", type=Path, required=True, help="write the model to this file")
    learn.set_defaults(run=_segment, output=None, render=None)

    apply = commands.add_parser("apply", help="find the parts of a model in files")
    _add_poses(apply)
    apply.add_argument("--model", type=Path, required=True, help="a model that learn or segment wrote")
    for option in ("--smoothness", "--smallest-part", "--limit-minutes", "--limit-memory"):
        _add_setting(apply, option, OPTIONS[option])
    _add_outputs(apply)
    apply.set_defaults(run=_apply)

    bake = commands.add_parser("bake", help="bake the parts in a file, or those that a model finds, to an ID map")
    bake.add_argument("files", type=Path, nargs=1, metavar="FILE", help=", ".join(files.IMPORTERS))
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
    for option in ("--smoothness", "--smallest-part", "--limit-minutes", "--limit-memory"):
        _add_setting(bake, option, OPTIONS[option])
    _add_settings(bake, BAKE_OPTIONS)
    bake.set_defaults(run=_bake, action=None, frames=None, shape_keys=None, markers=None, actions=None)

    show = commands.add_parser("demo", help="build a creature, learn from some poses, and check on others")
    show.add_argument("--input", type=Path, help="an animated file in the place of the creature")
    show.add_argument("--folder", type=Path, default=Path("demo"), help="where results go (default: demo)")
    show.add_argument("--learn", type=int, default=4, help="poses to learn from (default: 4)")
    show.add_argument("--unseen", type=int, default=4, help="poses to check on (default: 4)")
    show.add_argument("--action", help="name of the action to take the poses from")
    _add_settings(show, OPTIONS | OUTPUT_OPTIONS)
    show.set_defaults(run=_demo)

    for command in (segment, learn, apply, bake, show):
        command.add_argument("--json", action="store_true", help="print one JSON object")
    return parser


def _add_poses(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("files", type=Path, nargs="+", metavar="FILE", help=", ".join(files.IMPORTERS))
    where = parser.add_mutually_exclusive_group()
    where.add_argument(
        "--frames", type=_frames, metavar="FIRST:LAST:COUNT",
        help="take poses from frames of each file's animation; COUNT: of all of it; --frames=-5:20:3 with a minus",
    )  # fmt: skip
    where.add_argument("--shape-keys", type=_within(int, 1, 1000), metavar="COUNT", help="take poses from shape keys")
    where.add_argument(
        "--markers", type=_within(int, 1, 1000), metavar="COUNT", help="take poses from the timeline's markers"
    )
    where.add_argument(
        "--actions", type=_within(int, 1, 1000), metavar="COUNT",
        help="take poses from the pose assets of each file, or else from the middles of its actions",
    )  # fmt: skip
    parser.add_argument("--action", help="name of the action to take the frames from")
    parser.add_argument(
        "--object", action="append", metavar="NAME", help="use this object only; may be given several times"
    )


def _add_outputs(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--output", type=Path, help=f"write the scene to this file ({', '.join(files.EXPORTERS)})")
    parser.add_argument("--render", type=Path, metavar="PNG", help="write a picture of all poses side by side")
    for option, (name, text) in OUTPUT_FLAGS.items():
        parser.add_argument(option, action="store_true", dest=name, help=text)
    _add_settings(parser, OUTPUT_OPTIONS)


def _add_settings(parser: argparse.ArgumentParser, options: dict[str, str] = OPTIONS) -> None:
    for option, name in options.items():
        _add_setting(parser, option, name)


def _add_setting(parser: argparse.ArgumentParser, option: str, name: str) -> None:
    setting = WKSSegmentSettings.bl_rna.properties[name]
    several = setting.type == "ENUM" and setting.is_enum_flag
    default = "none" if several else setting.default  # of several choices, Blender warns
    described: dict[str, Any] = {"dest": name, "help": f"{setting.description} (default: {default})"}
    if several:
        described["type"] = _some_of([item.identifier for item in setting.enum_items])
        described["metavar"] = ",".join(item.identifier for item in setting.enum_items)
    elif setting.type == "ENUM":
        described["choices"] = [item.identifier for item in setting.enum_items]
    else:
        number = int if setting.type == "INT" else float
        described["type"] = _within(number, setting.hard_min, setting.hard_max)
        described["metavar"] = "N"
    if name in AUTOMATIC:
        described["type"] = _or_auto(described["type"])
        described["metavar"] = "N|auto"
        described["help"] += f"; auto: {WKSSegmentSettings.bl_rna.properties[AUTOMATIC[name]].description}"
    described["help"] = described["help"].replace("%", "%%")
    parser.add_argument(option, **described)


def _within(number: type[int] | type[float], least: float, most: float) -> Any:
    def parse(text: str) -> float:
        value = number(text)
        if not least <= value <= most:
            raise argparse.ArgumentTypeError(f"must be from {least} to {most}, not {text}")
        return value

    parse.__name__ = "whole number" if number is int else "number"
    return parse


def _or_auto(number: Callable[[str], float]) -> Callable[[str], float | str]:
    def parse(text: str) -> float | str:
        try:
            return text if text == "auto" else number(text)
        except ValueError:
            raise argparse.ArgumentTypeError(f'must be a whole number or "auto", not {text!r}') from None

    return parse


def _some_of(known: list[str]) -> Callable[[str], set[str]]:
    def parse(text: str) -> set[str]:
        chosen = text.split(",")
        if not set(chosen) <= set(known):
            raise argparse.ArgumentTypeError(f"must be one or several of {','.join(known)}, not {text!r}")
        return set(chosen)

    return parse


def _frames(text: str) -> tuple[int | None, int | None, int]:
    parts = text.split(":")
    if len(parts) not in (1, 3) or not all(part.lstrip("-").isdigit() for part in parts) or int(parts[-1]) < 1:
        raise argparse.ArgumentTypeError(f"must be FIRST:LAST:COUNT or COUNT, whole numbers, not {text!r}")
    if len(parts) == 1:
        return None, None, int(text)
    first, last, count = (int(part) for part in parts)
    if last < first:
        raise argparse.ArgumentTypeError(f"the last frame ({last}) is before the first ({first})")
    return first, last, count


def _segment(options: argparse.Namespace, progress: Progress) -> dict[str, Any]:
    """`segment` and, without outputs, `learn`."""
    _check_outputs(options)
    files.check_folder(options.model) if options.model else None
    report = Report([])
    poses = _read(options, report)
    settings = _settings(options)
    model = settings.new_model()
    tasks.check_limits(model, poses, settings)
    described = tasks.learn(model, poses, report, progress)
    if options.model:
        _save(model, options.model)
    if options.output or options.render:
        _label(model, poses, described, settings, options, report, progress, renumbered=True)
        report.warnings += segment_warnings(model, report)
    settings.keep_model(model, report.facts)
    if options.output:
        files.save_scene(options.output)
    report.warnings += pose_warnings(poses, from_frames=options.frames is not None)
    return _result(options, report)


def _apply(options: argparse.Namespace, progress: Progress) -> dict[str, Any]:
    if not (options.output or options.render):
        raise UserError("apply has nothing to write: give --output, --render or both")
    _check_outputs(options)
    model = _load(options.model)
    report = Report([])
    report.tell_of(model)
    poses = _read(options, report)
    settings = _settings(options)
    settings.keep_notes(model.part_notes_)
    if options.smoothness is not None:
        model.smoothness = settings.smoothness
    tasks.check_limits(model, poses, settings)
    described = tasks.describe(model, poses, report, progress)
    _label(model, poses, described, settings, options, report, progress)
    settings.keep_model(model, [f"From {options.model.name}", f"{model.n_segments_} segments"])
    if options.output:
        files.save_scene(options.output)
    return _result(options, report)


def _bake(options: argparse.Namespace, progress: Progress) -> dict[str, Any]:
    _check_picture(options.output)
    if options.blend:
        files.check_output(options.blend)
    report = Report([])
    poses = _read(options, report)
    settings = _settings(options)
    characters = list(dict.fromkeys(pose.character for pose in poses))
    there = [labels_on(obj.data) for of in characters for obj in of.objects if len(obj.data.polygons)]
    if options.model or any(of_object is None for of_object in there):
        if not (options.model or settings.model):
            raise UserError(f"{options.files[0]}: there are no segments in it: give the --model that finds them")
        model = _load(options.model) if options.model else tasks.stored_model(settings)
        if options.smoothness is not None:
            model.smoothness = settings.smoothness
        tasks.check_limits(model, poses, settings)
        described = tasks.describe(model, poses, report, progress)
        wanted = Wanted.of(settings, characters)
        labels = tasks.label(model, poses, described, wanted, report, progress)
        tasks.write(settings, labels, wanted, report)
    else:
        report.laplacians = ["none"] * len(poses)
        report.tell_of_parts(np.concatenate([of_object for of_object in there if of_object is not None]))
    written: dict[str, Path] = {}
    with report.stage("bake"):
        id_maps = [
            id_map
            for character in characters
            for id_map in bake_id_maps(
                bpy.context, character, settings.style(), settings.bake_size, settings.bake_margin, options.unwrap,
                report.warnings, progress,
            )
        ]  # fmt: skip
        for id_map in id_maps:
            of = "" if len(id_maps) == 1 else f"_{bpy.path.clean_name(id_map.objects[0].name)}"
            written[id_map.image.name] = options.output.with_stem(options.output.stem + of)
            save(id_map.image, written[id_map.image.name])
    if options.blend:
        files.save_scene(options.blend)
        written["blend"] = options.blend
    return _result(options, report) | {"files": {name: str(path) for name, path in written.items()}}


def _demo(options: argparse.Namespace, progress: Progress) -> dict[str, Any]:
    if options.input:
        characters = _characters(options.input, files.open_files([options.input])[0], None)
        _choose_action(characters, options.action)
        moving = [character for character in characters if character.frame_ranges()] or characters
        if len(moving) > 1:
            raise UserError(f"{options.input}: there are {len(moving)} characters in it; the demo takes one")
        character = moving[0]
    else:
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        character = demo.creature(bpy.context)
    path = options.folder / (options.input.stem if options.input else "creature")
    return demo.run(bpy.context, character, _settings(options), path, options.learn, options.unseen, progress)


def _check_outputs(options: argparse.Namespace) -> None:
    if options.output:
        files.check_output(options.output)
    if options.render:
        _check_picture(options.render)


def _check_picture(path: Path) -> None:
    if path.suffix.lower() != ".png":
        raise UserError(f"{path}: a picture is written as .png")
    files.check_folder(path)


def _read(options: argparse.Namespace, report: Report) -> list[Pose]:
    """All poses of all files."""
    poses: list[Pose] = []
    with report.stage("read"):
        for path, objects in zip(options.files, files.open_files(options.files), strict=True):
            characters = _characters(path, objects, options.object)
            _choose_action(characters, options.action)
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


def _characters(path: Path, objects: list[bpy.types.Object], names: Sequence[str] | None) -> list[Character]:
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


def _choose_action(characters: Sequence[Character], name: str | None) -> None:
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


def _settings(options: argparse.Namespace) -> WKSSegmentSettings:
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


def _label(
    model: PoseSegmentation, poses: list[Pose], described: list[Any], settings: WKSSegmentSettings,
    options: argparse.Namespace, report: Report, progress: Progress, renumbered: bool = False,
) -> None:  # fmt: skip
    def at_end(stage: str, share: float) -> None:
        progress(stage, 1.0)

    wanted = Wanted.of(settings, (pose.character for pose in poses))
    labels = tasks.label(model, poses, described, wanted, report, at_end)
    if options.output:
        soft = tasks.soften(model, poses, described, labels, wanted, report, at_end)
        tasks.write(settings, labels, wanted, report, soft, renumbered)
    elif renumbered:
        settings.keep_notes(PartNotes())
    if options.render:
        with report.stage("render"):
            joined = settings.notes().joined
            tiles = [Tile(pose, merged(labels[pose.character], joined), pose.name) for pose in poses]
            render_poses(tiles, options.render, style=settings.style())


def _save(model: PoseSegmentation, path: Path) -> None:
    try:
        model.save(path)
    except ValueError as error:
        raise UserError(f"{path}: {error}") from error
    except OSError as error:
        raise UserError(f"{path}: the model could not be written: {error.strerror or error}") from error


def _load(path: Path) -> PoseSegmentation:
    try:
        return PoseSegmentation.load(path)
    except FileNotFoundError:
        raise UserError(f"{path}: there is no such file") from None
    except (ValueError, OSError) as error:
        raise UserError(f"{path}: {getattr(error, 'strerror', None) or error}") from error


def _result(options: argparse.Namespace, report: Report) -> dict[str, Any]:
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


def _text(result: dict[str, Any]) -> str:
    """A result as a person reads it."""
    with_agreement = "agreement" in result["poses"][0]
    header = ["pose", "vertices", *(["", "agreement"] if with_agreement else [])]
    rows = [
        [pose["name"], f"{pose['vertices']:,}"]
        + (["learned" if pose["learned"] else "unseen", f"{pose['agreement']:.3f}"] if with_agreement else [])
        for pose in result["poses"]
    ]
    stages = [[name, f"{seconds:.1f}"] for name, seconds in result["seconds"].items()]
    found = parts.counted(result["segments"], len(result.get("parts", {})))
    lines = [table(header, rows), "", table(["stage", "seconds"], stages), "", found]
    if with_agreement:
        lines.append(f"agreement of unseen poses: {result['agreement']:.3f} of the area has the learned label")
    lines += result["notes"]
    lines += [f"warning: {warning}" for warning in result["warnings"]]
    lines += [f"{name}: {path}" for name, path in result["files"].items()]
    return "\n".join(lines)
