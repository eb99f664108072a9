"""Operators whose jobs run in a thread, driven by the functions that the window calls: bpy alone has no window."""

import time

import bpy

from wks_segment.blender.operators._base import LabelOperator
from wks_segment.blender.operators.apply import WKS_SEGMENT_OT_apply
from wks_segment.blender.operators.learn import WKS_SEGMENT_OT_learn
from wks_segment.blender.workflow.background_job import job_holder

OPS = bpy.ops.wks_segment
LEARN, APPLY = WKS_SEGMENT_OT_learn, WKS_SEGMENT_OT_apply
GOING = {"PASS_THROUGH"}
"""What an operator returns while its job runs."""
LONG = 60
"""Seconds after which a test that hangs fails."""


class Ran:
    """What Blender makes of an operator's class: an operator that can be called, and keeps what it says."""

    def __new__(cls, operator, **properties):
        said = []
        own = {name: getattr(operator, name) for name in ("bl_label", "verb", "learns", "read")}
        report = {"report": lambda self, kinds, text: said.append((*kinds, text)), "said": said, "confirmed": False}
        plain = {"take": lambda self, settings: None, "is_adjusted": False}
        return type("Ran", (LabelOperator,), own | report | plain | properties)()


def ended(ran):
    """How the operator ends, once its job is over."""
    result, begun = GOING, time.monotonic()
    while result == GOING:
        assert time.monotonic() - begun < LONG
        time.sleep(0.01)
        result = ran.step(bpy.context)
    assert job_holder(bpy.context).job is None
    return result


def run(operator, **properties):
    """An operator whose job ran to its end, and how that was."""
    ran = Ran(operator, **properties)
    ran.begin(bpy.context)
    return ran, ended(ran)
