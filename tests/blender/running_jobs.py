"""Operators whose jobs run in a thread, driven by the functions that the window calls: bpy alone has no window."""

import time

import bpy

from wks_segment.blender.operators._base import LabelOperator
from wks_segment.blender.operators.apply import WKS_SEGMENT_OT_apply
from wks_segment.blender.operators.learn import WKS_SEGMENT_OT_learn
from wks_segment.blender.workflow.background_job import job_holder

OPS = bpy.ops.wks_segment
LEARN, APPLY = WKS_SEGMENT_OT_learn, WKS_SEGMENT_OT_apply
RUNNING = {"PASS_THROUGH"}
"""What an operator returns while its job runs."""
TIMEOUT = 60
"""Seconds after which a test that hangs fails."""


class CallableOperator:
    """Make an operator that can be called without Blender, and keeps what it reports."""

    def __new__(cls, operator, **properties):
        reported = []
        own = {name: getattr(operator, name) for name in ("bl_label", "verb", "learns", "read")}
        report = {
            "report": lambda self, kinds, text: reported.append((*kinds, text)),
            "reported": reported,
            "confirmed": False,
        }
        plain = {"take": lambda self, settings: None, "is_adjusted": False}
        return type("CallableOperator", (LabelOperator,), own | report | plain | properties)()


def finish_job(ran):
    """Step until the job is over; return how the operator ends."""
    result, begun = RUNNING, time.monotonic()
    while result == RUNNING:
        assert time.monotonic() - begun < TIMEOUT
        time.sleep(0.01)
        result = ran.step(bpy.context)
    assert job_holder(bpy.context).job is None
    return result


def run(operator, **properties):
    """Run the job of an operator to its end; return the operator and its result."""
    ran = CallableOperator(operator, **properties)
    ran.start_thread(bpy.context)
    return ran, finish_job(ran)
