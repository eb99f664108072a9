"""Log–log plot of seconds against vertices as SVG, for `benchmarks.speed`."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

WIDTH, HEIGHT, LEFT, BOTTOM, TOP, RIGHT = 640, 420, 64, 48, 20, 92
COLORS = {"eigsh": "#d55e00", "lapy": "#cc79a7", "exact": "#0072b2", "fast": "#009e73"}


def plot(seconds: Mapping[str, Mapping[int, float]]) -> str:
    """Text of the SVG file; `seconds` maps each solver to its seconds by number of vertices."""
    sizes = [size for line in seconds.values() for size in line]
    times = [time for line in seconds.values() for time in line.values()]
    x_range = np.log10([min(sizes), max(sizes)])
    y_range = np.array([np.floor(np.log10(min(times))), np.ceil(np.log10(max(times)))])

    def place(size: float, time: float) -> tuple[float, float]:
        x = (np.log10(size) - x_range[0]) / max(np.ptp(x_range), 1e-9)
        y = (np.log10(time) - y_range[0]) / np.ptp(y_range)
        return LEFT + x * (WIDTH - LEFT - RIGHT), HEIGHT - BOTTOM - y * (HEIGHT - BOTTOM - TOP)

    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif" '
        f'font-size="13"><rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>'
    ]
    for power in range(int(y_range[0]), int(y_range[1]) + 1):
        y = place(min(sizes), 10.0**power)[1]
        parts.append(f'<path d="M{LEFT} {y:.1f}H{WIDTH - RIGHT}" stroke="#ddd"/>')
        parts.append(f'<text x="{LEFT - 8}" y="{y + 4:.1f}" text-anchor="end">{10.0**power:g} s</text>')
    for size in sorted(set(sizes)):
        x, y = place(size, 10.0 ** y_range[0])
        parts.append(f'<path d="M{x:.1f} {TOP}V{y:.1f}" stroke="#eee"/>')
        parts.append(f'<text x="{x:.1f}" y="{y + 18:.1f}" text-anchor="middle">{size:,}</text>')
    parts.append(f'<text x="{(LEFT + WIDTH - RIGHT) / 2}" y="{HEIGHT - 10}" text-anchor="middle">vertices</text>')
    for name, line in seconds.items():
        points = [place(size, time) for size, time in sorted(line.items())]
        path = "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in points)
        color = COLORS.get(name, "#555")
        parts.append(f'<path d="{path}" fill="none" stroke="{color}" stroke-width="2"/>')
        parts += [f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3.5" fill="{color}"/>' for x, y in points]
        x, y = points[-1]
        parts.append(f'<text x="{x + 8:.1f}" y="{y + 4:.1f}" fill="{color}">{name}</text>')
    return "\n".join(parts) + "\n</svg>\n"
