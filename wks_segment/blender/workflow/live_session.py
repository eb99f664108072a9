"""What was learned or applied last, kept in memory so that other settings are a matter of moments."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count
from typing import TYPE_CHECKING, Any

import bpy
from bpy.app.handlers import persistent

from ...core import MemoryCache
from ..errors import ChangedError, UserError
from ..outputs.overrides import merged
from ..props.preferences import preference
from ..ui.preview import Preview
from .background_job import desk_of, redraw

if TYPE_CHECKING:
    from ..props.settings import WKSSegmentSettings
    from .segmentation_job import Work

HOLDER = "wks_segment_session"
"""Name of the session at the type of Blender's window manager."""
REST = 0.1
"""Seconds for which settings must have rested."""
LIVE = ("n_segments", "auto_segments", "sides", "smoothness", "min_share", "snap_to")
"""Settings that labels follow."""
NOTHING = "Nothing was learned or applied since this file was opened, or it was undone"
MOST_BYTES = 1_000_000_000
"""Signatures of a work that is kept, at most."""


class Session:
    """The signatures of meshes, and the work that was done last; lets labels follow the settings.

    The scene says which work its labels are from, and with which settings: so undo and redo take that with them.
    """

    def __init__(self) -> None:
        self._cache = MemoryCache()
        self.work: Work | None = None
        self.said = ""
        """Why labels do not follow any more."""
        self.proposed: tuple[str, Work] | None = None
        """What labels would be with settings, until it is accepted or discarded."""
        self.preview = Preview()
        self._before: dict[str, Any] = {}
        self._numbers = count(1)
        self._name = ""
        self._due = 0.0
        self.timer = self.tick
        self._written: dict[str, dict[str, Any]] = {}
        """Settings of the labels that were written, by what the scene says of them."""
        self._stepping = ""
        """What the scene said of its labels before the step of undo that is taken now."""
        on = bpy.app.handlers
        self._handlers = (
            (on.load_pre, self._on_load), (on.undo_pre, self._before_undo), (on.undo_post, self._on_undo),
            (on.redo_post, self._on_redo),
        )  # fmt: skip
        for handlers, function in self._handlers:
            handlers.append(function)

    @property
    def cache(self) -> MemoryCache:
        """The signatures, as many as the preferences allow."""
        self._cache.limit = 1_000_000 * preference(bpy.context, "cache_megabytes")
        return self._cache

    def keep(self, work: Work, scene: bpy.types.Scene) -> None:
        """Keep a work that was written to a scene."""
        if work.first is None:
            self._name = f"work {next(self._numbers)}"
        self.withdraw()
        self.work, self.said = work, ""
        self._before = _values(scene.wks_segment)
        if sum(each.pose.signature.nbytes for each in set(work.described)) > MOST_BYTES:
            self.drop()
        scene.wks_segment.applied = self._state(scene)
        self._written[scene.wks_segment.applied] = dict(self._before)

    def holds(self, scene: bpy.types.Scene) -> bool:
        """Whether the labels in a scene are of the work that is kept."""
        return self.work is not None and scene.wks_segment.applied.partition(":")[0] == self._name

    def follows(self, scene: bpy.types.Scene) -> bool:
        """Whether the labels in a scene are those that the settings ask for."""
        return bool(scene.wks_segment.applied == self._state(scene))

    @property
    def waits(self) -> bool:
        """Whether labels are to follow in a moment."""
        return bool(bpy.app.timers.is_registered(self.timer))

    @property
    def seconds(self) -> float:
        """What finding labels took the last time."""
        return 0.0 if self.work is None else self.work.report.seconds.get("label", 0.0)

    @property
    def is_slow(self) -> bool:
        """Whether that is too long for labels to follow by themselves."""
        return bool(self.seconds > preference(bpy.context, "live_seconds"))

    def mark(self, scene: bpy.types.Scene) -> None:
        """Let labels follow as soon as the settings rest, if they are to."""
        if not (scene.wks_segment.live and self.holds(scene)) or self.is_slow:
            return
        self._due = time.monotonic() + REST
        if not bpy.app.timers.is_registered(self.timer):
            bpy.app.timers.register(self.timer, first_interval=REST)

    def tick(self) -> float | None:
        """Called by Blender's timer: the seconds until the next call, None for no further one."""
        context = bpy.context
        rest = self._due - time.monotonic()
        if rest > 0 or desk_of(context).job is not None:
            return max(rest, REST)
        scene = context.scene
        if not self.holds(scene) or self.follows(scene) or context.mode != "OBJECT":
            return None
        window = next(iter(context.window_manager.windows), None)
        try:
            if scene.wks_segment.preview:
                self.propose(context)
            else:
                # One step for undo, as if a person had pressed the button.
                with context.temp_override(window=window):
                    bpy.ops.wks_segment.update("EXEC_DEFAULT", True)
        except (RuntimeError, UserError) as error:
            self.said = str(error).removeprefix("Error: ").strip()
        redraw(context)
        return None

    def update(self, scene: bpy.types.Scene) -> Work:
        """Do what was done last with the settings as they are now.

        Raises
        ------
        UserError
            If there is nothing, the settings take another model, or a mesh is another one by now: nothing is kept then.
        """
        if self.work is None:
            raise UserError(NOTHING)
        with self._dropping():
            work = self._again(scene)
            work.write()
        self.keep(work, scene)
        return work

    def propose(self, context: bpy.types.Context) -> None:
        """Show in the viewport what `update` would write, and write nothing."""
        scene = context.scene
        with self._dropping():
            work = self._again(scene)
            self.proposed, self.said = (self._state(scene), work), ""
            notes = scene.wks_segment.notes()
            shown = {character: merged(found, notes.joined) for character, found in work.labels.items()}
            self.preview.show(context, shown, scene.wks_segment.style())

    def discard(self, scene: bpy.types.Scene) -> None:
        """Take back what is proposed, and the settings that it is from."""
        self.withdraw()
        for name, value in self._before.items():
            setattr(scene.wks_segment, name, value)

    def withdraw(self) -> None:
        """Show nothing that is not written."""
        self.proposed = None
        self.preview.hide()

    def _again(self, scene: bpy.types.Scene) -> Work:
        """The work with the settings as they are now, which may be what is proposed."""
        if self.work is None:
            raise UserError(NOTHING)
        if self.proposed is not None and self.proposed[0] == self._state(scene):
            return self.proposed[1]
        work = self.work.again(scene.wks_segment)
        work.compute(lambda stage, share: None)
        return work

    @contextmanager
    def _dropping(self) -> Iterator[None]:
        """Forget the work if the scene turns out to be another one."""
        try:
            yield
        except ChangedError as error:
            self.drop()
            raise UserError(f"Segments do not follow any more, learn or apply again: {error}") from error

    def drop(self) -> None:
        """Forget the work."""
        self.withdraw()
        self.work, self._name = None, ""
        self._written.clear()

    def close(self) -> None:
        """Forget all, and hear no more of Blender."""
        self.drop()
        self.cache.clear()
        if bpy.app.timers.is_registered(self.timer):
            bpy.app.timers.unregister(self.timer)
        for handlers, function in self._handlers:
            if function in handlers:
                handlers.remove(function)

    def _state(self, scene: bpy.types.Scene) -> str:
        values = _values(scene.wks_segment)
        if values["auto_segments"]:
            del values["n_segments"]
        return f"{self._name}:{values | {'snap_to': sorted(values['snap_to'])}}"

    @persistent
    def _on_load(self, *_: Any) -> None:
        self.drop()
        self.said = ""

    @persistent
    def _before_undo(self, *_: Any) -> None:
        self._stepping = bpy.context.scene.wks_segment.applied

    @persistent
    def _on_undo(self, *_: Any) -> None:
        self.withdraw()
        if self.work is None:
            return
        if any(member.found() is None for pose in self.work.poses for member in pose.character.members):
            self.drop()
            return
        scene = bpy.context.scene
        if not self.holds(scene) or scene.wks_segment.applied == self._stepping:
            return
        self._before = dict(self._written.get(scene.wks_segment.applied, self._before))
        if scene.wks_segment.live and not scene.wks_segment.preview:
            # Blender has a step for a setting and one for the labels that followed it. To the user they are one.
            self.said = ""
            for name, value in self._before.items():
                setattr(scene.wks_segment, name, value)

    @persistent
    def _on_redo(self, *_: Any) -> None:
        self.withdraw()
        scene = bpy.context.scene
        if self.holds(scene):
            self._before = dict(self._written.get(scene.wks_segment.applied, self._before))


def _values(settings: WKSSegmentSettings) -> dict[str, Any]:
    """Of the settings that labels follow."""
    return {name: getattr(settings, name) for name in LIVE}


def session_of(context: bpy.types.Context) -> Session:
    """The session of this Blender."""
    session: Session = getattr(context.window_manager, HOLDER)
    return session
