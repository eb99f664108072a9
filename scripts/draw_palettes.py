"""Draw the palettes as people with normal color vision and with color blindness see them.

python -m scripts.draw_palettes [FILE]   # default: docs/images/palettes.png
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from wks_segment.blender.parts.palette import BLINDNESS, RECIPES, as_srgb, linear, sided_palette
from wks_segment.core.mesh.triangle_mesh import FloatArray

N_COLORS = 16
CELL, GAP, LEFT = 44, 26, 150
"""Size of a color, space above a palette, and space for names, in pixels."""
EYES = {"all cones": np.eye(3), **dict(zip(("without red", "without green", "without blue"), BLINDNESS, strict=True))}
TEXT = (40, 40, 40)


def main(path: Path) -> None:
    """Draw all palettes to a file."""
    height = len(RECIPES) * (GAP + len(EYES) * CELL)
    picture = Image.new("RGB", (LEFT + N_COLORS * CELL, height), "white")
    draw = ImageDraw.Draw(picture)
    for i, (name, recipe) in enumerate(RECIPES.items()):
        top = i * (GAP + len(EYES) * CELL)
        draw.text((4, top + 8), recipe.title, TEXT, font_size=14)
        middle, left, right = sided_palette(name)[:, :N_COLORS]
        for row, (vision, eyes) in enumerate(EYES.items()):
            y = top + GAP + row * CELL
            draw.text((16, y + CELL // 2 - 8), vision, TEXT, font_size=12)
            for column, (whole, light, dark) in enumerate(
                zip(*(_bytes(colors, eyes) for colors in (middle, left, right)), strict=True)
            ):
                x = LEFT + column * CELL
                draw.rectangle((x, y, x + CELL - 3, y + 2 * CELL // 3 - 2), tuple(whole))
                draw.rectangle((x, y + 2 * CELL // 3, x + CELL // 2 - 2, y + CELL - 3), tuple(light))
                draw.rectangle((x + CELL // 2, y + 2 * CELL // 3, x + CELL - 3, y + CELL - 3), tuple(dark))
    picture.save(path, optimize=True)


def _bytes(srgb: FloatArray, eyes: FloatArray) -> list[list[int]]:
    """(n, 3) sRGB colors in 8 bits, as seen by eyes that a (3, 3) matrix on linear RGB describes."""
    light = np.clip(linear(srgb) @ eyes.T, 0, 1)
    rounded: list[list[int]] = np.rint(255 * as_srgb(light)).astype(int).tolist()
    return rounded


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("docs/images/palettes.png"))
