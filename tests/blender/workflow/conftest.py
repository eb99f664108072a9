"""Fixtures of the workflow's tests."""

import threading

import bpy
import pytest
from builders import limbed, limbed_poses, limbed_rigged, select
from height_bands import write
from running_jobs import LEARN, RUNNING, TIMEOUT, CallableOperator

from wks_segment.blender.workflow.background_job import BackgroundJob
from wks_segment.blender.workflow.live_session import session_of
from wks_segment.core import MemoryCache, PoseSegmentation


@pytest.fixture
def pair(settings):
    """Two objects with parts 0, 1, 1002 and 2002, in colors, materials and hard vertex groups."""
    settings.write_materials, settings.vertex_groups = True, "hard"
    objects = [limbed("First"), limbed("Second", bend=0.5)]
    select(*objects)
    write(settings, *objects)
    return objects


@pytest.fixture
def poses(settings):
    """Three objects in three poses, selected, with sides, soft groups and materials in the settings."""
    settings.sides, settings.vertex_groups, settings.write_materials = "two", "soft", True
    made = limbed_poses(0.0, 0.3, 0.6)
    select(*made)
    return made


@pytest.fixture
def hold_at(monkeypatch):
    """A function that holds the next job at a stage; it returns the operator and a function that lets the job go on."""
    go_on_event = threading.Event()

    def hold(stage, operator=LEARN, **properties):
        reached, original = threading.Event(), BackgroundJob._report

        def progress(self, now, share):
            if now.startswith(stage) and not reached.is_set():
                reached.set()
                assert go_on_event.wait(TIMEOUT)
            original(self, now, share)

        monkeypatch.setattr(BackgroundJob, "_report", progress)
        ran = CallableOperator(operator, **properties)
        ran.start_thread(bpy.context)
        assert reached.wait(TIMEOUT)
        assert ran.step(bpy.context) == RUNNING
        return ran, go_on_event.set

    yield hold
    go_on_event.set()


@pytest.fixture
def session(scene):
    found = session_of(bpy.context)
    found.drop()
    found.cache.clear()
    return found


@pytest.fixture
def walker(session, settings):
    """A character that was learned from two frames."""
    obj = limbed_rigged()
    select(obj)
    settings.source, settings.pose_count = "FRAMES", 2
    assert bpy.ops.wks_segment.learn() == {"FINISHED"}
    return obj


@pytest.fixture
def fits(monkeypatch):
    """How often a model was fitted, and how often a pose described."""
    times = {"fit": 0, "describe": 0}
    fit, solve = PoseSegmentation.fit, MemoryCache.put

    def counted_fit(self, *arguments):
        times["fit"] += 1
        return fit(self, *arguments)

    def counted_put(self, *arguments):
        times["describe"] += 1
        return solve(self, *arguments)

    monkeypatch.setattr(PoseSegmentation, "fit", counted_fit)
    monkeypatch.setattr(MemoryCache, "put", counted_put)
    return times
