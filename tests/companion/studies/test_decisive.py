"""The decisive experiment: its table, and both verdicts on made-up results."""

import base64
import dataclasses
import json

import numpy as np
import pandas as pd
import pytest
from scipy.stats import ttest_1samp

from companion import Results, Study, grid
from companion.engine.frame import frame_of
from companion.statistics.claims import (
    CONTRARY,
    DIRECTION,
    NO_VERDICT,
    NOT_SEEN,
    REPRODUCED,
    verdict,
)
from companion.statistics.intervals import mean_ratio, p_values
from companion.statistics.savings import data_ratio
from companion.statistics.stopping_rules import RULES
from companion.studies.decisive import (
    ablated,
    arms,
    design,
    figure4,
    length_curves,
    search,
    stopping_charts,
    stopping_point,
    verdicts,
)
from companion.studies.decisive.arms import (
    FINETUNING,
    R_CAPS,
    RECIPES,
    SEEDS,
    arm,
    restricted,
)
from companion.studies.decisive.design import STEPS
from companion.studies.decisive.verdicts import ALONE_SIZES, END
from ownrobot.comparison.statistics import Interval
from sidm.config import ConfigError
from tests.companion.conftest import RESULTS

SPACING = 12_800  # samples between two tests
EARLY = 40  # tests until the released rule has seen the first minimum


@pytest.fixture
def study():
    return Study("study")


def with_curve(row, loss, spacing):
    """A row whose test and validation loss follow a curve."""
    samples = len(loss) * spacing
    every = {f"every_{name}_loss": tuple(loss) for name in ("test", "validation")}
    outcome = dataclasses.replace(
        row.outcome,
        samples=samples,
        iterations=samples // (row.trial.training.batch * 64),
        test_spacing=spacing,
        every_training_loss=tuple(0.5 * loss),
        **every,
    )
    return dataclasses.replace(row, outcome=outcome)


@pytest.fixture
def chosen(monkeypatch):
    """A search whose best draws are 2 and 3."""
    for name in ("sidm", "novice_only", FINETUNING):
        monkeypatch.setitem(search.BEST, name, (2, 3))
    for system in ("system1", "system2"):
        monkeypatch.setitem(search.CHOSEN, system, dict.fromkeys(search.DRAWS, 2))


@pytest.fixture
def make_results(study, chosen, make_row):
    """Function that makes rows of both recipes: `make_results(early, late)`.

    `early` and `late` give the loss of a trial. The test loss falls to the early
    minimum, stays above it for longer than the released rule waits, and falls again.
    """

    def row(trial, early, late):
        count = trial.training.max_samples // SPACING
        loss = np.full(count, 1.5 * early)
        loss[:EARLY] = np.linspace(3 * early, early, EARLY)
        loss[-20:] = late  # long enough for the smoothed loss to fall
        return with_curve(make_row(trial, late), loss, SPACING)

    def make(early, late, seeds=SEEDS):
        parts = []
        for recipe, caps in RECIPES.items():
            for system in ("system1", "system2"):
                trials = arm(study, recipe, system, caps, seeds)
                rows = [row(t, early(t, recipe), late(t, recipe)) for t in trials]
                parts.append(frame_of(rows).assign(recipe=recipe))
        return pd.concat(parts)

    return make


def power(worth, level=1.0):
    """Losses with which a method's data count several times.

    Seeds differ in a part that all methods share and in a part of their own.
    """

    def loss(trial, recipe):
        key = [trial.seed, round(100 * trial.novice_minutes), len(trial.method)]
        own = np.random.default_rng(key).standard_normal()
        data = worth.get((recipe, trial.method), 1.0) * trial.novice_minutes
        return level * (1 + 0.02 * np.cos(trial.seed) + 0.005 * own) * data**-0.25

    return loss


def line(table, verdict, system, method="sidm", minutes=5.0):
    (found,) = table[
        (table.verdict == verdict)
        & (table.system == system)
        & (table.method == method)
        & (table.minutes == minutes)
    ].itertuples()
    return found


def test_every_step_has_as_many_trainings_as_it_says(study, chosen):
    for step in STEPS:
        keys = [trial.key for trial in step.trials(study) if not trial.solved]
        assert len(keys) == len(set(keys)) == step.trainings, step.name


