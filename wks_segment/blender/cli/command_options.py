"""Options that several commands share, and the settings that they stand for.

An option that stands for a setting takes its help, limits and default from the property group.
"""

from __future__ import annotations

import argparse
from typing import Any

import bpy

from ...core import DiskCache
from ...core.poses.signature_cache import DISK
from ..errors import UserError
from ..props.settings import WKSSegmentSettings
from ..render.contact_sheet import TILE_PIXELS
from ..scene import file_formats
from .option_types import frame_range, named_path, number_or_auto, number_within, several_of

SEGMENTATION_OPTIONS = {
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
"""Option to setting, of commands that learn a model."""
LABELING_OPTIONS = ("--smoothness", "--smallest-part", "--limit-minutes", "--limit-memory")
"""Those of them that commands have which label with a given model."""
POSE_OPTIONS = {
    "--frames": "frames", "--shape-keys": "shape_keys", "--markers": "markers", "--actions": "actions",
    "--action": "action", "--object": "object",
}  # fmt: skip
"""Option to attribute of the parsed options, of options that say where the poses of a file are."""
OUTPUT_OPTIONS = {
    "--vertex-groups": "vertex_groups", "--snap-to": "snap_to", "--sides": "sides", "--palette": "palette",
}  # fmt: skip
"""Option to setting, of commands that write labels."""
OUTPUT_FLAGS = {
    "--ucupaint": ("write_ucupaint", "also write the color attribute of Ucupaint's Color ID masks"),
    "--materials": ("write_materials", "also write a material for each part"),
    "--face-sets": ("write_face_sets", "also write a face set for each part"),
    "--seams": ("write_seams", "also mark the borders of parts as seams"),
}
"""Option to setting and help, of options without a value for commands that write labels."""
BAKE_OPTIONS = {"--size": "bake_size", "--margin": "bake_margin", "--palette": "palette", "--sides": "sides"}
"""Option to setting, of `bake`."""
PART_SOURCE_OPTION = "--parts-from"
"""Option that says where the parts are that a model is taught."""
TEACH_OPTIONS = {"--parts": "bone_parts", "--other-faces": "unlabeled"}
"""Option to setting, of commands that teach a model parts."""
TEACH_FLAGS = {
    "--join-sides": ("taught_sides", False, "teach left and right as one part"),
    "--all-face-sets": ("all_face_sets", True, "teach face set 1 as well, which unpainted faces have"),
}
"""Option to setting, its value and help, of options without a value for commands that teach a model parts."""
AUTO_SETTINGS = {"n_segments": "auto_segments", "bone_parts": "usual_parts"}
"""Number to the setting that leaves its choice to the method, for which its option takes the word "auto"."""


def add_poses(parser: argparse.ArgumentParser, nargs: str = "+") -> None:
    """Add the files to read, and the options that say where the poses in them are."""
    parser.add_argument("files", type=named_path, nargs=nargs, metavar="FILE", help=", ".join(file_formats.IMPORTERS))
    add_pose_sources(parser)


def add_pose_sources(parser: argparse.ArgumentParser) -> None:
    """Add the options that say where the poses in a file are."""
    source = parser.add_mutually_exclusive_group()
    source.add_argument(
        "--frames", type=frame_range, metavar="FIRST:LAST:COUNT",
        help="take poses from frames of each file's animation; COUNT alone: of the whole animation; with a negative "
        "number, write --frames=-5:20:3",
    )  # fmt: skip
    count = number_within(int, 1, 1000)
    source.add_argument("--shape-keys", type=count, metavar="COUNT", help="take poses from shape keys")
    source.add_argument("--markers", type=count, metavar="COUNT", help="take poses from markers of the timeline")
    source.add_argument(
        "--actions", type=count, metavar="COUNT",
        help="take poses from the pose assets of each file, or from the middle of each action if there are none",
    )  # fmt: skip
    parser.add_argument("--action", help="name of the action to take frames from")
    add_object(parser)


def add_object(parser: argparse.ArgumentParser) -> None:
    """Add the option that selects objects of a file."""
    parser.add_argument(
        "--object", action="append", metavar="NAME", help="use only this object; can be given several times"
    )


def add_outputs(parser: argparse.ArgumentParser) -> None:
    """Add the files to write labels to, and the options that say how labels are written."""
    parser.add_argument(
        "--output", type=named_path, help=f"write the scene to this file ({', '.join(file_formats.EXPORTERS)})"
    )
    parser.add_argument("--unfinished", type=named_path, help=argparse.SUPPRESS)  # for batches: see `Job`
    parser.add_argument("--render", type=named_path, metavar="PNG", help="write a picture of all poses side by side")
    parser.add_argument(
        "--tile", type=number_within(int, 32, 4096), default=TILE_PIXELS, metavar="PIXELS",
        help=f"width and height of each pose in the picture (default: {TILE_PIXELS})",
    )  # fmt: skip
    add_output_settings(parser)


def add_output_settings(parser: argparse.ArgumentParser) -> None:
    """Add the options that say how labels are written."""
    for option, (name, text) in OUTPUT_FLAGS.items():
        parser.add_argument(option, action="store_true", dest=name, help=text)
    add_settings(parser, OUTPUT_OPTIONS)


def add_cache(parser: argparse.ArgumentParser) -> None:
    """Add the options of the cache for signatures."""
    parser.add_argument(
        "--cache", type=named_path, metavar="DIR",
        help="keep signatures in this folder, for later runs with the same poses; several runs may share it",
    )  # fmt: skip
    parser.add_argument(
        "--cache-limit", type=number_within(float, 0.01, 100_000), default=DISK / 1e9, metavar="GB",
        help=f"size above which the least recently used entries of the cache are removed (default: {DISK / 1e9:g})",
    )  # fmt: skip


def add_resources(parser: argparse.ArgumentParser) -> None:
    """Add the options of cache and threads, which change no result."""
    add_cache(parser)
    parser.add_argument(
        "--threads", type=number_within(int, 1, 256), metavar="N",
        help="poses that are computed at the same time (default: as cores and memory allow, at most 4)",
    )  # fmt: skip


def add_model(parser: argparse.ArgumentParser) -> None:
    """Add the options that say which model is applied."""
    model = parser.add_mutually_exclusive_group(required=True)
    model.add_argument("--model", type=named_path, help="a model that learn or segment wrote")
    model.add_argument(
        "--models", type=named_path, metavar="DIR", help="a folder of models, of which the best one is used"
    )


def add_labeling_settings(parser: argparse.ArgumentParser) -> None:
    """Add the options of commands that label with a given model; their defaults come from the model."""
    for option in LABELING_OPTIONS:
        add_setting(parser, option, SEGMENTATION_OPTIONS[option])


def add_teaching(parser: argparse.ArgumentParser) -> None:
    """Add the options that say which parts a model is taught."""
    sources = {_option_value(item.identifier): item for item in _property("parts_from").enum_items}
    parser.add_argument(
        PART_SOURCE_OPTION, dest="parts_from", choices=list(sources),
        help="learn the parts that the files have, with their names, instead of finding some: "
        + "; ".join(f"{name}: {item.description}" for name, item in sources.items()),
    )  # fmt: skip
    add_settings(parser, TEACH_OPTIONS)
    for option, (_, _, text) in TEACH_FLAGS.items():
        parser.add_argument(option, action="store_true", help=f"with {PART_SOURCE_OPTION}, {text}")


def teaching_from(options: argparse.Namespace, settings: WKSSegmentSettings) -> bool:
    """Take the options that say which parts a model is taught over to the settings; whether it is taught any."""
    for name in ("parts_from", "bones", *TEACH_OPTIONS.values()):
        settings.property_unset(name)
    settings.property_unset(AUTO_SETTINGS["bone_parts"])
    for option, (name, value, _) in TEACH_FLAGS.items():
        given = getattr(options, option.removeprefix("--").replace("-", "_"), False)
        setattr(settings, name, value if given else not value)
    source = getattr(options, "parts_from", None)
    if source is None:
        return False
    settings.parts_from = source.upper().replace("-", "_")
    for name in TEACH_OPTIONS.values():
        _set(settings, name, getattr(options, name, None))
    return True


def _option_value(identifier: str) -> str:
    """How the command line writes an item of a setting."""
    return identifier.lower().replace("_", "-")


def _property(name: str) -> Any:
    """What Blender knows about a setting."""
    return WKSSegmentSettings.bl_rna.properties[name]


def _set(settings: WKSSegmentSettings, name: str, value: Any) -> None:
    """Give a setting the value of an option; None leaves it as it is."""
    if value is None:
        return
    if name in AUTO_SETTINGS:
        setattr(settings, AUTO_SETTINGS[name], value == "auto")
    if value != "auto" or name not in AUTO_SETTINGS:
        setattr(settings, name, value)


def add_settings(parser: argparse.ArgumentParser, options: dict[str, str] = SEGMENTATION_OPTIONS) -> None:
    """Add an option for each setting."""
    for option, name in options.items():
        add_setting(parser, option, name)


def add_setting(parser: argparse.ArgumentParser, option: str, name: str) -> None:
    """Add an option for a setting, with the description, limits and default of its property."""
    setting = _property(name)
    several = setting.type == "ENUM" and setting.is_enum_flag
    default = "none" if several else setting.default  # Blender warns if it is asked for the default of flags
    arguments: dict[str, Any] = {"dest": name, "help": f"{setting.description} (default: {default})"}
    if several:
        arguments["type"] = several_of([item.identifier for item in setting.enum_items])
        arguments["metavar"] = ",".join(item.identifier for item in setting.enum_items)
    elif setting.type == "ENUM":
        arguments["choices"] = [item.identifier for item in setting.enum_items]
    else:
        number = int if setting.type == "INT" else float
        arguments["type"] = number_within(number, setting.hard_min, setting.hard_max)
        arguments["metavar"] = "N"
    if name in AUTO_SETTINGS:
        arguments["type"] = number_or_auto(arguments["type"])
        arguments["metavar"] = "N|auto"
        arguments["help"] += f"; auto: {_property(AUTO_SETTINGS[name]).description}"
    arguments["help"] = arguments["help"].replace("%", "%%")
    parser.add_argument(option, **arguments)


def settings_from(options: argparse.Namespace) -> WKSSegmentSettings:
    """The settings of the scene, with values from the options and defaults otherwise, whatever the file contains."""
    settings: WKSSegmentSettings = bpy.context.scene.wks_segment
    settings.property_unset("write_colors")
    for name in (SEGMENTATION_OPTIONS | OUTPUT_OPTIONS | BAKE_OPTIONS).values():
        settings.property_unset(name)
        if name in AUTO_SETTINGS:
            settings.property_unset(AUTO_SETTINGS[name])
        _set(settings, name, getattr(options, name, None))
    for name, _ in OUTPUT_FLAGS.values():
        setattr(settings, name, getattr(options, name, False))
    return settings


def cache_from(options: argparse.Namespace) -> DiskCache | None:
    """The cache for signatures, None if the options name none; UserError if the folder cannot be used."""
    if options.cache is None:
        return None
    try:
        return DiskCache(options.cache, round(1e9 * options.cache_limit))
    except OSError as error:
        raise UserError(
            "{path}: it cannot be a cache: {reason}", path=options.cache, reason=error.strerror or error
        ) from error


def to_arguments(options: argparse.Namespace) -> list[str]:
    """Options of poses and settings that were given, as arguments in a fixed order."""
    arguments = []
    for option, name in (POSE_OPTIONS | SEGMENTATION_OPTIONS | OUTPUT_OPTIONS).items():
        value = getattr(options, name, None)
        for item in value if isinstance(value, list) else [] if value is None else [value]:
            arguments.append(f"{option}={_to_text(item)}")
    return arguments + [option for option, (name, _) in OUTPUT_FLAGS.items() if getattr(options, name, False)]


def _to_text(value: Any) -> str:
    """Text of an argument from which the parser makes this value."""
    if isinstance(value, set):
        return ",".join(sorted(value))
    if isinstance(value, tuple):  # frames
        return str(value[2]) if value[0] is None else ":".join(map(str, value))
    return str(value)
