"""Methods side by side: means, paired ratios, costs, and the figure."""

import numpy as np
import pytest

from companion import METHODS, Study, load_preset
from companion.engine.frame import frame_of
from companion.methods import BASELINES, CORES, MIRRORED, RIVAL, VARIANTS
from companion.studies import baselines
from companion.studies.throughput import Pace

STUDY = Study(load_preset("laptop"))


def loss(trial) -> float:
    """Made-up loss: each method has its own, and a seed multiplies all losses."""
    return 0.1 * (1 + list(METHODS).index(trial.method)) * (1 + 0.1 * trial.seed)


@pytest.fixture
def rows(make_row):
    return [make_row(t, loss(t)) for t in baselines.trials(STUDY, "system1")]


def line(table, method, minutes):
    (found,) = table[
        (table.method == method) & (table.novice_minutes == minutes)
    ].itertuples()
    return found


def test_a_line_a_method_and_size(rows):
    """Ratios are of the same seeds, so that a seed's common factor adds no noise."""
    table = baselines.table(frame_of(rows))
    # the expert alone once, and all data
    assert len(table) == (3 + len(BASELINES) - 1) * 2 + 1 + 1
    order = list(METHODS)
    for row in table.itertuples():
        number = 1 + order.index(row.method)
        assert row.loss == pytest.approx(0.11 * number)
        assert (row.lowest, row.highest) == pytest.approx((0.1 * number, 0.12 * number))
        for place, other in enumerate(("sidm", "novice_only")):
            interval = [
                getattr(row, f"to_{other}{end}") for end in ("", "_low", "_high")
            ]
            if row.method == other or row.novice_minutes == 120:
                assert np.isnan(interval).all()
            else:
                assert interval == pytest.approx([number / (1 + place)] * 3)
    for _, some in table.groupby("novice_minutes"):
        assert list(some.method) == sorted(some.method, key=order.index)


def test_only_common_seeds_are_compared(rows):
    fewer = [row for row in rows if row.trial.method != "pooled" or row.trial.seed == 2]
    pooled = line(baselines.table(frame_of(fewer)), "pooled", 5)
    assert pooled.seeds == 1 and np.isnan(pooled.to_sidm_low)
    assert pooled.to_sidm == pytest.approx(1 + list(METHODS).index("pooled"))


def test_costs_are_means_over_trials(rows):
    mine = [
        row
        for row in rows
        if (row.trial.method, row.trial.novice_minutes) == ("sidm", 5)
    ]
    one = line(baselines.table(frame_of(rows)), "sidm", 5)
    assert one.samples == np.mean(
        [row.outcome.samples + row.outcome.pretraining_samples for row in mine]
    )
    assert one.minutes == pytest.approx(
        np.mean([row.provenance.seconds for row in mine]) / 60
    )
    paced = line(
        baselines.table(frame_of(mine), {"sidm": Pace(20.0, 10.0, 30.0)}), "sidm", 5
    )
    assert paced.minutes == pytest.approx(one.samples / 1000 * 20 / 60)


def test_rows_of_two_grids_are_refused(rows, make_row):
    other = STUDY.changed(patience=50_000).trial("system1", "sidm", 5)
    with pytest.raises(ValueError, match="two rows of the same"):
        baselines.table(frame_of([*rows, make_row(other)]))


def test_the_figure_has_every_method(rows):
    sizes, table = STUDY.preset.baseline_minutes, baselines.table(frame_of(rows))
    left, right = baselines.figure(table, sizes).axes
    others = (*VARIANTS, *MIRRORED, *CORES, RIVAL)
    labels = [method.label for name, method in METHODS.items() if name not in others]
    assert [text.get_text() for text in left.get_yticklabels()] == labels
    points = left.get_lines()[0]
    assert sorted(points.get_xdata()) == pytest.approx(
        [0.11 * (1 + k) for k in range(3 + len(BASELINES))]
    )
    assert right.texts[0].get_text() == "no trials stored"
    aim = next(
        line for line in left.get_lines() if line.get_label() == "without SIDM, 120 min"
    )
    assert len(set(aim.get_xdata())) == 1 and aim.get_linestyle() == ":"
    here = baselines.figure(table, sizes, ["system2", "system1"]).axes[0]
    assert [text.get_text() for text in here.get_yticklabels()] == labels, (
        "names stand on an empty panel, too"
    )
