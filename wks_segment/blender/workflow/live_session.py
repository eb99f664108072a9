"""The live session: keeps jobs in memory, so that labels can follow changed settings within moments."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from typing import Any, Protocol

import bpy
from bpy.app.handlers import persistent

from ... import core
from ...core.mesh.triangle_mesh import IntArray
from ...core.message import Message, message_of
from ...core.progress import Progress
from ..errors import ChangedError, UserError
from ..outputs.origin import Origin, origin_of
from ..outputs.overrides import merge_parts
from ..parts.part_style import Style
from ..props.label_set import notes_of, style_of
from ..props.preferences import preference
from ..scene.characters import Character
from . import model_library, segment_list
from .background_job import job_holder
from .followed_settings import are_alike, show, values_of
from .passing_message import PassingMessage, redraw_sidebars
from .segmentation_job import SegmentationJob
from .update_job import UpdateJob

SESSION = "wks_segment_session"
"""Name of the session at the type of Blender's window manager."""
QUIET_SECONDS = 0.1
"""Seconds without a change of settings before labels follow. With less they would follow while a slider is dragged;
with more the user would notice the wait."""
NOTHING_TO_UPDATE = "Nothing is selected that has segments of a model: use Learn and Segment or Apply to Selected"
ASLEEP = "What Live needs was not kept: press Update Segments once, and it follows again"
MAX_KEPT_BYTES = 1_000_000_000
"""Most bytes of signatures in the kept jobs. With less, labels of large characters would not follow; with more, memory
fills without being asked for."""


class Preview(Protocol):
    """Shows labels in the viewport that are not written to a mesh."""

    def show(
        self, context: bpy.types.Context, labels: Mapping[Character, IntArray], styles: Mapping[Character, Style]
    ) -> None:
        """Show labels in the colors of their label sets; UserError if a character cannot be read."""

    def hide(self) -> None:
        """Stop showing labels."""


