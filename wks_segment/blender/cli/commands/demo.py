"""Command `demo`: build a creature, learn from some of its poses, and check the parts on others."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import bpy

from ....core.progress import Progress
from ...errors import UserError
from ...scene import file_formats
from ...scene.characters import Character
from ...workflow.pipeline import Run
from ...workflow.report import Report
from ..command_options import OUTPUT_OPTIONS, SEGMENTATION_OPTIONS, add_settings, settings_from
from ..demo_scene import Demo, creature_in
from ..reading import characters_in, set_action


def add(commands: Any) -> None:
    """Add the command to the subparsers of the command line."""
    demo = commands.add_parser("demo", help="build a creature, learn from some poses, and check on others")
    demo.add_argument("--input", type=Path, help="an animated file to use instead of the creature")
    demo.add_argument("--folder", type=Path, default=Path("demo"), help="folder for the results (default: demo)")
    demo.add_argument("--learn", type=int, default=4, help="number of poses to learn from (default: 4)")
    demo.add_argument("--unseen", type=int, default=4, help="number of poses to check on (default: 4)")
    demo.add_argument("--action", help="name of the action to take the poses from")
    add_settings(demo, SEGMENTATION_OPTIONS | OUTPUT_OPTIONS)
    demo.set_defaults(run=_demo)


def _demo(options: argparse.Namespace, progress: Progress) -> dict[str, Any]:
    if options.input:
        character = _character_in(options.input, options.action)
    else:
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        character = creature_in(bpy.context.scene)
    path = options.folder / (options.input.stem if options.input else "creature")
    demo = Demo(character, path, options.learn, options.unseen)
    return demo.run(bpy.context, settings_from(options), Run(Report([]), progress))


def _character_in(path: Path, action: str | None) -> Character:
    """The one animated character in a file, or the one character if none is animated; UserError if there are more."""
    characters = characters_in(path, file_formats.open_files([path])[0], None)
    set_action(characters, action)
    animated = [character for character in characters if character.frame_ranges()] or characters
    if len(animated) > 1:
        raise UserError(
            "{path}: there are {count} characters in it, but the demo takes one", path=path, count=len(animated)
        )
    return animated[0]
