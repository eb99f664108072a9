"""The models that come with the extension: named parts for a mesh without poses and without a rig.

They are only read: applying one adds a copy of it to the scene.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, field

import bpy

from ... import core
from ...core.message import Message
from ...core.progress import Progress
from ..errors import UserError
from ..parts import part_ids
from ..props.settings import WKSSegmentSettings
from ..scene.characters import quoted
from . import model_library
from .describing import Run
from .model_ranking import NamedModel, rank_poses
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
            run = Run(self.report, progress.part(0.0, RANKED_SHARE), self.cache)
            ranking = rank_poses(self.starters, self.poses, run)
            self.chosen = self.starters[ranking.best.index]
            if not ranking.best.fits:
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

    def keep_starter(self, settings: WKSSegmentSettings) -> None:
        """Add the chosen model to the scene, if it is not there, and use it."""
        assert self.chosen is not None
        file = Message("From {names}", names=Message("the starter models"))
        summary = [file, Message("{count} segments", count=self.model.n_segments_)]
        labels = model_library.add_once(settings, copy(self.chosen.model), self.chosen.name, summary)
        self.uid = part_ids.model_of(labels)
