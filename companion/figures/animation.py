"""Paths over the ground in motion, seen from above: they grow together, step by step."""

from __future__ import annotations

import io
from collections.abc import Iterable, Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from companion.figures.style import METHOD_STYLES, half_width, lay_ground, legend_below
from sidm.drives import CONTROL_STEP
from sidm.plots import STYLE
from sidm.systems import GRID_SPACING

MARGIN = 0.7  # m of ground shown around the paths
HELD = 1.5  # s that the last picture stays
LINES = ("-", "--", ":")  # by size of the novice data


def rollout_film(frame: pd.DataFrame, heights: np.ndarray, seed: int = 0) -> bytes:
    """An animated GIF in real time, seen from above.

    Args:
        frame: results of one system, the example's trials among them.
        heights: (H, W), m, the ground of the example, higher drawn darker.
        seed: whose trials predict.

    Raises:
        ValueError: no result has that seed.
    """
    shown = frame[frame.seed == seed].sort_values("novice_minutes", kind="stable")
    if not len(shown):
        raise ValueError(f"no trial of seed {seed} is stored")
    sizes = sorted(shown.novice_minutes.unique())
    paths = [
        np.array(path)
        for path in (shown.example_actual.iloc[0], *shown.example_predicted)
    ]
    looks = [{"color": "black", "label": "the robot", "linewidth": 2.5}]
    for one in shown.itertuples():
        style, line = (
            METHOD_STYLES[one.method],
            LINES[sizes.index(one.novice_minutes) % len(LINES)],
        )
        label = f"{style['label']}, {one.novice_minutes:g} min"
        looks.append({"color": style["color"], "label": label, "linestyle": line})
    return film(paths, looks, heights)


def film(
    paths: Sequence[np.ndarray],
    looks: Sequence[dict],
    heights: np.ndarray,
    goal: np.ndarray | None = None,
) -> bytes:
    """An animated GIF in real time.

    Args:
        paths: (K + 1, 2) each, m, at the control steps; one that is shorter stays where
            it ends.
        looks: of the paths' lines, with a label each.
        heights: (H, W), m, the ground, higher drawn darker.
        goal: (2,) m, to be marked.
    """
    longest = max(len(path) for path in paths)
    every = [
        np.vstack([path, np.repeat(path[-1:], longest - len(path), axis=0)])
        for path in paths
    ]
    return _gif(_frames(every, looks, heights, goal))


def _frames(
    paths: Sequence[np.ndarray],
    looks: Sequence[dict],
    heights: np.ndarray,
    goal: np.ndarray | None,
) -> list[Image.Image]:
    """A picture a step of paths (K + 1, 2) with their looks."""
    every = np.concatenate([*paths, *([] if goal is None else [goal[None]])])
    reach = float(np.ptp(every, axis=0).max()) / 2 + MARGIN
    (left, low), (right, high) = (every.max(0) + every.min(0)) / 2 + np.array(
        [[-reach], [reach]]
    )
    half = half_width(heights)
    columns, rows = (
        ((np.array(ends) + half) / GRID_SPACING).round().astype(int)
        for ends in ((left, right), (low, high))
    )
    seen = heights[max(rows[0], 0) : rows[1] + 1, max(columns[0], 0) : columns[1] + 1]
    frames = []
    with plt.style.context(STYLE):
        figure, axes = plt.subplots(figsize=(6.8, 4.6), layout="constrained")
        lay_ground(
            axes, heights, seen.min(), seen.min() + 1.5 * max(float(np.ptp(seen)), 0.05)
        )
        axes.set(xlim=(left, right), ylim=(low, high), xlabel="x (m)", ylabel="y (m)")
        lines = [axes.plot([], [], marker="", **look)[0] for look in looks]
        heads = [axes.plot([], [], "o", color=look["color"])[0] for look in looks]
        marks = (
            []
            if goal is None
            else axes.plot(*goal, "x", color="black", markersize=10, label="the goal")
        )
        legend_below(figure, [axes])
        # in the order in which they cover each other
        moving = [*lines, *heads, *marks, axes.set_title("0.0 s")]
        canvas, still = _behind(figure, moving)
        for step in range(len(paths[0])):
            for path, line, head in zip(paths, lines, heads, strict=True):
                line.set_data(*path[: step + 1].T)
                head.set_data(*path[step : step + 1].T)
            axes.set_title(f"{CONTROL_STEP * step:.1f} s")
            canvas.restore_region(still)
            for one in moving:
                axes.draw_artist(one)
            frames.append(Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3]))
        plt.close(figure)
    return frames


def _behind(figure: Figure, moving: Iterable[Artist]) -> tuple[FigureCanvasAgg, Any]:
    """A figure's canvas and what stands on it behind all that moves: drawn once, most of a picture's time is saved."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()  # lays everything out, the title among it
    for one in moving:
        one.set_animated(True)
    canvas.draw()
    return canvas, canvas.copy_from_bbox(figure.bbox)


def _gif(frames: list[Image.Image]) -> bytes:
    """Frames that follow each other as the control steps do, again and again."""
    small = [
        frame.quantize(128, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
        for frame in frames
    ]
    times = [round(1000 * CONTROL_STEP)] * (len(small) - 1) + [round(1000 * HELD)]
    file = io.BytesIO()
    small[0].save(
        file, "gif", save_all=True, append_images=small[1:], duration=times, loop=0
    )
    return file.getvalue()
