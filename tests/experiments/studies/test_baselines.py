"""The method among its neighbours: means, paired differences, costs, and the figure."""

import numpy as np
import pytest

from sidm.experiments import METHODS, Study, load_preset
from sidm.experiments.methods import BASELINES, MIRRORED, VARIANTS
from sidm.experiments.studies.baselines import neighbours, neighbours_figure
from sidm.experiments.studies.throughput import Pace

STUDY = Study(load_preset("laptop"))


def loss(trial) -> float:
    """Each method has its own, to which a seed adds the same for all."""
    return 0.1 * (1 + list(METHODS).index(trial.method)) + 0.01 * trial.seed


@pytest.fixture
def rows(make_row):
    return [make_row(t, loss(t)) for t in STUDY.baselines("system1")]


def test_a_line_a_method_and_size(rows):
    """Differences are of the same seeds, so that what a seed adds to all is no noise."""
    found = {(one.method, one.minutes): one for one in neighbours(rows)}
    assert len(found) == (3 + len(BASELINES) - 1) * 2 + 1 + 1  # the expert alone once, and all data
    order = list(METHODS)
    for (method, _), one in found.items():
        assert one.loss == pytest.approx(0.1 * (1 + order.index(method)) + 0.01)
        assert (one.lowest, one.highest) == pytest.approx((one.loss - 0.01, one.loss + 0.01))
        for number, other in enumerate(("sidm", "novice_only")):
            if method == other or one.minutes == 120:
                assert one.differences[number] is None
            else:
                assert one.differences[number] == pytest.approx([0.1 * (order.index(method) - number)] * 3)


def test_only_common_seeds_are_compared(rows):
    some = [row for row in rows if row.trial.method != "pooled" or row.trial.seed == 2]
    (one,) = (n for n in neighbours(some) if (n.method, n.minutes) == ("pooled", 5))
    assert one.seeds == 1 and np.isnan(one.differences[0].low)
    assert one.differences[0].value == pytest.approx(0.1 * list(METHODS).index("pooled"))


def test_costs_are_means_over_trials(rows):
    (one,) = (n for n in neighbours(rows) if (n.method, n.minutes) == ("sidm", 5))
    mine = [row for row in rows if (row.trial.method, row.trial.novice_minutes) == ("sidm", 5)]
    assert one.samples == np.mean([row.outcome.samples + row.outcome.pretraining_samples for row in mine])
    assert one.compute_minutes == pytest.approx(np.mean([row.provenance.seconds for row in mine]) / 60)
    assert one.paced_minutes is None
    (paced,) = neighbours(mine, paces={"sidm": Pace(20.0, 10.0, 30.0)})
    assert paced.paced_minutes == pytest.approx(one.samples / 1000 * 20 / 60)


def test_rows_of_two_grids_are_refused(rows, make_row):
    other = STUDY.changed(patience=50_000).trial("system1", "sidm", 5)
    with pytest.raises(ValueError, match="two different trials"):
        neighbours([*rows, make_row(other)])


def test_the_figure_has_every_method(rows):
    sizes = STUDY.preset.baseline_minutes
    left, right = neighbours_figure(neighbours(rows), sizes).axes
    others = (*VARIANTS, *MIRRORED)
    labels = [method.label for name, method in METHODS.items() if name not in others]
    assert [text.get_text() for text in left.get_yticklabels()] == labels
    points = left.get_lines()[0]
    assert sorted(points.get_xdata()) == pytest.approx(sorted(0.11 + 0.1 * k for k in range(3 + len(BASELINES))))
    assert right.texts[0].get_text() == "no trials stored"
    aim = next(line for line in left.get_lines() if line.get_label() == "without SIDM, 120 min")
    assert len(set(aim.get_xdata())) == 1 and aim.get_linestyle() == ":"
    here = neighbours_figure(neighbours(rows), sizes, ["system2", "system1"]).axes[0]
    assert [text.get_text() for text in here.get_yticklabels()] == labels, "names stand on an empty panel, too"