def test_nothing_stops_a_training_and_both_recipes_have_the_same_motion(study, chosen):
    trials = [
        trial
        for recipe, caps in RECIPES.items()
        for trial in arm(study, recipe, "system1", caps, SEEDS)
    ]
    assert {trial.motion for trial in trials} == {"decisive"}
    assert all(t.training.patience == t.training.max_samples for t in trials)
    assert len({tuple(trial.datasets.values()) for trial in trials}) == 1


def test_draws_are_the_same_everywhere():
    assert search.draw("sidm", 7) == {
        "initialisation": "pytorch",
        "batch": 4,
        "discriminator_batch": 4,
        "matching_batch": 4,
        "learning_rate": 0.000486,
        "test_interval": 50,
        "weight_decay": 1.16e-06,
        "p_expert_system1": 0.79,
        "p_expert_system2": 0.79,
        "matching_iterations": 94,
    }
    tuned = dict(
        (name, value) for _, name, value in search.draw(FINETUNING, 9)["tuned"]
    )
    expected = (0.000237, 0.0126, 2)
    assert (tuned["learning_rate"], tuned["weight_decay"], tuned["batch"]) == expected


def test_scores_are_by_least_squares_on_the_same_split(study, make_row):
    good, rows = {("sidm", 1004): 0.5, ("novice_only", 1003): 0.7}, []
    for t in search.first_search(study):
        score = 1.0 if t.solved else good.get((t.method, t.seed), 0.9)
        rows.append(make_row(t, score * (1 + t.seed % 7)))  # some splits are harder
    scores = search.scores(frame_of(rows)).sort_values("score")
    best = scores.groupby("method")[["number", "score"]].first()
    assert best.score.to_dict() == pytest.approx(
        {"sidm": 0.5, "novice_only": 0.7, FINETUNING: 0.9}
    )
    assert best.number["sidm"] == 4 and best.number["novice_only"] == 3


def test_the_settings_of_system_2_have_the_best_stored_scores(study):
    """As the protocol's list of changes tells: 0.95, then 1.01; 1.11, then 1.17."""
    frame = Results(RESULTS).frame(search.second_search(study))
    scores = search.scores(frame).sort_values("score").groupby("method")
    best = scores.number.first().to_dict()
    assert best == search.CHOSEN["system2"]
    two = {method: group.score[:2].round(2).tolist() for method, group in scores}
    assert two == {"sidm": [0.95, 1.01], "novice_only": [1.11, 1.17]}


def test_a_saving_that_a_longer_training_takes_away(make_results):
    """Under the released rule an SIDM saves what the paper says, at the end nothing.

    R and T agree.
    """
    worth = {("R", "sidm"): 20.0, ("T", "sidm"): 20.0, ("T", FINETUNING): 20.0}
    table = verdicts.verdicts(
        make_results(power(worth), power({("T", FINETUNING): 10.0}, level=0.5))
    )
    early, late = line(table, "R1", "system1"), line(table, "R2", "system1")
    assert early.says == REPRODUCED
    assert early.low < 20 < early.high
    assert early.value == pytest.approx(20, rel=0.2)
    assert line(table, "R1", "system2").says == DIRECTION  # 5 is not in it
    assert late.says == NOT_SEEN and late.low < 1 < late.high
    assert line(table, "T1", "system1").says == REPRODUCED
    assert line(table, "T2", "system1").says == NOT_SEEN
    tuning = line(table, "T2", "system2", FINETUNING)
    assert tuning.says == NO_VERDICT and tuning.value == pytest.approx(10, rel=0.2)
    small = table[table.verdict == "S"]
    assert set(small[small.recipe == "R"].says) == {DIRECTION}
    assert set(small[small.recipe == "T"].says) == {NOT_SEEN}
    values = small[small.recipe == "R"].value.tolist()
    assert values == pytest.approx([20**-0.25] * 4, rel=0.03)


def unpacked(text):
    return np.frombuffer(base64.b64decode(text), "<u2") / stopping_point.SCALE


