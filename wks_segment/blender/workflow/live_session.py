"""The live session: keeps the last job in memory, so that labels can follow changed settings within moments."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from itertools import count
from typing import Any, Protocol

import bpy
from bpy.app.handlers import persistent

from ...core import MemoryCache
from ...core.mesh.triangle_mesh import IntArray
from ...core.message import message_of
from ...core.progress import Progress
from ..errors import ChangedError, UserError
from ..outputs.overrides import merge_parts
from ..parts.part_style import Style
from ..props.preferences import preference
from ..props.settings import LABEL_SETTINGS, WKSSegmentSettings
from ..scene.characters import Character
from .background_job import job_holder, redraw_sidebars
from .segmentation_job import SegmentationJob

SESSION = "wks_segment_session"
"""Name of the session at the type of Blender's window manager."""
QUIET_SECONDS = 0.1
"""Seconds without a change of settings before labels follow. With less they would follow while a slider is dragged;
with more the user would notice the wait."""
FOLLOWED_SETTINGS = (*LABEL_SETTINGS, "snap_to")
"""Settings that labels follow."""
NOTHING_TO_UPDATE = "Nothing was learned or applied since this file was opened, or it was undone"
MAX_KEPT_BYTES = 1_000_000_000
"""Most bytes of signatures in a kept job. With less, labels of large characters would not follow; with more, memory
fills without being asked for."""


class Preview(Protocol):
    """Shows labels in the viewport that are not written to a mesh."""

    def show(self, context: bpy.types.Context, labels: Mapping[Character, IntArray], style: Style) -> None:
        """Show labels; UserError if a character cannot be read."""

    def hide(self) -> None:
        """Stop showing labels."""


