"""Command `demo`: build a creature, learn from some of its poses, and check the parts on others."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import bpy

from ....core.progress import Progress
from ...errors import UserError
from ...scene import file_formats
from ...scene.animation import animated
from ...scene.characters import Character, quoted
from ...scene.poses import own_frames
from ...scene.simulations import check_simulations
from ...workflow.describing import Run
from ...workflow.report import Report
from ..command_options import OUTPUT_OPTIONS, SEGMENTATION_OPTIONS, add_object, add_settings, settings_from
from ..demo_scene import Demo, creature_in
from ..file_characters import characters_in, set_action
from ..option_types import named_path
from ..reading import choice_of


def add(commands: Any) -> None:
    """Add the command to the subparsers of the command line."""
    demo = commands.add_parser("demo", help="build a creature, learn from some poses, and check on others")
    demo.add_argument("--input", type=named_path, help="an animated file to use instead of the creature")
    demo.add_argument("--folder", type=named_path, default=Path("demo"), help="folder for the results (default: demo)")
    demo.add_argument("--learn", type=int, default=4, help="number of poses to learn from (default: 4)")
    demo.add_argument("--unseen", type=int, default=4, help="number of poses to check on (default: 4)")
    demo.add_argument("--action", help="name of the action to take the poses from")
    add_object(demo)
    add_settings(demo, SEGMENTATION_OPTIONS | OUTPUT_OPTIONS)
    demo.set_defaults(run=_demo, frames=(None, None, None))


def _demo(options: argparse.Namespace, progress: Progress) -> dict[str, Any]:
    report = Report([])
    path = options.folder / (options.input.stem if options.input else "creature")
    with _character(options, report) as character:
        demo = Demo(character, path, options.learn, options.unseen)
        return demo.run(bpy.context, settings_from(options), Run(report, progress))


@contextmanager
def _character(options: argparse.Namespace, report: Report) -> Iterator[Character]:
    """The creature, or the character that moves most in the file of the options; UserError if it has none."""
    if not options.input:
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        yield creature_in(bpy.context.scene)
        return
    characters = characters_in(options.input, file_formats.open_files([options.input])[0], options.object, report)
    check_simulations(bpy.context.scene, characters, over_time=True)
    set_action(characters, options.action)

    def frames_of(character: Character) -> list[int]:
        return own_frames(bpy.context.scene, character, options.learn + options.unseen)

    with animated(bpy.context, characters, frames_of, choice_of(options.input, options)) as found:
        report.choices += found.notes
        if len(found.characters) > 1:
            raise UserError(
                "{path}: the demo takes one character, but there are {names}: choose one with --object",
                path=options.input, names=quoted(character.name for character in found.characters),
            )  # fmt: skip
        yield found.characters[0]
