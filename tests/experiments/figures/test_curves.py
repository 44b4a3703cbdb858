"""Figures, tables and claims from made-up rows whose answers are known."""

import io
from html import escape

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.lines import Line2D
from PIL import Image

from sidm.experiments import Results, Study
from sidm.experiments.figures.animation import rollout_film
from sidm.experiments.figures.curves import changed_choices, efficiency_curves, figure3, learning_curves
from sidm.experiments.figures.paths import figure4
from sidm.experiments.methods import ALL_RELEASED, FIGURE3, METHODS, RELEASED, change
from sidm.experiments.statistics.claims import (
    CONTRARY,
    DIRECTION,
    NO_VERDICT,
    NOT_SEEN,
    REPRODUCED,
    UNCLEAR,
    by,
    difference,
    figure3_claims,
    figure4_claims,
    html,
    markdown,
    meeting,
    verdict,
)
from sidm.experiments.statistics.intervals import Interval
from sidm.experiments.statistics.tables import gather, overview, provenance_line
from sidm.experiments.studies import ablations, choices


def power_law(trial) -> float:
    """Without SIDM the loss of 4 times less data, in every seed a little different."""
    data = trial.novice_minutes * (4 if trial.method == "sidm" else 1)
    return (1 + 0.01 * trial.seed) * data**-0.5


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """The laptop's study without data."""
    nowhere = tmp_path_factory.mktemp("empty")
    return Study("laptop", nowhere, nowhere)


@pytest.fixture(scope="module")
def rows(study, make_row):
    """All of Figure 3, by a power law."""
    return [make_row(t, power_law(t)) for system in ("system1", "system2") for t in study.figure3(system)]


def test_gather_keeps_what_is_complete(rows, make_row):
    """Sizes that a method lacks go first, then seeds that lack one of the others."""
    found = gather(rows, "system1")
    assert found.minutes.tolist() == [1, 2, 5, 20, 60, 120] and found.values.shape == (3, 2, 6)
    assert found.values[0, 0] == pytest.approx((4 * found.minutes) ** -0.5)
    part = [r for r in rows if (r.trial.method, r.trial.novice_minutes) != ("sidm", 60)]
    part = [r for r in part if (r.trial.seed, r.trial.novice_minutes) != (2, 5)]
    assert gather(part, "system1").minutes.tolist() == [1, 2, 5, 20, 120]
    assert gather(part, "system1").values.shape == (2, 2, 5)
    assert gather([], "system1").values.size == 0
    other = rows[0].trial.replace(training=change(rows[0].trial.training, p_expert=0.1))
    with pytest.raises(ValueError, match="two different trials of system1 sidm 1 min seed 0"):
        gather([*rows, make_row(other)], "system1")


def test_figure3_draws_the_means(rows):
    """Both systems on log axes; each line is the mean over seeds; methods are told apart by more than colour."""
    figure = figure3(rows)
    left, right = figure.axes
    assert left.get_xscale() == left.get_yscale() == "log" and "(min)" in left.get_xlabel()
    sidm, novice, finetuned = left.get_lines()
    assert sidm.get_ydata() == pytest.approx(1.01 * (4 * sidm.get_xdata()) ** -0.5)
    for look in (Line2D.get_linestyle, Line2D.get_marker):
        assert len({look(line) for line in (sidm, novice, finetuned)}) == 3
    assert len(right.get_lines()) == 3 and len(left.collections) == 3
    assert not plt.get_fignums()


def test_many_names_stand_below_the_plots(rows):
    """Each once, and none over a curve."""
    few, many = figure3(rows), figure3(rows, methods=[*FIGURE3, "mirrored", "averaged"])
    assert all(axes.get_legend() for axes in few.axes) and not few.legends
    assert not any(axes.get_legend() for axes in many.axes)
    assert [text.get_text() for text in many.legends[0].get_texts()] == [METHODS[name].label for name in FIGURE3]
    assert many.get_figheight() > few.get_figheight()


def test_the_experts_model_alone_is_a_level(rows, study, make_row):
    trials = study.points("system1", ["expert_only"], [5])
    alone = [make_row(trial, loss) for trial, loss in zip(trials, (1, 2, 6), strict=True)]
    left, right = figure3([*rows, *alone]).axes
    assert left.get_lines()[-1].get_ydata() == pytest.approx([3, 3]) and len(left.get_lines()) == 4
    assert len(right.get_lines()) == 3


def test_changed_choices_stand_beside_ours(rows, study, make_row):
    """Each of the paper's methods twice, told apart by hollow marks and by words."""
    trials = [t for system in ("system1", "system2") for t in choices.changed(study, system, RELEASED)[ALL_RELEASED]]
    changed = [make_row(t, 2 * power_law(t)) for t in trials]
    for axes in changed_choices(rows, changed, "as released").axes:
        labels = [line.get_label() for line in axes.get_lines()]
        assert labels[2:] == [f"{label}, as released" for label in labels[:2]]
        hollow = [line.get_markerfacecolor() == "white" for line in axes.get_lines()]
        assert hollow == [False, False, True, True]
        ours, theirs = axes.get_lines()[0], axes.get_lines()[2]
        assert theirs.get_ydata() == pytest.approx(2 * ours.get_ydata())


def test_empty_figures_say_so():
    """Where nothing is stored a figure is drawn all the same."""
    for figure in (figure3([]), figure4([]), efficiency_curves([]), learning_curves([])):
        assert all(axes.texts[0].get_text() == "no trials stored" for axes in figure.axes)