class Session:
    """Signatures of meshes and the jobs that labeled them, so that labels can follow the settings.

    Each mesh keeps the name of its job and the settings of its labels, so undo and redo restore that together with the
    labels, and what is selected says which labels follow. Labels that follow are no undo step of their own: they belong
    to the step of the changed setting, and follow again when that step is redone.

    Parameters
    ----------
    preview : Preview
        Shows labels that are proposed and not yet written.
    """

    def __init__(self, preview: Preview) -> None:
        self._kept: dict[str, SegmentationJob] = {}
        """Jobs by name, the one that was used last at the end."""
        self._message = PassingMessage()
        self.proposed: tuple[dict[str, Any], UpdateJob] | None = None
        """The shown but unwritten jobs with the values of their settings, until they are accepted or discarded."""
        self.preview = preview
        self._due = 0.0
        self.timer = self.on_timer
        bpy.app.handlers.load_pre.append(self._on_load)

    @cached_property
    def _cache(self) -> core.MemoryCache:
        return core.MemoryCache()

    @property
    def cache(self) -> core.MemoryCache:
        """The signatures, limited to the memory that the preferences allow."""
        self._cache.limit = 1_000_000 * preference(bpy.context, "cache_megabytes")
        return self._cache

    @property
    def job(self) -> SegmentationJob | None:
        """The kept job that was used last."""
        return next(reversed(self._kept.values()), None)

    @property
    def message(self) -> str:
        """Why labels did not follow, for the panel."""
        return self._message.text

    def tell(self, message: str) -> None:
        """Show in the panel why labels did not follow; an empty text takes that back."""
        self._message.show(message)

    def write(self, job: SegmentationJob) -> None:
        """Write a computed job to its scene and keep it; ChangedError if the scene has changed."""
        job.write()
        self.withdraw()
        self.tell("")
        self._kept.pop(job.name, None)
        self._kept[job.name] = job
        while self._kept and sum(_bytes_of(each) for each in self._kept.values()) > MAX_KEPT_BYTES:
            self._kept.pop(next(iter(self._kept)))

    def holds(self, scene: bpy.types.Scene) -> bool:
        """Whether all labels that would follow in a scene are from kept jobs."""
        origins = self._followers(scene)
        return bool(origins) and all(origin.job in self._kept for origin in origins.values())

    def is_current(self, scene: bpy.types.Scene) -> bool:
        """Whether the labels of the object that the fields are about are from the current settings.

        Others that are selected follow with it, but not before a field changes: until then each keeps its own.
        """
        settings = scene.wks_segment
        subject, followers = segment_list.shown_object(settings), self._followers(scene)
        if subject is None or subject not in followers or settings.shown != subject.data.name:
            return True
        return are_alike(followers[subject].settings, values_of(settings))

    def can_update(self, scene: bpy.types.Scene) -> bool:
        """Whether there are labels that can be updated to the settings, if need be with new signatures."""
        return bool(self._followers(scene))

    def leads(self, obj: bpy.types.Object) -> bool:
        """Whether the labels of an object follow the settings once it is selected."""
        return obj in self._followers(bpy.context.scene)

    def _followers(self, scene: bpy.types.Scene) -> dict[bpy.types.Object, Origin]:
        """The objects whose labels follow the settings: the chosen ones, if their job is kept or their model is there.

        Transferred labels follow nothing.
        """
        rows = {row.uid for row in scene.wks_segment.models}
        origins = {obj: origin_of(obj.data) for obj in segment_list.chosen(scene.wks_segment)}
        return {
            obj: origin
            for obj, origin in origins.items()
            if not origin.transferred and (origin.job in self._kept or origin.model in rows)
        }

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

    def follow(self, scene: bpy.types.Scene) -> None:
        """After undo, redo or a job, let labels follow settings that are others than theirs."""
        self.withdraw()
        if not self.is_current(scene):
            self.schedule(scene)

    def on_timer(self) -> float | None:
        """Called by Blender's timer; return the seconds until the next call, None for no further one."""
        context = bpy.context
        rest = self._due - time.monotonic()
        if rest > 0 or job_holder(context).job is not None:
            return max(rest, QUIET_SECONDS)
        scene = context.scene
        if not self.holds(scene) or context.mode != "OBJECT":
            return None
        if self.is_current(scene):  # again, after a preview or a warning
            self.withdraw()
            self.tell("")
            return None
        window = next(iter(context.window_manager.windows), None)
        try:
            if scene.wks_segment.preview:
                self.propose(context)
            else:
                # Without a step for undo: Blender has made one for the setting, and the user sees one change.
                with context.temp_override(window=window):
                    bpy.ops.wks_segment.update("EXEC_DEFAULT", False)
        except UserError as error:
            self.tell(message_of(error))
        except RuntimeError as error:
            # The operator has reported in the user's language.
            self.tell(str(error).removeprefix("Error: ").strip())
        redraw_sidebars(context)
        return None

    def updated(self, context: bpy.types.Context) -> UpdateJob:
        """The jobs of the selected objects with the current settings, not computed unless they are proposed.

        What was not kept is read again, in the current pose.

        Raises
        ------
        UserError
            If there are none, the settings need another model, or a mesh has changed, which drops its job.
        """
        scene, settings = context.scene, context.scene.wks_segment
        if self.proposed is not None and are_alike(self.proposed[0], values_of(settings)):
            return self.proposed[1]
        asleep: dict[str, list[bpy.types.Object]] = {}
        awake: dict[str, list[bpy.types.Object]] = {}
        for obj, origin in self._followers(scene).items():
            group, key = (awake, origin.job) if origin.job in self._kept else (asleep, origin.model)
            group.setdefault(key, []).append(obj)
        jobs = []
        for name, objects in awake.items():
            with self._dropping(name):
                jobs.append(self._kept[name].with_settings(settings, objects))
        for uid, objects in asleep.items():
            model = model_library.from_text(model_library.text_of(settings, uid))
            jobs.append(SegmentationJob.applying(context, self.cache, model, objects, uid))
        if not jobs:
            raise UserError(NOTHING_TO_UPDATE)
        return UpdateJob(jobs)

    def write_all(self, update: UpdateJob) -> None:
        """Write computed jobs; UserError if a mesh has changed."""
        for job in update.jobs:
            with self._dropping(job.name):
                self.write(job)
        self._tell_warnings(update)

    def _tell_warnings(self, update: UpdateJob) -> None:
        """Show warnings in the panel: what a timer does is not in the status bar."""
        warnings = dict.fromkeys(warning for job in update.jobs for warning in job.report.warnings)
        self.tell(Message.joined(". ", warnings))

    def propose(self, context: bpy.types.Context) -> None:
        """Show in the viewport what an update would write."""
        update = self.updated(context)
        if self.proposed is None or update is not self.proposed[1]:
            update.compute(Progress())
        self.proposed = values_of(context.scene.wks_segment), update
        self._tell_warnings(update)
        shown: dict[Character, IntArray] = {}
        styles: dict[Character, Style] = {}
        for job in update.jobs:
            key = f"{job.uid}/{job.model.n_segments_}"
            joined, style = notes_of(key).joined, style_of(key)
            shown |= {character: merge_parts(labels, joined) for character, labels in job.labels.items()}
            styles |= dict.fromkeys(job.labels, style)
        for job in update.jobs:
            with self._dropping(job.name):
                job.guard.check_fully()
        self.preview.show(context, shown, styles)

    def discard(self, scene: bpy.types.Scene) -> None:
        """Hide the proposed labels and restore the settings of the written ones."""
        self.withdraw()
        subject = segment_list.shown_object(scene.wks_segment)
        if subject is not None:
            show(scene.wks_segment, origin_of(subject.data).settings)

    def withdraw(self) -> None:
        """Hide the proposed labels."""
        self.proposed = None
        self.preview.hide()

    def drop(self) -> None:
        """Forget the kept jobs."""
        self.withdraw()
        self._kept.clear()

    def close(self) -> None:
        """Forget everything and remove the handlers, before the extension is disabled."""
        self.drop()
        self.cache.clear()
        if bpy.app.timers.is_registered(self.timer):
            bpy.app.timers.unregister(self.timer)
        if self._on_load in bpy.app.handlers.load_pre:
            bpy.app.handlers.load_pre.remove(self._on_load)

    @contextmanager
    def _dropping(self, name: str) -> Iterator[None]:
        """Drop a job if the scene turns out to have changed."""
        try:
            yield
        except ChangedError as error:
            self._kept.pop(name, None)
            self.withdraw()
            raise UserError(
                "Segments are no longer updated, learn or apply again: {reason}", reason=message_of(error)
            ) from error

    @persistent
    def _on_load(self, *_: Any) -> None:
        self.drop()
        self.tell("")


def _bytes_of(job: SegmentationJob) -> int:
    first = job.first or job
    return sum(described.pose.signature.nbytes for described in set(first.described))


def session_of(context: bpy.types.Context) -> Session:
    """The live session of this Blender."""
    session: Session = getattr(context.window_manager, SESSION)
    return session
