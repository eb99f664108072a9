"""Ranking: which of several models fits a character, and what to tell the user about it."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import bpy

from ... import core
from ...core.message import Message, message_of
from ...core.progress import Progress
from ..errors import UserError
from ..props.preferences import model_folder
from ..props.settings import WKSSegmentSettings
from ..scene import poses as reader
from ..scene.change_guard import ChangeGuard
from ..scene.characters import group, selected_meshes
from ..scene.pose_sources import active_character
from ..scene.poses import Pose
from . import describing, model_library
from .describing import Run
from .report import Report
from .stored_messages import as_json, as_text

VERDICT_TEMPLATES = {
    "sure": "{first} fits, with certainty",
    "unsure": "{first} fits best, but not with certainty: {second} may fit as well",
    "nothing fits": "No model fits; the closest is {first}. Learn a new model",
}
"""Message for each verdict of `core.rank`."""


@dataclass(frozen=True)
class NamedModel:
    """A model to rank, with its name, and its file if it is in the model folder."""

    name: str
    model: core.PoseSegmentation
    path: Path | None = None


def verdict_message(ranking: core.Ranking, names: Sequence[str]) -> Message:
    """The verdict of a ranking for the user, given the names of the models."""
    first, second = names[ranking.best.index], names[ranking.ranks[min(1, len(ranking.ranks) - 1)].index]
    if ranking.verdict == "unsure" and first == second:
        return Message("{first} is the only model to compare with", first=first)
    return Message(VERDICT_TEMPLATES[ranking.verdict], first=first, second=second)


def models_to_rank(context: bpy.types.Context, report: Report) -> list[NamedModel]:
    """The models of the scene, of the model folder and of the extension; one that cannot be read is left out.

    The report gets a warning about it.

    Raises
    ------
    UserError
        If there is none.
    """
    models: list[NamedModel] = []
    for name, text in model_library.all_of(context.scene.wks_segment):
        try:
            models.append(NamedModel(name, core.PoseSegmentation.from_json(text)))
        except ValueError as error:
            report.warn(Message('The model "{name}" was left out: {reason}', name=name, reason=message_of(error)))
    for files in (model_library.in_folder(model_folder(context)), model_library.starters()):
        models += models_in_files(files, report)
    models = without_copies(models)
    if not models:
        raise UserError("No model yet: learn one, import one, or set Model Folder in the preferences of the add-on")
    return models


def without_copies(models: Sequence[NamedModel]) -> list[NamedModel]:
    """The models without those that have learned the same as one before, whatever their number of segments.

    A copy would halve the probability of its original.
    """
    learned: dict[bytes, NamedModel] = {}
    for named in models:
        mixture = named.model.mixture_
        learned.setdefault(mixture.weights.tobytes() + mixture.means.tobytes(), named)
    return list(learned.values())


def fit_warning(
    models: Sequence[NamedModel], described: Sequence[core.PoseSignature], character: str
) -> Message | None:
    """A warning that the first of some models does not fit a character, as *Rank Models* knows it; None if it may.

    Only models that take the same signature as the first are compared with it, since others would need another one.
    """
    alike = core.described_alike([named.model for named in models])[0]
    compared = without_copies([models[i] for i in alike])
    ranking = core.rank([named.model for named in compared], [described] * len(compared))
    best = compared[ranking.best.index].name
    if ranking.verdict == "nothing fits":
        return Message(
            '"{model}" does not fit "{character}", and no other model does: learn a new one',
            model=models[0].name, character=character,
        )  # fmt: skip
    if ranking.best.index > 0 and ranking.verdict == "sure":
        return Message(
            '"{model}" does not fit "{character}": "{better}" fits better',
            model=models[0].name, character=character, better=best,
        )  # fmt: skip
    return None


def models_of(settings: WKSSegmentSettings, uid: str) -> list[NamedModel]:
    """The models of a scene that can be read, the one with an identity first; none if it is not there."""
    rows = sorted(settings.models, key=lambda row: row.uid != uid)
    if not rows or rows[0].uid != uid:
        return []
    found = []
    for row in rows:
        try:
            found.append(
                NamedModel(row.name, core.PoseSegmentation.from_json(model_library.text_of(settings, row.uid)))
            )
        except ValueError:
            if row.uid == uid:
                return []
    return found


def models_in_files(paths: Mapping[str, Path], report: Report) -> list[NamedModel]:
    """The models in files by name; one that cannot be read is left out with a warning."""
    models = []
    for name, path in paths.items():
        try:
            models.append(NamedModel(name, model_library.loaded(path), path))
        except UserError as error:
            report.warn(Message("Left out: {reason}", reason=message_of(error)))
    return models


def largest(models: Sequence[NamedModel]) -> core.PoseSegmentation:
    """The model whose signature takes the most time and memory."""
    return max((named.model for named in models), key=lambda model: model.n_eigenpairs)


def rank_poses(models: Sequence[NamedModel], poses: Sequence[Pose], run: Run) -> core.Ranking:
    """Rank models by how well they fit poses of one character; UserError if a pose cannot be described.

    Models with the same signature share the described poses.
    """
    fitted = [named.model for named in models]
    described: dict[int, list[core.PoseSignature]] = {}
    for alike, progress in run.progress.each(core.described_alike(fitted), "Reading"):
        signatures = [each.pose for each in describing.describe(fitted[alike[0]], poses, run.with_progress(progress))]
        described |= dict.fromkeys(alike, signatures)
    with run.report.stage("rank"):
        return core.rank(fitted, [described[i] for i in range(len(fitted))])


@dataclass
class RankingJob:
    """A job that ranks models for the active character.

    Everything that it needs of Blender is read when it is made; `compute` works on arrays only, and `write` brings the
    result back.
    """

    models: list[NamedModel]
    poses: list[Pose]
    guard: ChangeGuard
    report: Report
    cache: core.Cache
    ranking: core.Ranking | None = None

    @classmethod
    def read(cls, context: bpy.types.Context, cache: core.Cache) -> RankingJob:
        """Read the models, and the active character in its current pose; UserError if either cannot be used."""
        report = Report([])
        model_library.list_active(context.scene.wks_segment)
        models = models_to_rank(context, report)
        with report.stage("read"):
            character = active_character(context, group(selected_meshes(context)))
            report.poses = reader.read_objects(context, [character])
        return cls(models, report.poses, ChangeGuard(context.scene, [character]), report, cache)

    @property
    def model(self) -> core.PoseSegmentation:
        """The model that the limits of time and memory are checked for."""
        return largest(self.models)

    def compute(self, progress: Progress) -> None:
        """Describe the character and rank the models; UserError if the core refuses.

        Touches nothing of Blender, so that a thread can run it.
        """
        self.ranking = rank_poses(self.models, self.poses, Run(self.report, progress, self.cache))

    def write(self) -> Message:
        """Store the ranking in the scene and return the verdict; ChangedError if the scene has changed."""
        self.guard.check_fully()
        assert self.ranking is not None
        settings = self.guard.scene().wks_segment
        names = [named.name for named in self.models]
        settings.ranking.clear()
        starters = set(model_library.starters().values())
        in_order = sorted(
            self.ranking.ranks, key=lambda rank: not (rank.fits and self.models[rank.index].path in starters)
        )
        for place in in_order:
            item, named = settings.ranking.add(), self.models[place.index]
            item.name, item.path = named.name, str(named.path or "")
            item.score, item.probability, item.fits = place.score, place.probability, place.fits
        character = self.poses[0].character
        settings.ranked = json.dumps([member.name for member in character.members])
        verdict = Message(
            "{character}: {verdict}", character=character.name, verdict=verdict_message(self.ranking, names)
        )
        settings.verdict, settings.verdict_messages = as_text([verdict]), as_json([verdict])
        return verdict


def ranked_objects(context: bpy.types.Context) -> list[bpy.types.Object]:
    """The objects that were ranked last; UserError if one is gone."""
    names = json.loads(context.scene.wks_segment.ranked or "[]")
    objects = [context.scene.objects.get(name) for name in names]
    if not objects or any(obj is None or obj.type != "MESH" for obj in objects):
        raise UserError("The ranked objects are gone: rank the models again")
    return [obj for obj in objects if obj is not None]