@pytest.mark.more
def test_the_page_has_the_published_numbers(make_results):
    worth = {(recipe, "sidm"): 4.0 for recipe in RECIPES}
    results = make_results(power(worth), power({}, level=0.5))
    draws = results[(results.recipe == "T") & (results.system == "system1")]
    saved = length_curves.along_training(results)
    draws = draws.assign(seed=draws.seed + 1000)
    contents = stopping_point.contents(results, draws, saved)
    points = saved[(saved.recipe == "R") & (saved.quantity == "data")]
    points = points[points.system == "system1"].set_index("rule")
    assert points.value["released"] == pytest.approx(4, rel=0.1)
    assert points.value["end"] == pytest.approx(1, rel=0.1)
    assert all(axes.lines for axes in length_curves.figure(saved).axes)
    judged = verdicts.verdicts(results)
    recipe = next(one for one in contents["recipes"] if one["id"] == "R-system1")
    chosen = results[(results.recipe == "R") & (results.system == "system1")]
    for name, rule in (("R1", verdicts.RELEASED), ("R2", verdicts.END)):
        published = line(judged, name, "system1")
        (shown,) = recipe["rules"][rule]["saving"]["data 5"]
        assert shown == pytest.approx(
            [published.value, published.low, published.high], rel=1e-3
        )
        losses = verdicts.losses_by(chosen, rule).loss
        kept = [loss for loss, _, _ in recipe["rules"][rule]["kept"]]
        assert kept == pytest.approx(losses.tolist(), abs=1e-4)
    after = length_curves.losses_after(chosen, contents["lengths"])
    for place, length in enumerate(contents["lengths"]):
        kept = [unpacked(one["kept"])[place] for one in recipe["trainings"]]
        assert kept == pytest.approx(after[length].loss.tolist(), abs=1e-4)
    assert len(contents["search"]) == len(draws)
    assert json.loads(json.dumps(contents, allow_nan=False))["rules"] == list(RULES)


def test_harm_is_contrary_and_bounds_are_in_words(make_results):
    worth = {(recipe, "sidm"): 0.5 for recipe in RECIPES}
    worth |= {(recipe, FINETUNING): 1e-6 for recipe in RECIPES}
    table = verdicts.verdicts(make_results(power(worth), power(worth)))
    assert set(table[table.method == "sidm"].says) == {CONTRARY}
    assert line(table, "R2", "system1").value == pytest.approx(0.5, rel=0.1)
    page = verdicts.page_table(table)
    bounds = page[page.Of == "fine-tuning, 5 min"]["Ours (95 % interval)"]
    assert "at most 0.20" in set(bounds)


def test_too_few_seeds_have_no_verdict(make_results):
    table = verdicts.verdicts(make_results(power({}), power({}), seeds=range(2)))
    assert set(table.says) == {NO_VERDICT} and set(table.seeds) == {2}
    none = make_results(power({}), power({}), seeds=())
    assert not verdicts.verdicts(none).seeds.any()
    contents = stopping_point.contents(none, none, length_curves.along_training(none))
    assert contents["recipes"] == contents["lengths"] == contents["search"] == []
    charts = stopping_charts.charts(contents["methods"])
    assert {*charts} == {"losses", "figure3", "saving", "search"}


SIZES = (1.0, 5.0, 20.0, 60.0, 120.0)
CURVE = np.array([0.5, 0.4, 0.3, 0.25, 0.2])


def test_a_data_ratio_by_hand():
    """Training alone has the loss at 10 min, the geometric mean of 5 and 20 min."""
    seeds = np.array([1, 1.1, 0.9])
    ratio = data_ratio(SIZES, seeds[:, None] * CURVE, seeds * np.sqrt(0.4 * 0.3), 5.0)
    assert ratio[:3] == pytest.approx((2.0, 2.0, 2.0))


def test_a_curve_that_does_not_get_there_is_a_bound_without_a_value():
    three = np.stack([CURVE] * 3)
    above = data_ratio(SIZES, three, np.array([0.19, 0.21, 0.22]), 5.0)
    assert np.isnan(above[:3]).all()
    assert above.text() == "at least 24 in 1 of 3 seeds, 18 to 21 in 2"
    shorter = data_ratio(SIZES[:-1], three[:, :-1], np.array([0.19, 0.21, 0.22]), 5.0)
    assert (shorter.low, shorter.high) == (pytest.approx(12), np.inf)
    below = data_ratio(SIZES, three, np.array([0.6, 0.55, 0.51]), 5.0)
    assert (below.low, below.high) == (0, pytest.approx(0.2))
    both = data_ratio(SIZES, three, np.array([0.6, 0.1, 0.3]), 5.0)
    assert both.text() == "at least 24 in 1 of 3 seeds, at most 0.20 in 1, 4.0 in 1"
    few = data_ratio(SIZES, three[:2], np.array([0.3, 0.3]), 5.0)
    assert few.text() == "no value"
    for ratio in (above, shorter, below, both, few):
        assert verdict(Interval(*ratio[:3]), 1.0, 20.0) == NO_VERDICT


