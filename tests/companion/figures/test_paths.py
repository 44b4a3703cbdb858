"""Figure 4: its lines, its example in numbers and in motion."""

import io

import numpy as np
import pytest
from PIL import Image

from companion.engine.frame import frame_of
from companion.figures.animation import rollout_film
from companion.figures.paths import example, figure4


def test_figure4_draws_means_and_paths(figure3_frame, laptop):
    """Six lines start at zero; six predicted paths stand beside the actual one."""
    rows = figure3_frame[
        figure3_frame.index.isin([trial.key for trial in laptop.figure4()])
    ]
    left, right = figure4(rows).axes
    assert len(left.get_lines()) == 6 and len(right.get_lines()) == 7
    assert all(
        line.get_ydata()[0] == 0 and line.get_xdata()[-1] == pytest.approx(2.5)
        for line in left.get_lines()
    )
    assert (
        len({(line.get_color(), line.get_linestyle()) for line in left.get_lines()})
        == 6
    )
    assert figure4(frame_of([])).axes[0].texts[0].get_text() == "no trials stored"


def test_an_example_is_held_against_all(laptop, make_row):
    frame = frame_of(
        make_row(trial, 1.0) for trial in laptop.points("system1", ["sidm"], (5.0,))
    )
    actual = tuple((0.1 * step, 0.0) for step in range(26))
    frame["example_actual"] = [actual] * len(frame)
    frame["example_predicted"] = [
        (*actual[:-1], (2.5, 0.5 * (1 + seed))) for seed in frame.seed
    ]
    mean = np.mean([errors[-1] for errors in frame.position_error])
    assert example(frame, seed=1) == pytest.approx((2.5, 1.0, 1.0, mean))
    assert example(frame, seed=9) is None


def test_the_film_shows_every_step_in_real_time(figure3_frame):
    """The film has 26 different pictures of 0.1 s; the last one is held."""
    film = Image.open(io.BytesIO(rollout_film(figure3_frame, np.zeros((300, 300)))))
    assert film.n_frames == 26
    times, frames = [], []
    for number in range(film.n_frames):
        film.seek(number)
        times.append(film.info["duration"])
        frames.append(film.convert("RGB").tobytes())
    assert set(times[:-1]) == {100} and times[-1] > 1000 and len(set(frames)) == 26
    with pytest.raises(ValueError, match="no trial of seed 9"):
        rollout_film(figure3_frame, np.zeros((300, 300)), seed=9)
