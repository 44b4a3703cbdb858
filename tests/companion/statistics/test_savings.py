"""Ratios at each size, on curves whose ratio is known."""

import numpy as np
import pytest

from companion.engine.frame import frame_of
from companion.statistics.savings import ratio_texts, savings

#: number of times that a method's data count
RATIO = {"sidm": 4.0, "novice_only": 1.0, "pretrain_finetune": 8.0}
NOISE = {("sidm", 1): 1.05, ("novice_only", 2): 1.05}  # factors of seeds, not paired
MINUTES = (1, 2, 5, 20, 60, 120)


@pytest.fixture
def frame(make_row, laptop):
    def loss(trial):
        data = RATIO[trial.method] * trial.novice_minutes
        return NOISE.get((trial.method, trial.seed), 1) * data**-0.5

    return frame_of(make_row(t, loss(t)) for t in laptop.figure3("system1"))


def test_a_known_ratio_comes_out_at_each_size(frame):
    rows = savings(frame)
    assert rows.novice_minutes.tolist() == [*MINUTES]
    assert set(rows.seeds) == {3} and set(rows.system) == {"system1"}
    assert rows.loss.tolist() == pytest.approx(
        (1 + 0.05 / 3) * (4 * rows.novice_minutes) ** -0.5
    )
    # 240 min would be needed, more than there are
    assert rows.bound.tolist() == ["=", "=", "=", "=", ">=", ">="]
    assert rows.ratio.tolist() == pytest.approx([4, 4, 4, 4, 2, 1], rel=0.05)
    assert rows.low[:4].between(2.5, 3.9).all()
    assert rows.high[:4].between(4.1, 6.5).all()
    assert not np.isfinite(rows.low[4])  # a bound has no interval
    assert ratio_texts(rows)[4] == f"at least {rows.ratio[4]:.1f}"
    assert ratio_texts(rows)[0].startswith("4.")
    finetuned = savings(frame, ["pretrain_finetune"])
    assert finetuned.ratio[0] == pytest.approx(8, rel=0.1)
    assert not len(savings(frame[:0]))


def test_the_comparison_may_have_other_sizes(frame):
    """A method of small sizes is compared with the whole curve of another."""
    small = frame[(frame.method != "sidm") | (frame.novice_minutes < 10)]
    rows, whole = savings(small), savings(frame)
    assert rows.novice_minutes.tolist() == [1, 2, 5]
    assert rows.ratio.tolist() == pytest.approx(whole.ratio[:3].tolist())
    few = small[(small.method != "novice_only") | (small.seed != 2)]
    # the ratio is of seeds 0 and 1
    assert savings(few).ratio[0] == pytest.approx(4 * 1.025**-2, rel=0.01)


def test_a_level_curve_saves_nothing_at_its_right_end(make_row, laptop):
    """20 minutes that do no better than 5 are compared with the other's 20."""
    sidm = dict(zip(MINUTES, (0.5, 0.4, 0.3, 0.3, 0.2, 0.19), strict=True))
    novice = dict(zip(MINUTES, (0.6, 0.5, 0.4, 0.3, 0.25, 0.2), strict=True))
    losses = {"sidm": sidm, "novice_only": novice, "pretrain_finetune": sidm}
    trials = laptop.figure3("system1")
    rows = savings(
        frame_of(make_row(t, losses[t.method][t.novice_minutes]) for t in trials)
    )
    assert rows.ratio[2] == pytest.approx(4) and rows.ratio[3] == pytest.approx(1)
