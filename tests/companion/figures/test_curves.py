"""Figures from made-up results whose answers are known."""

import matplotlib.pyplot as plt
import pytest
from matplotlib.lines import Line2D

from companion.engine.frame import frame_of
from companion.figures.curves import (
    changed_choices,
    efficiency_curves,
    figure3,
    learning_curves,
)
from companion.methods import ALL_RELEASED, FIGURE3, METHODS, RELEASED
from companion.studies import choices


def test_figure3_draws_the_means(figure3_frame):
    """Both systems have log axes; each line is the mean over seeds.

    More than colour tells methods apart.
    """
    figure = figure3(figure3_frame)
    left, right = figure.axes
    assert left.get_xscale() == left.get_yscale() == "log"
    assert "(min)" in left.get_xlabel()
    sidm, novice, finetuned = left.get_lines()
    assert sidm.get_ydata() == pytest.approx(1.01 * (4 * sidm.get_xdata()) ** -0.5)
    for look in (Line2D.get_linestyle, Line2D.get_marker):
        assert len({look(line) for line in (sidm, novice, finetuned)}) == 3
    assert len(right.get_lines()) == 3 and len(left.collections) == 3
    assert not plt.get_fignums()


def test_many_names_stand_below_the_plots(figure3_frame):
    """Each name stands once, and none covers a curve."""
    few = figure3(figure3_frame)
    many = figure3(figure3_frame, methods=[*FIGURE3, "mirrored", "averaged"])
    assert all(axes.get_legend() for axes in few.axes) and not few.legends
    assert not any(axes.get_legend() for axes in many.axes)
    assert [text.get_text() for text in many.legends[0].get_texts()] == [
        METHODS[name].label for name in FIGURE3
    ]
    assert many.get_figheight() > few.get_figheight()


def test_the_experts_model_alone_is_a_level(figure3_rows, laptop, make_row):
    trials = laptop.points("system1", ["expert_only"], [5])
    alone = [
        make_row(trial, loss) for trial, loss in zip(trials, (1, 2, 6), strict=True)
    ]
    left, right = figure3(frame_of([*figure3_rows, *alone])).axes
    assert left.get_lines()[-1].get_ydata() == pytest.approx([3, 3])
    assert len(left.get_lines()) == 4
    assert len(right.get_lines()) == 3


def test_changed_choices_stand_beside_ours(figure3_frame, power_law, laptop, make_row):
    """Each of the paper's methods stands twice, with hollow marks and other words."""
    trials = [
        t
        for system in ("system1", "system2")
        for t in choices.changed(laptop, system, RELEASED)[ALL_RELEASED]
    ]
    changed = frame_of(make_row(t, 2 * power_law(t)) for t in trials)
    for axes in changed_choices(figure3_frame, changed, "as released").axes:
        labels = [line.get_label() for line in axes.get_lines()]
        assert labels[2:] == [f"{label}, as released" for label in labels[:2]]
        hollow = [line.get_markerfacecolor() == "white" for line in axes.get_lines()]
        assert hollow == [False, False, True, True]
        book_line, authors_line = axes.get_lines()[0], axes.get_lines()[2]
        assert authors_line.get_ydata() == pytest.approx(2 * book_line.get_ydata())


def test_figures_of_nothing_say_so():
    """A figure is drawn even where nothing is stored."""
    for draw in (figure3, efficiency_curves, learning_curves):
        assert all(
            axes.texts[0].get_text() == "no trials stored"
            for axes in draw(frame_of([])).axes
        )


def test_the_efficiency_is_exact_where_both_curves_reach(figure3_frame):
    left = efficiency_curves(figure3_frame).axes[0]
    exact = next(line for line in left.get_lines() if line.get_label() == "ratio")
    assert exact.get_ydata() == pytest.approx(4)


def test_each_trial_has_its_learning_curve(figure3_frame):
    assert len(learning_curves(figure3_frame[:4]).axes[0].get_lines()) == 4
