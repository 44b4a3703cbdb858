"""Animations of paths over the ground, seen from above.

All paths grow together, step by step.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from PIL import Image

from companion.figures.style import draw_surroundings, legend_below
from ownrobot.plots import STYLE
from sidm.drives import CONTROL_STEP

DPI = 110  # few, since every frame has them
MARGIN = 0.7  # m of ground shown around the paths
HELD = 1.5  # s, duration of the last frame


def film(
    paths: Sequence[np.ndarray],
    styles: Sequence[dict],
    heights: np.ndarray,
    goal: np.ndarray,
) -> bytes:
    """An animated GIF of paths (K + 1, 2), m, in real time.

    A shorter path stays at its end; each has a style with a label. The ground has
    heights (H, W), m; a goal (2,) is marked.
    """
    longest = max(map(len, paths))
    paths = [path[np.arange(longest).clip(max=len(path) - 1)] for path in paths]
    points = np.concatenate([*paths, goal[None]])
    frames = []
    with plt.style.context(STYLE):
        figure, axes = plt.subplots(figsize=(4.8, 4.4), dpi=DPI, layout="constrained")
        draw_surroundings(axes, points, heights, MARGIN)
        lines = [axes.plot([], [], marker="", **style)[0] for style in styles]
        heads = [axes.plot([], [], "o", color=style["color"])[0] for style in styles]
        mark: dict[str, Any] = {"color": "black", "markersize": 10}
        marks = axes.plot(*goal, "x", label="the goal", **mark)
        legend_below(figure, [axes])
        # in the order of drawing: later ones cover earlier ones
        moving = [*lines, *heads, *marks, axes.set_title("0.0 s")]
        canvas = FigureCanvasAgg(figure)
        canvas.draw()  # lays everything out, including the title
        for artist in moving:
            artist.set_animated(True)
        canvas.draw()
        # what does not move is drawn once, which saves most of the time of each frame
        still = canvas.copy_from_bbox(figure.bbox)
        for step in range(longest):
            for path, line, head in zip(paths, lines, heads, strict=True):
                line.set_data(*path[: step + 1].T)
                head.set_data(*path[step : step + 1].T)
            axes.set_title(f"{CONTROL_STEP * step:.1f} s")
            canvas.restore_region(still)
            for artist in moving:
                axes.draw_artist(artist)
            frame = Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3])
            method, dither = Image.Quantize.FASTOCTREE, Image.Dither.NONE
            frames.append(frame.quantize(128, method, dither=dither))
        plt.close(figure)
    times = [round(1000 * CONTROL_STEP)] * (len(frames) - 1) + [round(1000 * HELD)]
    file, more = io.BytesIO(), {"append_images": frames[1:], "duration": times}
    frames[0].save(file, "gif", save_all=True, loop=0, **more)
    return file.getvalue()
