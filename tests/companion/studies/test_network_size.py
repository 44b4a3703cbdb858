"""Networks of several sizes."""

from collections import Counter

import pytest

from companion import Study
from companion.engine.bundles import bundles
from companion.engine.frame import frame_of
from companion.studies.network_size import (
    LARGE,
    RATES,
    SIZE,
    SIZES,
    SLOW_SIZES,
    table,
    trials,
    tries,
)


@pytest.fixture
def study(tmp_path):
    return Study("study", tmp_path, tmp_path)


@pytest.fixture
def every(study):
    return trials(study, "system1")


def test_each_size_is_trained_once_at_each_rate(study, every):
    """The largest size and the smaller rate train the paper's two methods alone."""
    counts = Counter(
        tuple(getattr(trial.network, name) for name in SIZE) for trial in every
    )
    wanted = Counter(
        {size: seeds * (2 if size in LARGE else 3) for size, seeds in SIZES.items()}
    )
    wanted.update({size: 2 * seeds for size, seeds in SLOW_SIZES.items()})
    wanted.update({(32, 4, 1024): len(tries(study, "system1"))})
    assert counts == wanted
    assert {trial.novice_minutes for trial in every} == {5.0}
    assert len({t.key for t in every}) == len(every)


def test_rates_are_tried_on_motion_and_a_seed_that_no_figure_has(study, every):
    tried = tries(study, "system1")
    figures = [trial for trial in every if trial not in tried]
    assert [trial.training.learning_rate for trial in tried] == [
        rate for rate in RATES for _ in range(2)
    ]
    for kind in ("novice", "validation"):
        assert not {t.datasets[kind] for t in tried} & {
            t.datasets[kind] for t in figures
        }
    assert not {t.seed for t in tried} & {t.seed for t in figures}


def test_both_methods_share_a_bundle_at_the_smaller_rate(study, every):
    assert len(bundles(tries(study, "system1"))) == 1
    slow = [
        trial
        for trial in every
        if trial.training.precision == "tf32" and trial.network.hidden == 256
    ]
    assert len(slow) == 2 * SLOW_SIZES[32, 3, 256] and len(bundles(slow)) == 1


def more_saved(trial):
    return 1.5 if trial.training.precision == "tf32" else 1


def test_methods_stand_beside_training_without_sidm_of_the_same_size_and_rate(
    study, every, make_row
):
    """Made-up savings grow with the map, and by half again at the smaller rate."""
    rows = [
        make_row(
            t,
            1.0 if t.method == "novice_only" else 16 / t.network.pixels / more_saved(t),
        )
        for t in every
    ]
    lines = table(frame_of(rows)).set_index(
        ["method", "pixels", "hidden", "learning_rate"]
    )
    ratios = [lines.ratio["sidm", pixels, 256, 1e-3] for pixels in (16, 32, 64, 128)]
    assert ratios == pytest.approx([1, 0.5, 0.25, 0.125])
    assert [
        lines.ratio["sidm", 32, hidden, 3e-4] for hidden in (256, 1024)
    ] == pytest.approx([1 / 3, 1 / 3])
    assert lines.index.is_unique and lines.seeds.max() == 3
    assert len(lines) == 2 * 3 + 3 + 2  # fine-tuning too at three sizes
