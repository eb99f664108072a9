"""Icons of one color each, for menus that name segments."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import bpy.utils.previews
import numpy as np

COLOR_ICONS = "wks_segment_color_icons"
"""Name of the icons at the type of Blender's window manager."""
ICON_PIXELS = 32
"""Width and height of an icon: that of Blender's own on a screen of high resolution."""
BORDER_PIXELS = 3
"""Transparent pixels around the color, as Blender's own icons have them."""


class ColorIcons:
    """Makes icons when they are needed first, and keeps them: a color has one icon."""

    def __init__(self) -> None:
        self._previews = bpy.utils.previews.new()

    def icon(self, color: Iterable[float]) -> int:
        """Number of the icon of an sRGB color, for `icon_value`."""
        return int(self.preview(color).icon_id)

    def preview(self, color: Iterable[float]) -> Any:
        """The icon of an sRGB color."""
        red, green, blue = (round(255 * channel) for channel in color)
        name = f"{red:02x}{green:02x}{blue:02x}"
        if name not in self._previews:
            pixels = np.zeros((ICON_PIXELS, ICON_PIXELS, 4), dtype=np.float32)
            inside = slice(BORDER_PIXELS, -BORDER_PIXELS)
            pixels[inside, inside] = (red / 255, green / 255, blue / 255, 1.0)
            icon = self._previews.new(name)
            icon.icon_size = (ICON_PIXELS, ICON_PIXELS)
            icon.icon_pixels_float[:] = pixels.ravel()
        return self._previews[name]

    def close(self) -> None:
        """Remove the icons, before the extension is disabled."""
        bpy.utils.previews.remove(self._previews)


def color_icons_of(context: bpy.types.Context) -> ColorIcons:
    """The color icons of this Blender."""
    icons: ColorIcons = getattr(context.window_manager, COLOR_ICONS)
    return icons