def test_each_step_says_what_is_stored_and_how_long_it_took(study, make_row, tmp_path):
    store, trials = Results(tmp_path), search.first_search(study)
    for trial in (*trials[:3], trials[-1]):
        store.put(make_row(trial))
    lines, unknown = design.overview_by_step(study, store, trials)
    assert lines[0].startswith("step 0: search, system 1: 3 of 40 trainings stored, ")
    assert "0.0 core-hours, 25 samples a second" in lines[0]
    listed = (trial for step in STEPS for trial in step.trials(study))
    planned = 358 + 109 - sum(not trial.solved for trial in listed)
    assert unknown == 0  # some of the trials are asked for
    _, unknown = design.overview_by_step(study, store, grid("study", "decisive"))
    assert unknown == planned - 5  # five of step E3 are of step B2, too


def test_steps_can_be_run_alone(study):
    some = grid("study", "decisive", steps=["A2", "A1"])
    first, second = (design.STEPS[i].trials(study) for i in (3, 5))
    assert some == first + second
    one = grid("study", "decisive", "system2", steps=["A2", "A1"])
    assert one == second
    with pytest.raises(ConfigError, match="unknown step 'A3'"):
        grid("study", "decisive", steps=["A3"])
    with pytest.raises(ConfigError, match="the figure decisive alone has steps"):
        grid("study", "3", steps=["A1"])


WIDE = 100_000  # the same, for steps E1 to E5


@pytest.fixture
def store(tmp_path):
    return Results(tmp_path)