class Session:
    """Signatures of meshes and the last job, so that labels can follow the settings.

    A scene stores from which job and which settings its labels are (`applied`), so that undo and redo restore that
    together with the labels.

    Parameters
    ----------
    preview : Preview
        Shows labels that are proposed and not yet written.
    """

    def __init__(self, preview: Preview) -> None:
        self._cache = MemoryCache()
        self.job: SegmentationJob | None = None
        self.message = ""
        """Why labels no longer follow, for the panel."""
        self.proposed: tuple[str, SegmentationJob] | None = None
        """The shown but unwritten job with the state of its settings, until it is accepted or discarded."""
        self.preview = preview
        self._before: dict[str, Any] = {}
        """Settings of the labels in the scene."""
        self._numbers = count(1)
        self._name = ""
        self._due = 0.0
        self.timer = self.on_timer
        self._written: dict[str, dict[str, Any]] = {}
        """Settings of labels that were written, by the state that the scene stores of them."""
        self._applied_before_undo = ""
        on = bpy.app.handlers
        self._handlers = (
            (on.load_pre, self._on_load), (on.undo_pre, self._before_undo), (on.undo_post, self._on_undo),
            (on.redo_post, self._on_redo),
        )  # fmt: skip
        for handlers, function in self._handlers:
            handlers.append(function)

    @property
    def cache(self) -> MemoryCache:
        """The signatures, limited to the memory that the preferences allow."""
        self._cache.limit = 1_000_000 * preference(bpy.context, "cache_megabytes")
        return self._cache

    def write(self, job: SegmentationJob) -> None:
        """Write a computed job to its scene and keep it; ChangedError if the scene has changed."""
        scene = job.guard.scene()
        job.write(follows=self.holds(scene))
        self._keep(job, scene)

    def holds(self, scene: bpy.types.Scene) -> bool:
        """Whether the labels in a scene are from the kept job."""
        return self.job is not None and scene.wks_segment.applied.partition(":")[0] == self._name

    def is_current(self, scene: bpy.types.Scene) -> bool:
        """Whether the labels in a scene are from the current settings."""
        return bool(scene.wks_segment.applied == self._state(scene))

    @property
    def is_scheduled(self) -> bool:
        """Whether labels will follow in a moment."""
        return bool(bpy.app.timers.is_registered(self.timer))

    @property
    def seconds(self) -> float:
        """Seconds that labeling took the last time."""
        return 0.0 if self.job is None else self.job.report.seconds.get("label", 0.0)

    @property
    def is_slow(self) -> bool:
        """Whether labeling takes too long to follow without being asked."""
        return bool(self.seconds > preference(bpy.context, "live_seconds"))

    def schedule(self, scene: bpy.types.Scene) -> None:
        """Let labels follow as soon as the settings no longer change, if the user wants that."""
        if not (scene.wks_segment.live and self.holds(scene)) or self.is_slow:
            return
        self._due = time.monotonic() + QUIET_SECONDS
        if not bpy.app.timers.is_registered(self.timer):
            bpy.app.timers.register(self.timer, first_interval=QUIET_SECONDS)

    def on_timer(self) -> float | None:
        """Called by Blender's timer; return the seconds until the next call, None for no further one."""
        context = bpy.context
        rest = self._due - time.monotonic()
        if rest > 0 or job_holder(context).job is not None:
            return max(rest, QUIET_SECONDS)
        scene = context.scene
        if not self.holds(scene) or self.is_current(scene) or context.mode != "OBJECT":
            return None
        window = next(iter(context.window_manager.windows), None)
        try:
            if scene.wks_segment.preview:
                self.propose(context)
            else:
                # The operator makes this one step for undo, as if the user had pressed the button.
                with context.temp_override(window=window):
                    bpy.ops.wks_segment.update("EXEC_DEFAULT", True)
        except UserError as error:
            self.message = message_of(error)
        except RuntimeError as error:
            # The operator has reported in the user's language.
            self.message = str(error).removeprefix("Error: ").strip()
        redraw_sidebars(context)
        return None

    def update(self, scene: bpy.types.Scene) -> SegmentationJob:
        """Run the last job again with the current settings and write it.

        Raises
        ------
        UserError
            If there is no job, the settings need another model, or a mesh has changed, which drops the job.
        """
        if self.job is None:
            raise UserError(NOTHING_TO_UPDATE)
        with self._dropping():
            job = self._recomputed(scene)
            self.write(job)
        return job

    def propose(self, context: bpy.types.Context) -> None:
        """Show in the viewport what `update` would write."""
        scene = context.scene
        with self._dropping():
            job = self._recomputed(scene)
            self.proposed, self.message = (self._state(scene), job), ""
            notes = scene.wks_segment.notes()
            shown = {character: merge_parts(labels, notes.joined) for character, labels in job.labels.items()}
            self.preview.show(context, shown, scene.wks_segment.style())

    def discard(self, scene: bpy.types.Scene) -> None:
        """Hide the proposed labels and restore the settings of the written ones."""
        self.withdraw()
        for name, value in self._before.items():
            setattr(scene.wks_segment, name, value)

    def withdraw(self) -> None:
        """Hide the proposed labels."""
        self.proposed = None
        self.preview.hide()

    def drop(self) -> None:
        """Forget the kept job."""
        self.withdraw()
        self.job, self._name = None, ""
        self._written.clear()

    def close(self) -> None:
        """Forget everything and remove the handlers, before the extension is disabled."""
        self.drop()
        self.cache.clear()
        if bpy.app.timers.is_registered(self.timer):
            bpy.app.timers.unregister(self.timer)
        for handlers, function in self._handlers:
            if function in handlers:
                handlers.remove(function)

    def _keep(self, job: SegmentationJob, scene: bpy.types.Scene) -> None:
        if job.first is None:
            self._name = f"job {next(self._numbers)}"
        self.withdraw()
        self.job, self.message = job, ""
        self._before = _values(scene.wks_segment)
        if sum(described.pose.signature.nbytes for described in set(job.described)) > MAX_KEPT_BYTES:
            self.drop()
        scene.wks_segment.applied = self._state(scene)
        self._written[scene.wks_segment.applied] = dict(self._before)

    def _recomputed(self, scene: bpy.types.Scene) -> SegmentationJob:
        """The last job computed with the current settings; the proposed one if it has these."""
        if self.job is None:
            raise UserError(NOTHING_TO_UPDATE)
        if self.proposed is not None and self.proposed[0] == self._state(scene):
            return self.proposed[1]
        job = self.job.with_settings(scene.wks_segment)
        job.compute(Progress())
        return job

    @contextmanager
    def _dropping(self) -> Iterator[None]:
        """Drop the job if the scene turns out to have changed."""
        try:
            yield
        except ChangedError as error:
            self.drop()
            raise UserError(
                "Segments are no longer updated, learn or apply again: {reason}", reason=message_of(error)
            ) from error

    def _state(self, scene: bpy.types.Scene) -> str:
        """Name of the job and values of the settings that the labels depend on."""
        values = _values(scene.wks_segment)
        if values["auto_segments"]:
            del values["n_segments"]
        return f"{self._name}:{values | {'snap_to': sorted(values['snap_to'])}}"

    @persistent
    def _on_load(self, *_: Any) -> None:
        self.drop()
        self.message = ""

    @persistent
    def _before_undo(self, *_: Any) -> None:
        self._applied_before_undo = bpy.context.scene.wks_segment.applied

    @persistent
    def _on_undo(self, *_: Any) -> None:
        self.withdraw()
        if self.job is None:
            return
        if any(member.resolve() is None for pose in self.job.poses for member in pose.character.members):
            self.drop()
            return
        scene = bpy.context.scene
        if not self.holds(scene) or scene.wks_segment.applied == self._applied_before_undo:
            return
        self._before = dict(self._written.get(scene.wks_segment.applied, self._before))
        if scene.wks_segment.live and not scene.wks_segment.preview:
            # Blender has one step for a setting and one for the labels that followed it; the user sees one change.
            self.message = ""
            for name, value in self._before.items():
                setattr(scene.wks_segment, name, value)

    @persistent
    def _on_redo(self, *_: Any) -> None:
        self.withdraw()
        scene = bpy.context.scene
        if self.holds(scene):
            self._before = dict(self._written.get(scene.wks_segment.applied, self._before))


def _values(settings: WKSSegmentSettings) -> dict[str, Any]:
    """Values of the settings that labels follow."""
    return {name: getattr(settings, name) for name in FOLLOWED_SETTINGS}


def session_of(context: bpy.types.Context) -> Session:
    """The live session of this Blender."""
    session: Session = getattr(context.window_manager, SESSION)
    return session