def test_figure4_draws_means_and_paths(rows, study):
    """Six lines of deviation from zero at the start, six predicted paths and the actual one."""
    keys = {t.key for t in study.figure4()}
    mine = [r for r in rows if r.trial.key in keys]
    left, right = figure4(mine).axes
    assert len(left.get_lines()) == 6 and len(right.get_lines()) == 7
    assert all(line.get_ydata()[0] == 0 and line.get_xdata()[-1] == pytest.approx(2.5) for line in left.get_lines())
    assert len({(line.get_color(), line.get_linestyle()) for line in left.get_lines()}) == 6


def test_other_figures(rows):
    """Efficiency is 4 where both curves reach."""
    left = efficiency_curves(rows).axes[0]
    exact = next(line for line in left.get_lines() if line.get_label() == "ratio")
    assert exact.get_ydata() == pytest.approx(4)
    assert learning_curves(rows[:4]).axes[0].get_lines()


def test_differences_in_words():
    """The interval is turned as its word is."""
    assert by(Interval(0.2, -0.1, 0.5), "less", "more", " m") == "less by 0.2 m [-0.1, 0.5]"
    assert by(Interval(-0.2, -0.5, 0.1), "less", "more") == "more by 0.2 [-0.1, 0.5]"


def test_verdicts_follow_the_rule():
    """The rule of the page on claims, whatever comes out."""
    assert verdict(Interval(18, 12, 25), 1, 20) == REPRODUCED and verdict(Interval(5, 0.1, 99), 1, 20) == NOT_SEEN
    assert verdict(Interval(8, 4, 12), 1, 20) == DIRECTION
    assert verdict(Interval(1.2, 0.8, 3), 1, 20) == NOT_SEEN
    assert verdict(Interval(0.5, 0.3, 0.8), 1, 20) == CONTRARY
    assert verdict(Interval(0.2, 0.1, 0.3), 0) == DIRECTION
    assert verdict(Interval(np.nan, np.nan, np.nan), 1, 20) == NO_VERDICT


def test_claims_table(rows):
    """On the power law SIDM saves 4 x; the paper's 20 x is not in the interval, nor is its 5 x."""
    first, second, third, fourth, *pretrained = figure3_claims(rows)
    deviations = figure4_claims(rows)
    assert first.interval.value == pytest.approx(4) and first.verdict == DIRECTION
    assert first.ours == "at best 4 x [4, 4]"
    assert second.verdict == DIRECTION and third.verdict == fourth.verdict == UNCLEAR
    assert third.ours == "not by 120 min"
    assert [c.verdict for c in deviations] == [DIRECTION, DIRECTION]
    losses = gather(rows, "system1")
    expected = losses.minutes**-0.5 * (1 - 0.5) * 1.01
    assert [difference(losses, k).value for k in range(6)] == pytest.approx(expected)
    assert [c.verdict for c in pretrained] == [DIRECTION, DIRECTION]
    text = markdown([*figure3_claims(rows), *deviations])
    assert text.count("\n") == 10 and "nan" not in text


def test_claims_without_enough(rows):
    """Nothing run, or one seed: said, and no verdict."""
    nothing = [*figure3_claims([]), *figure4_claims([])]
    assert {c.ours for c in nothing} == {"not run"} and {c.verdict for c in nothing} == {NO_VERDICT, UNCLEAR}
    single = figure3_claims([r for r in rows if r.trial.seed == 0])
    assert single[0].ours == "at best 4 x (one seed)" and single[0].verdict == NO_VERDICT


def test_curves_that_meet(study, make_row):
    """From the size on at which they are the same; where they cross, that is said."""

    def curves(late):
        rows = [make_row(t, power_law(t) if t.novice_minutes < 20 else late(t)) for t in study.figure3("system1")]
        return meeting(gather(rows, "system1"))

    assert curves(lambda t: 0.1) == "from 20 min"
    assert curves(lambda t: 0.1 + 0.1 * (t.method == "sidm") * (t.novice_minutes > 20)) == (
        "crossed: worse with SIDM from 60 min"
    )
    assert curves(power_law) == "not by 120 min"
    worse = [make_row(t, 1.0 + (t.method == "sidm")) for t in study.figure3("system1")]
    assert meeting(gather(worse, "system1")) == "worse with SIDM at every size"


def test_words_about_rows(rows, study, tmp_path):
    """The line of provenance, the costs and the overview count what is there."""
    line = provenance_line(rows, "sidm run")
    assert line.startswith("108 trials; ") and "older code" not in line
    assert line.endswith("; again: `sidm run`.")
    assert provenance_line([], "cmd") == "No trials stored; `cmd` runs them."
    store = Results(tmp_path)
    store.put(rows[0])
    lines = overview(store, ablations.p_expert(study, "system1"), study)
    assert any("(p_expert=0.25)" in text for text in lines) and all("of 3" in text for text in lines)
    assert "stored 1 of 3  stale 0  loss 0.5" in overview(store, study.figure3("system1"), study)[0]


def test_the_claims_in_html_are_those_of_the_table(rows):
    claims = figure3_claims(rows)
    words = [line.split(" | ") for line in markdown(claims).replace("| ", "", 1).splitlines()]
    page = html(claims)
    assert page.count("<tr>") == 1 + len(claims) == len(words) - 1
    assert all(escape(claim.ours) in page and escape(claim.claim) in page for claim in claims)


def test_the_film_shows_every_step_in_real_time(rows):
    """26 pictures of 0.1 s, the last one held; they differ."""
    film = Image.open(io.BytesIO(rollout_film(rows, np.zeros((300, 300)))))
    assert film.n_frames == 26
    times, frames = [], []
    for number in range(film.n_frames):
        film.seek(number)
        times.append(film.info["duration"])
        frames.append(film.convert("RGB").tobytes())
    assert set(times[:-1]) == {100} and times[-1] > 1000 and len(set(frames)) == 26
    with pytest.raises(ValueError, match="no trial of seed 9"):
        rollout_film(rows, np.zeros((300, 300)), seed=9)
