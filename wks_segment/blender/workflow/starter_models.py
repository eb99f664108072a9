"""The models that come with the extension: named parts for a mesh without poses and without a rig.

They are only read: applying one adds a copy of it to the scene.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, field

import bpy
import numpy as np

from ... import core
from ...core.mesh.triangle_mesh import FloatArray
from ...core.message import Message
from ...core.progress import Progress
from ..errors import UserError
from ..parts import part_ids
from ..props.settings import WKSSegmentSettings
from ..scene.characters import quoted
from . import describing, model_library
from .describing import Run
from .model_ranking import NamedModel
from .segmentation_job import SegmentationJob

RANKED_SHARE = 0.8
"""Share of the progress after which the model is chosen: signatures take most of the time, and serve to label too."""


@dataclass
class StarterJob(SegmentationJob):
    """A job that labels meshes by the starter model that fits them best.

    Attributes
    ----------
    starters : list of NamedModel
    chosen : NamedModel, optional
        The one that fits, once computed.
    """

    starters: list[NamedModel] = field(default_factory=list)
    chosen: NamedModel | None = None

    @classmethod
    def reading(cls, context: bpy.types.Context, cache: core.Cache) -> StarterJob:
        """Read the selected objects and the starter models; UserError if they cannot be used."""
        starters = [
            NamedModel(name, model_library.loaded(path), path) for name, path in model_library.starters().items()
        ]
        if not starters:
            raise UserError("This copy of the extension has no starter models: install it again")
        largest = max(starters, key=lambda named: named.model.n_eigenpairs)
        job = SegmentationJob.applying(context, cache, largest.model, keeps_number=True)
        return cls(**{**vars(job), "starters": starters})

    def compute(self, progress: Progress) -> None:
        """Find the model that fits best, and label with it; the report warns if it is unlike all that was learned.

        That is no reason to refuse: a cartoon figure can be as unlike a real body as a chair is, and still be a person.

        Touches nothing of Blender, so that a thread can run it.
        """
        if self.chosen is None:
            # Signatures that are computed for the ranking serve to label as well.
            self.cache = self.cache or core.MemoryCache()
            margins = self._margins(Run(self.report, progress.part(0.0, RANKED_SHARE), self.cache))
            best = int(np.argmax(margins))
            self.chosen = self.starters[best]
            if margins[best] < -1.0:
                self.report.warn(
                    Message(
                        "{names} is unlike all that the starter models ({models}) learned: check the parts, or learn a "
                        "model from poses or from your own parts",
                        names=quoted(dict.fromkeys(pose.character.name for pose in self.poses)),
                        models=", ".join(named.name for named in self.starters),
                    )
                )
            self.model = copy(self.chosen.model)
            self.model.smoothness = self.values["smoothness"]
            self.take_number()
            progress = progress.part(RANKED_SHARE, 1.0)
        super().compute(progress)

    def _margins(self, run: Run) -> FloatArray:
        """(starters,) how far above its usual scores each model scores the poses; below −1 it does not fit.

        In units of the difference that is tolerated: likelihoods alone prefer the model that has seen the most
        different bodies, on every shape.
        """
        from ...core.ranking import least_usual

        models = [named.model for named in self.starters]
        margins = np.empty(len(models))
        for alike, progress in run.progress.each(core.described_alike(models), "Reading"):
            poses = describing.describe(models[alike[0]], self.poses, run.with_progress(progress))
            for i in alike:
                usual = models[i].usual_scores_
                score = np.mean([models[i].comparable_score(each) for each in poses])
                margins[i] = (score - usual.mean()) / (usual.mean() - least_usual(usual))
        return margins

    def keep_starter(self, settings: WKSSegmentSettings) -> None:
        """Add the chosen model to the scene, if it is not there, and use it."""
        assert self.chosen is not None
        file = Message("From {names}", names=Message("the starter models"))
        summary = [file, Message("{count} segments", count=self.model.n_segments_)]
        labels = model_library.add_once(settings, copy(self.chosen.model), self.chosen.name, summary)
        self.uid = part_ids.model_of(labels)
