"""`demo`."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import bpy

from ....core.progress import Progress
from ...errors import UserError
from ...scene import file_formats
from .. import demo_scene
from .common import characters_in, choose_action, settings_of
from .options import OPTIONS, OUTPUT_OPTIONS, add_settings


def add(commands: Any) -> None:
    """Add the command to a parser's."""
    show = commands.add_parser("demo", help="build a creature, learn from some poses, and check on others")
    show.add_argument("--input", type=Path, help="an animated file in the place of the creature")
    show.add_argument("--folder", type=Path, default=Path("demo"), help="where results go (default: demo)")
    show.add_argument("--learn", type=int, default=4, help="poses to learn from (default: 4)")
    show.add_argument("--unseen", type=int, default=4, help="poses to check on (default: 4)")
    show.add_argument("--action", help="name of the action to take the poses from")
    add_settings(show, OPTIONS | OUTPUT_OPTIONS)
    show.set_defaults(run=_demo)


def _demo(options: argparse.Namespace, progress: Progress) -> dict[str, Any]:
    if options.input:
        characters = characters_in(options.input, file_formats.open_files([options.input])[0], None)
        choose_action(characters, options.action)
        moving = [character for character in characters if character.frame_ranges()] or characters
        if len(moving) > 1:
            raise UserError(f"{options.input}: there are {len(moving)} characters in it; the demo takes one")
        character = moving[0]
    else:
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        character = demo_scene.creature(bpy.context)
    path = options.folder / (options.input.stem if options.input else "creature")
    return demo_scene.run(bpy.context, character, settings_of(options), path, options.learn, options.unseen, progress)