@pytest.fixture
def put(store, make_row):
    """Function that stores a row whose loss falls until a million samples.

    With `later`, the loss falls again after the cap of E1.
    """

    def put(trial, loss, later=None):
        every = np.full(trial.training.max_samples // WIDE, loss)
        every[:10] = np.linspace(2 * loss, loss, 10)
        if later is not None:
            every[arms.ABLATION_CAPS[trial.system] // WIDE + 2 :] = later
        row = make_row(trial, every[-1])
        store.put(with_curve(row, every, WIDE))

    return put


@pytest.fixture
def results(study, store, put):
    """Rows of E1 and R: one setting changes the loss, seeds differ a little.

    R's trainings of system 2 gain only after the cap.
    """
    rng = np.random.default_rng(0)
    seeds = 1 + 0.1 * rng.standard_normal(3)
    for system in arms.ABLATION_CAPS:
        later = 0.1 if system == "system2" else None
        for trial in arm(study, "R", system, restricted(R_CAPS, sidm=(5.0,)), range(3)):
            put(trial, 0.3 * seeds[trial.seed], later)
    made = arms.ablations(study)
    assert len({trial.key for trial in made}) == 48
    for trial in made:
        effect = 1.3 if trial.training.p_expert == 0.9 else 1
        noise = 1 + 0.002 * rng.standard_normal()
        put(trial, 0.3 * seeds[trial.seed] * effect * noise)
    return ablated.results(study, store)


def test_a_setting_is_held_against_r_seed_by_seed_at_one_cap(results):
    """Settings without effect do not differ; R's gain beyond the cap does not count."""
    table = ablated.table(results)
    assert len(table) == 2 * 2 * 8 and (table.seeds == 3).all()
    for row in table.itertuples():
        effect = 1.3 if row.value == 0.9 else 1
        assert row.ratio == pytest.approx(effect, rel=0.005)
        assert row.differs == (effect == 1.3) and row.low < row.ratio < row.high
        said = DIRECTION if effect == 1.3 else NOT_SEEN
        assert ablated.says_above(table.loc[[row.Index]]) == [said]
    learnt = ablated.training_ratios(results).set_index(["system", "value"]).ratio
    assert len(learnt) == 16 and learnt["system1", 0.9] == pytest.approx(1.3, rel=0.01)
    assert len(ablated.figure(table[table.rule == END], table).axes) == 2
    # without all settings nothing differs
    few = ablated.table(results[(results.setting == "") | (results.value == 0.9)])
    assert few.corrected.isna().all() and not few.differs.any()
    assert set(ablated.says_above(few)) == {NO_VERDICT}
    assert ablated.table(results[results.seed == 0]).low.isna().all()


def test_the_draw_that_is_tested_lower_counts(study, store, put):
    """Of the two SIDMs with the rival's decay; the rival has a loss of 0.3."""
    assert np.isnan(verdicts.with_rivals_decay(study, store).value)
    for trial in arms.rivals_decay(study):
        put(trial, 0.27 if trial.training.weight_decay > 0.05 else 0.3)
    for trial in arm(study, "T", "system1", RECIPES["T"], SEEDS):
        if trial.method == "novice_only":
            put(trial, 0.3 * (1 + 0.001 * trial.seed))
    ratio = verdicts.with_rivals_decay(study, store)
    assert ratio.value == pytest.approx(0.9, rel=0.002) and ratio.high < 0.91


def test_system_2_is_read_along_the_sizes_of_its_step(make_results):
    """Step E3 has no training alone with an hour or more."""
    loss = power({("T", "sidm"): 3.0})
    frame = make_results(loss, loss)
    few = frame[frame.novice_minutes <= 20]
    saved = verdicts.sidm_saving(few, "T", "system2", END, 5.0)
    assert saved.value == pytest.approx(3, rel=0.1)


def test_each_phase_has_its_loss(study, store, make_row):
    """The second half counts; a loss that doubles and halves has an unrest of log 2."""
    for trial in arms.both_phases(study):
        row = make_row(trial, 0.3)
        matched = trial.training.matching_iterations / 100
        curves = {
            "test_spacing": WIDE,
            "every_training_loss": (9.0, 9.0, 0.2, 0.4, 0.2, 0.4),
            "every_test_loss": (0.3,) * 6,
            "every_validation_loss": (0.3,) * 6,
            "every_matching_loss": (None, 9.0, *[matched] * 4),
            "every_discriminator_accuracy": (None, 1.0, *[0.5] * 4),
        }
        outcome = dataclasses.replace(row.outcome, **curves)
        store.put(dataclasses.replace(row, outcome=outcome))
    table = ablated.phase_losses(study, store)
    assert table.matching.to_numpy() == pytest.approx([0.2, 0.2, 1, 1, 0.2, 0.2])
    assert table.iterations[4] == "500 prediction, 20 matching"
    assert table.prediction.to_numpy() == pytest.approx(1 / 3)
    assert table.unrest.to_numpy() == pytest.approx(np.log(2))
    assert ablated.phase_losses(study, Results(store.folder / "none")).empty


def test_a_p_value_belongs_to_its_interval(rng):
    """An interval that ends at 1 has a p-value of 0.05."""
    logs = 0.1 + 0.2 * rng.standard_normal(6)
    ratio = mean_ratio(np.exp(logs), np.ones(6))
    p = p_values([(2.0, 1.0, 4.0), ratio, (2.0, np.nan, np.nan)], [5, 6, 1])
    assert p[:2] == pytest.approx([0.05, ttest_1samp(logs, 0).pvalue])
    assert np.isnan(p[2])


def test_the_rivals_best_seed_lowers_the_ratio(study, store, put):
    """Losses 1 / sqrt(minutes); one of five seeds is better from 20 minutes on."""
    for trial in arm(study, "R", "system1", R_CAPS, range(5)):
        loss = trial.novice_minutes**-0.5 / (2 if trial.method == "sidm" else 1)
        if trial.seed == 3 and trial.novice_minutes >= 20:
            loss *= 0.8
        put(trial, loss)
    # results of one recipe alone have the types that figures compute with
    frame = verdicts.results(study, store)
    assert frame.validation_loss.dtype == float and set(frame.recipe) == {"R"}
    plain = length_curves.ratio_at_best(frame, "system1", ())
    best = length_curves.ratio_at_best(frame, "system1", ALONE_SIZES[2:])
    assert plain.value == pytest.approx(4, rel=0.15)
    assert best.value == pytest.approx(2.9, rel=0.05)


def test_the_median_drive_is_shown():
    """Predicted paths end 3, 1 and 2 m off."""
    actual = np.zeros((3, 26, 13))
    predicted = actual.copy()
    predicted[:, -1, 0] = 3, 1, 2
    paths = {"rollouts_predicted": [predicted.tolist()], "rollouts_actual": [actual]}
    assert figure4.median_drive(pd.DataFrame(paths)) == 2


def test_one_setting_changes_at_a_time(study):
    made = arms.ablations(study)
    assert len({trial.key for trial in made}) == 48
    for trial in made:
        training = trial.training
        off_r = [
            training.p_expert != arms.OF_R["p_expert"][trial.system],
            training.prediction_iterations != 100,
            training.matching_iterations != 20 or not training.regularise,
        ]
        assert sum(off_r) == 1 and training.max_samples == training.patience
