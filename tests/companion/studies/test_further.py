"""Steps E1 to E5: their trials, and what is read from E1's losses."""

import dataclasses

import numpy as np
import pandas as pd
import pytest

from companion import Results, Study
from companion.statistics.intervals import mean_ratio, p_value
from companion.studies.decisive import ablated, figure4, further, sensitivity
from companion.studies.decisive.arms import R_CAPS, arm, restricted
from companion.studies.decisive.verdicts import ALONE_SIZES, END, RELEASED
from ownrobot.comparison.statistics import Interval

SPACING = 100_000  # samples between two tests
EFFECT = {("p_expert", 0.9): 1.3}


@pytest.fixture
def study(tmp_path):
    return Study("study", tmp_path, tmp_path)


def stored(trial, make_row, loss, later=None):
    """A row whose test loss falls until a million samples, and then stays.

    With `later`, the loss falls to it after the cap of E1.
    """
    count = trial.training.max_samples // SPACING
    every = np.full(count, loss)
    every[:10] = np.linspace(2 * loss, loss, 10)
    if later is not None:
        every[further.ABLATION_CAPS[trial.system] // SPACING + 2 :] = later
    row = make_row(trial, loss if later is None else later)
    curves = {f"every_{name}_loss": tuple(every) for name in ("test", "validation")}
    curves["every_training_loss"] = tuple(0.5 * every)
    sizes = {"test_spacing": SPACING, "samples": count * SPACING}
    iterations = {"iterations": count * SPACING // 128}
    outcome = dataclasses.replace(row.outcome, **sizes, **iterations, **curves)
    return dataclasses.replace(row, outcome=outcome)


@pytest.fixture
def results(study, make_row):
    """Rows of E1 and R: one setting changes the loss, seeds differ a little.

    R's trainings of system 2 gain only after the cap.
    """
    store, rng = Results(study.results), np.random.default_rng(0)
    seeds = 1 + 0.1 * rng.standard_normal(3)
    for system in further.ABLATION_CAPS:
        later = {"later": 0.1} if system == "system2" else {}
        caps = restricted(R_CAPS, {"sidm": (5.0,)})
        for trial in arm(study, "R", system, caps, range(3)):
            store.put(stored(trial, make_row, 0.3 * seeds[trial.seed], **later))
        for setting, values in further.ABLATED.items():
            for value in values:
                if value == further.OF_R[setting][system]:
                    continue
                for seed in range(3):
                    trial = further.ablated(study, system, setting, value, seed)
                    noise = 1 + 0.002 * rng.standard_normal()
                    loss = 0.3 * seeds[seed] * EFFECT.get((setting, value), 1) * noise
                    store.put(stored(trial, make_row, loss))
    return ablated.results(study, store)


def test_one_setting_changes_at_a_time(study):
    made = further.ablations(study)
    assert len({trial.key for trial in made}) == 48
    for trial in made:
        training = trial.training
        off_r = [
            training.p_expert != further.OF_R["p_expert"][trial.system],
            training.prediction_iterations != 100,
            training.matching_iterations != 20 or not training.regularise,
        ]
        assert sum(off_r) == 1 and training.max_samples == training.patience
        assert trial.motion == "decisive" and trial.novice_minutes == 5


def test_a_setting_is_held_against_r_seed_by_seed_at_one_cap(results):
    """Settings without effect do not differ; R's gain beyond the cap does not count."""
    table = ablated.table(results)
    assert len(table) == 2 * 2 * 8 and (table.seeds == 3).all()
    for rule in (END, RELEASED):
        for row in table[table.rule == rule].itertuples():
            effect = EFFECT.get((row.setting, row.value), 1)
            assert row.ratio == pytest.approx(effect, rel=0.005)
            assert row.differs == (effect == 1.3), row
            assert row.low < row.ratio < row.high
    assert len(ablated.figure(table[table.rule == END], table).axes) == 6


def test_without_all_settings_nothing_differs(results):
    few = results[(results.setting == "") | (results.value == 0.9)]
    table = ablated.table(few)
    assert table.corrected.isna().all() and not table.differs.any()
    one = ablated.table(results[results.seed == 0])
    assert one.low.isna().all() and one.corrected.isna().all()
    assert len(ablated.table(results[:0])) == 0


def test_a_p_value_belongs_to_its_interval(rng):
    """An interval that ends at 1 has a p-value of 0.05."""
    assert p_value(Interval(2.0, 1.0, 4.0), 5) == pytest.approx(0.05)
    logs = 0.1 + 0.2 * rng.standard_normal(6)
    from scipy.stats import ttest_1samp

    ratio = mean_ratio(np.exp(logs), np.ones(6))
    assert p_value(ratio, 6) == pytest.approx(ttest_1samp(logs, 0).pvalue)
    assert np.isnan(p_value(Interval(2.0, np.nan, np.nan), 1))


def test_the_rivals_best_seed_lowers_the_ratio(study, make_row):
    """Losses 1 / sqrt(minutes); one of five seeds is better from 20 minutes on."""
    rows = []
    for trial in arm(study, "R", "system1", R_CAPS, range(5)):
        loss = trial.novice_minutes**-0.5 / (2 if trial.method == "sidm" else 1)
        if trial.seed == 3 and trial.novice_minutes >= 20:
            loss *= 0.8
        rows.append(stored(trial, make_row, loss))
    store = Results(study.results)
    for row in rows:
        store.put(row)
    frame = store.frame(curves=True).assign(recipe="R")
    plain = sensitivity.ratio_at_best(frame, "system1", ())
    best = sensitivity.ratio_at_best(frame, "system1", ALONE_SIZES[2:])
    assert best.value < plain.value == pytest.approx(4, rel=0.15)
    assert best.value == pytest.approx(2.9, rel=0.05)
    counted = sensitivity.ended_by_rule(frame)
    assert counted.trainings.eq(5).all() and counted.ended.isin([0, 5]).all()


def test_the_median_drive_is_shown():
    """Predicted paths end 3, 1 and 2 m off."""
    actual = np.zeros((3, 26, 13))
    predicted = actual.copy()
    predicted[:, -1, 0] = 3, 1, 2
    rows = pd.DataFrame(
        {"rollouts_predicted": [predicted.tolist()], "rollouts_actual": [actual]}
    )
    assert figure4.median_drive(rows) == 2
