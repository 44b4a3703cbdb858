"""Figures from made-up results whose answers are known."""

import io

import numpy as np
import pytest
from PIL import Image

from companion.engine.frame import frame_of
from companion.figures.animation import film
from companion.figures.curves import figure3


def test_figure3_draws_the_means_and_more_than_colour_tells_methods_apart(
    figure3_frame,
):
    left, right = figure3(figure3_frame).axes
    assert left.get_xscale() == left.get_yscale() == "log"
    sidm, *others = left.get_lines()
    assert sidm.get_ydata() == pytest.approx(1.01 * (4 * sidm.get_xdata()) ** -0.5)
    for look in ("get_linestyle", "get_marker"):
        assert len({getattr(line, look)() for line in (sidm, *others)}) == 3
    assert len(right.get_lines()) == 3


def test_the_experts_model_alone_is_a_level(figure3_rows, laptop, make_row):
    trials = laptop.points("system1", ["expert_only"], [5])
    alone = [make_row(t, loss) for t, loss in zip(trials, (1, 2, 6), strict=True)]
    left, right = figure3(frame_of([*figure3_rows, *alone])).axes
    assert left.get_lines()[-1].get_ydata() == pytest.approx([3, 3])
    assert (len(left.get_lines()), len(right.get_lines())) == (4, 3)


def test_a_figure_of_nothing_says_so():
    assert figure3(frame_of([])).axes[0].texts[0].get_text() == "no trials stored"


def test_the_film_shows_every_step_in_real_time():
    """The film has 26 different pictures of 0.1 s; the last one is held."""
    paths = [np.linspace([0, 0], [2.5, end], 26) for end in (0.0, 0.5)]
    styles = [{"color": "black", "label": "the robot"}, {"color": "red", "label": "a"}]
    heights, goal = np.zeros((300, 300)), np.ones(2)
    moving = Image.open(io.BytesIO(film(paths, styles, heights, goal)))
    times, frames = [], set()
    for number in range(moving.n_frames):
        moving.seek(number)
        times.append(moving.info["duration"])
        frames.add(moving.convert("RGB").tobytes())
    assert set(times[:-1]) == {100} and times[-1] > 1000 and len(frames) == 26
