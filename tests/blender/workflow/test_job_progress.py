"""Progress of a job: it rises from 0 to 1, and what is known takes no share of it."""

import itertools

import bpy
import pytest
from builders import limbed_poses, select

from wks_segment.blender.workflow.segmentation_job import SegmentationJob
from wks_segment.core import MemoryCache
from wks_segment.core.progress import Progress

pytestmark = pytest.mark.usefixtures("scene")


def reports_of(job):
    """Stages and shares that a job reports."""
    seen = []
    job.compute(Progress(lambda stage, share: seen.append((str(stage), share))))
    shares = [share for _, share in seen]
    assert shares == sorted(shares)
    assert 0 <= shares[0] <= shares[-1] <= 1
    return seen


def first_of(stage, reports):
    return next(share for name, share in reports if name.startswith(stage))


def test_share_of_each_stage(settings, learns_anew):
    select(*limbed_poses(0, 0.4, 0.8))
    cache = MemoryCache()
    first = SegmentationJob.learning(bpy.context, cache)
    reports = reports_of(first)
    assert 0.05 < first_of("Learning", reports) < 0.3, "signatures of so few eigenpairs take little time"
    assert first_of("Segments", reports) > 0.9
    again = reports_of(SegmentationJob.learning(bpy.context, cache))
    assert first_of("Learning", again) == 0
    # Parts are known as well, so that learning does not begin in the middle.
    assert next(share for stage, share in again if share > 0) < 0.3
    first.write()
    settings.smoothness = 0.5
    other_settings = reports_of(first.with_settings(settings))
    assert first_of("Segments", other_settings) < 0.7


def test_share_of_labels_with_a_given_model(settings):
    shown = limbed_poses(0, 0.4)
    select(shown[0])
    job = SegmentationJob.learning(bpy.context, MemoryCache())
    job.compute(Progress())
    job.write()
    select(shown[1])
    cache = MemoryCache()
    assert first_of("Segments", reports_of(SegmentationJob.applying(bpy.context, cache))) > 0.5
    known = reports_of(SegmentationJob.applying(bpy.context, cache))
    assert first_of("Segments", known) < 0.7
    # The bar cannot be far from the time where no large step follows.
    shares = [0, *(share for _, share in known), 1]
    assert max(after - before for before, after in itertools.pairwise(shares)) <= 0.6
