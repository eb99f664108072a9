"""Settings that an operator shows where it can be adjusted, below the viewport."""

from __future__ import annotations

from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty

from ..props.settings import TUNED, WKSSegmentSettings

HERE = {"options": {"SKIP_SAVE"}}


class Tunable:
    """An operator with the scene's settings that labels follow, as its own: what it is given, the scene gets."""

    n_segments: IntProperty(**TUNED["n_segments"], **HERE)
    auto_segments: BoolProperty(**TUNED["auto_segments"], **HERE)
    sides: EnumProperty(**TUNED["sides"], **HERE)
    smoothness: FloatProperty(**TUNED["smoothness"], **HERE)
    min_share: FloatProperty(**TUNED["min_share"], **HERE)

    def take(self, settings: WKSSegmentSettings) -> None:
        """Hand what the operator was given to the scene, and take the rest from there."""
        for name in TUNED:
            if self.properties.is_property_set(name):  # type: ignore[attr-defined]  # an operator's own
                setattr(settings, name, getattr(self, name))
            else:
                setattr(self, name, getattr(settings, name))
