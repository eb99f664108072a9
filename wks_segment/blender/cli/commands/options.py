"""Options of commands: those that are settings take text, limits and defaults from the property group."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ....core.poses.signature_cache import DISK
from ...props.settings import WKSSegmentSettings
from ...scene import file_formats

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
POSE_OPTIONS = {
    "--frames": "frames", "--shape-keys": "shape_keys", "--markers": "markers", "--actions": "actions",
    "--action": "action", "--object": "object",
}  # fmt: skip
"""Options that say where the poses are."""
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
LABELING = ("--smoothness", "--smallest-part", "--limit-minutes", "--limit-memory")
"""Settings of commands that label by a model that is there, and take those of the model if they are not given."""
AUTOMATIC = {"n_segments": "auto_segments"}
"""Numbers that can be left open by the word "auto", and the settings that do it."""


def add_poses(parser: argparse.ArgumentParser, nargs: str = "+") -> None:
    """Files, and where the poses in them are."""
    parser.add_argument("files", type=Path, nargs=nargs, metavar="FILE", help=", ".join(file_formats.IMPORTERS))
    add_pose_sources(parser)


def add_pose_sources(parser: argparse.ArgumentParser) -> None:
    """Where the poses in a file are."""
    where = parser.add_mutually_exclusive_group()
    where.add_argument(
        "--frames", type=_frames, metavar="FIRST:LAST:COUNT",
        help="take poses from frames of each file's animation; COUNT: of all of it; --frames=-5:20:3 with a minus",
    )  # fmt: skip
    where.add_argument("--shape-keys", type=within(int, 1, 1000), metavar="COUNT", help="take poses from shape keys")
    where.add_argument(
        "--markers", type=within(int, 1, 1000), metavar="COUNT", help="take poses from the timeline's markers"
    )
    where.add_argument(
        "--actions", type=within(int, 1, 1000), metavar="COUNT",
        help="take poses from the pose assets of each file, or else from the middles of its actions",
    )  # fmt: skip
    parser.add_argument("--action", help="name of the action to take the frames from")
    parser.add_argument(
        "--object", action="append", metavar="NAME", help="use this object only; may be given several times"
    )


def add_outputs(parser: argparse.ArgumentParser) -> None:
    """What is written of labels."""
    parser.add_argument(
        "--output", type=Path, help=f"write the scene to this file ({', '.join(file_formats.EXPORTERS)})"
    )
    parser.add_argument("--render", type=Path, metavar="PNG", help="write a picture of all poses side by side")
    add_output_settings(parser)


def add_output_settings(parser: argparse.ArgumentParser) -> None:
    """How labels are written."""
    for option, (name, text) in OUTPUT_FLAGS.items():
        parser.add_argument(option, action="store_true", dest=name, help=text)
    add_settings(parser, OUTPUT_OPTIONS)


def add_cache(parser: argparse.ArgumentParser) -> None:
    """Where signatures are kept."""
    parser.add_argument(
        "--cache", type=Path, metavar="DIR",
        help="keep what takes the time in this folder, for the next run with the same poses; several may share it",
    )  # fmt: skip
    parser.add_argument(
        "--cache-limit", type=within(float, 0.01, 100_000), default=DISK / 1e9, metavar="GB",
        help=f"what was not used for longest leaves the cache above this size (default: {DISK / 1e9:g})",
    )  # fmt: skip


def add_means(parser: argparse.ArgumentParser) -> None:
    """What a command may use: nothing of it changes a result."""
    add_cache(parser)
    parser.add_argument(
        "--threads", type=within(int, 1, 256), metavar="N",
        help="poses that are computed side by side (default: as many as there are cores and memory for, at most 4)",
    )  # fmt: skip


def add_model(parser: argparse.ArgumentParser) -> None:
    """Which model is applied."""
    model = parser.add_mutually_exclusive_group(required=True)
    model.add_argument("--model", type=Path, help="a model that learn or segment wrote")
    model.add_argument("--models", type=Path, metavar="DIR", help="a folder of models, of which the best one is taken")


def add_labeling(parser: argparse.ArgumentParser) -> None:
    """Settings of commands that label by a model that is there."""
    for option in LABELING:
        add_setting(parser, option, OPTIONS[option])


def add_settings(parser: argparse.ArgumentParser, options: dict[str, str] = OPTIONS) -> None:
    """Settings as options."""
    for option, name in options.items():
        add_setting(parser, option, name)


def add_setting(parser: argparse.ArgumentParser, option: str, name: str) -> None:
    """One setting as an option."""
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
        described["type"] = within(number, setting.hard_min, setting.hard_max)
        described["metavar"] = "N"
    if name in AUTOMATIC:
        described["type"] = _or_auto(described["type"])
        described["metavar"] = "N|auto"
        described["help"] += f"; auto: {WKSSegmentSettings.bl_rna.properties[AUTOMATIC[name]].description}"
    described["help"] = described["help"].replace("%", "%%")
    parser.add_argument(option, **described)


def within(number: type[int] | type[float], least: float, most: float) -> Any:
    """A parser of numbers from `least` to `most`."""

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


def as_arguments(options: argparse.Namespace) -> list[str]:
    """Poses and settings that were given, as arguments again: the same for the same, in whatever order they came."""
    found = []
    for option, name in (POSE_OPTIONS | OPTIONS | OUTPUT_OPTIONS).items():
        value = getattr(options, name, None)
        for each in value if isinstance(value, list) else [] if value is None else [value]:
            found.append(f"{option}={_text_of(each)}")
    return found + [option for option, (name, _) in OUTPUT_FLAGS.items() if getattr(options, name, False)]


def _text_of(value: Any) -> str:
    """What the parser of an option takes for a value that it gave."""
    if isinstance(value, set):
        return ",".join(sorted(value))
    if isinstance(value, tuple):  # frames
        return str(value[2]) if value[0] is None else ":".join(map(str, value))
    return str(value)


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
