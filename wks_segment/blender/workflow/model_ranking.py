"""Which of several models fits a character: what the operator and the command line share, and what they say of it."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import bpy

from ...core import PoseSegmentation, PoseSignature, Ranking, SignatureCache, described_alike, rank
from ...core.poses.describe import Progress
from ..errors import UserError
from ..props.preferences import model_folder
from ..scene import poses as reader
from ..scene.change_guard import Watch
from ..scene.characters import group, selected_meshes
from ..scene.pose_sources import active_character
from ..scene.poses import Pose
from . import model_library, pipeline
from .live_session import session_of
from .report import Report

SAYING = {
    "sure": "{first} fits, surely",
    "unsure": "{first} fits best, but unsure: {second} may as well",
    "nothing fits": "Nothing fits: far from all that {first}, the nearest, learned. Learn a new model",
}
"""What a verdict is for a person."""


@dataclass(frozen=True)
class Candidate:
    """A model that may fit, by its name; of the model folder with its file."""

    name: str
    model: PoseSegmentation
    path: Path | None = None


def said(ranking: Ranking, names: Sequence[str]) -> str:
    """The verdict on a ranking, given the models' names."""
    first, second = names[ranking.best.index], names[ranking.ranks[min(1, len(ranking.ranks) - 1)].index]
    if ranking.verdict == "unsure" and first == second:
        return f"{first} is the only one there is to compare with"
    return SAYING[ranking.verdict].format(first=first, second=second)


def candidates(context: bpy.types.Context, report: Report) -> list[Candidate]:
    """The models of the scene and of the model folder; one that cannot be read is named in a warning.

    Raises
    ------
    UserError
        If there is none.
    """
    found: list[Candidate] = []
    for name, text in model_library.all_of(context.scene.wks_segment):
        try:
            found.append(Candidate(name, PoseSegmentation.from_json(text)))
        except ValueError as error:
            report.warn(f'The model "{name}" was left out: {error}')
    found += of_files(model_library.in_folder(model_folder(context)), report)
    if not found:
        raise UserError("No model yet: learn one, import one, or set Model Folder in the preferences of the add-on")
    return found


def of_files(paths: Mapping[str, Path], report: Report) -> list[Candidate]:
    """The models in files; one that cannot be read is named in a warning."""
    found = []
    for name, path in paths.items():
        try:
            found.append(Candidate(name, model_library.loaded(path), path))
        except UserError as error:
            report.warn(f"Left out: {error}")
    return found


def rank_poses(
    candidates: Sequence[Candidate], poses: Sequence[Pose], report: Report, progress: Progress,
    cache: SignatureCache | None = None, workers: int | None = None,
) -> Ranking:  # fmt: skip
    """Say which models fit poses of one character; UserError if a pose cannot be described."""
    described: dict[int, list[PoseSignature]] = {}
    together = described_alike([candidate.model for candidate in candidates])
    for number, alike in enumerate(together):

        def tick(stage: str, share: float, begun: int = number) -> None:
            progress(stage, (begun + share) / len(together))

        works = pipeline.describe(candidates[alike[0]].model, poses, report, tick, cache=cache, workers=workers)
        described |= {i: [work.pose for work in works] for i in alike}
    with report.stage("rank"):
        return rank([candidate.model for candidate in candidates], [described[i] for i in range(len(candidates))])


@dataclass
class RankWork:
    """The ranking of the active character, made of what was read; nothing but arrays until it is written."""

    candidates: list[Candidate]
    poses: list[Pose]
    watch: Watch
    report: Report
    cache: SignatureCache
    ranking: Ranking | None = field(default=None)

    @classmethod
    def read(cls, context: bpy.types.Context) -> RankWork:
        """Read the models, and the active character as it is now; UserError if either cannot be used."""
        report = Report([])
        model_library.adopt(context.scene.wks_segment)
        found = candidates(context, report)
        with report.stage("read"):
            character = active_character(context, group(selected_meshes(context)))
            report.poses = reader.read_objects(context, [character])
        watch = Watch(context.scene, [character])
        return cls(found, report.poses, watch, report, session_of(context).cache)

    @property
    def model(self) -> PoseSegmentation:
        """The one whose signature takes most."""
        return max((each.model for each in self.candidates), key=lambda model: model.n_eigenpairs)

    def compute(self, progress: Progress) -> None:
        """Describe and compare; UserError if the core refuses. Fit for a thread."""
        self.ranking = rank_poses(self.candidates, self.poses, self.report, progress, self.cache)

    def write(self) -> str:
        """Let the scene show the ranking; the verdict. ChangedError if what was read has changed."""
        self.watch.look()
        assert self.ranking is not None
        settings = self.watch.scene().wks_segment
        names = [candidate.name for candidate in self.candidates]
        settings.ranking.clear()
        for place in self.ranking.ranks:
            item, candidate = settings.ranking.add(), self.candidates[place.index]
            item.name, item.path = candidate.name, str(candidate.path or "")
            item.score, item.probability = place.score, place.probability
        character = self.poses[0].character
        settings.ranked = json.dumps([member.name for member in character.members])
        settings.verdict = f"{character.name}: {said(self.ranking, names)}"
        verdict: str = settings.verdict
        return verdict


def ranked_objects(context: bpy.types.Context) -> list[bpy.types.Object]:
    """The objects that were ranked last; UserError if one is gone."""
    names = json.loads(context.scene.wks_segment.ranked or "[]")
    found = [context.scene.objects.get(name) for name in names]
    if not found or any(obj is None or obj.type != "MESH" for obj in found):
        raise UserError("What was ranked is gone: rank anew")
    return [obj for obj in found if obj is not None]
