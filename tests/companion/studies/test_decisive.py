"""The decisive experiment: its table, and both verdicts on made-up results."""

import base64
import dataclasses
import json

import numpy as np
import pytest

from companion import Results, Study, grid
from companion.engine.frame import frame_of
from companion.statistics.claims import (
    CONTRARY,
    DIRECTION,
    NO_VERDICT,
    NOT_SEEN,
    REPRODUCED,
)
from companion.statistics.data_ratio import data_ratio
from companion.statistics.stopping_rules import RULES
from companion.studies.decisive import (
    along,
    design,
    figures,
    search,
    stopping_charts,
    stopping_point,
    verdicts,
)
from companion.studies.decisive.arms import FINETUNING, RECIPES, SEEDS, arm
from companion.studies.decisive.design import STEPS
from companion.studies.decisive.verdicts import verdict_of
from sidm.config import ConfigError

SPACING = 12_800  # samples between two tests
EARLY = 40  # tests until the released rule has seen the first minimum


@pytest.fixture
def study(tmp_path):
    return Study("study", tmp_path, tmp_path)


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
        middle, end = 1.5 * early, late
        loss = np.full(count, middle)
        loss[:EARLY] = np.linspace(2 * middle, early, EARLY)
        loss[-20:] = end  # long enough for the smoothed loss to fall
        made = make_row(trial, late)
        every = {f"every_{name}_loss": tuple(loss) for name in ("test", "validation")}
        every["every_training_loss"] = tuple(0.1 * loss)
        outcome = dataclasses.replace(
            made.outcome,
            samples=count * SPACING,
            iterations=count * SPACING // (trial.training.batch * 64),
            test_spacing=SPACING,
            **every,
        )
        return dataclasses.replace(made, outcome=outcome)

    def make(early, late, seeds=SEEDS, **only):
        parts = []
        for recipe, caps in RECIPES.items():
            for system in ("system1", "system2"):
                trials = arm(study, recipe, system, caps, seeds)
                parts.append(
                    frame_of(
                        row(t, early(t, recipe), late(t, recipe)) for t in trials
                    ).assign(recipe=recipe)
                )
        return verdicts.pd.concat(parts)

    return make


def power(worth, level=1.0):
    """Losses with which a method's data count several times.

    Seeds differ in a part that all methods share and in a part of their own.
    """

    def loss(trial, recipe):
        rng = np.random.default_rng(
            [trial.seed, round(100 * trial.novice_minutes), len(trial.method)]
        )
        noise = 1 + 0.02 * np.cos(trial.seed) + 0.005 * rng.standard_normal()
        return (
            level
            * noise
            * (worth.get((recipe, trial.method), 1.0) * trial.novice_minutes) ** -0.25
        )

    return loss


def line(table, verdict, system, method="sidm", minutes=5.0):
    (found,) = table[
        (table.verdict == verdict)
        & (table.system == system)
        & (table.method == method)
        & (table.minutes == minutes)
    ].itertuples()
    return found


def test_the_table_plans_what_it_says(study, chosen):
    for step in STEPS:
        trials = [trial for trial in step.trials(study) if not trial.solved]
        assert len(trials) == len({trial.key for trial in trials}) == step.trainings, (
            step.name
        )


def test_before_the_search_only_settings_are_unknown(study, monkeypatch):
    monkeypatch.setattr(search, "BEST", {})
    monkeypatch.setattr(search, "CHOSEN", {})
    known = [sum(not trial.solved for trial in step.trials(study)) for step in STEPS]
    assert known == [40, 0, 8, 40, 0, 40, 12, 0, 18, 30, 48, 6, 0, 15, 9]


def test_nothing_stops_a_training_and_both_recipes_have_the_same_motion(study, chosen):
    trials = [
        t
        for recipe, caps in RECIPES.items()
        for t in arm(study, recipe, "system1", caps, SEEDS)
    ]
    assert {t.motion for t in trials} == {"decisive"}
    assert all(
        trial.training.patience == trial.training.max_samples for trial in trials
    )
    assert len({tuple(t.datasets.values()) for t in trials}) == 1
    assert {t.training.validation_trajectories for t in trials} == {128}
    assert all(128 <= trial.datasets["validation"].count for trial in trials)
    sizes_and_seeds = {(t.novice_minutes, t.seed) for t in trials if t.method == "sidm"}
    # paired
    assert sizes_and_seeds <= {
        (t.novice_minutes, t.seed) for t in trials if t.method == "novice_only"
    }


def test_r_is_the_released_recipe(study):
    training = arm(study, "R", "system2", RECIPES["R"], [0])[0].training
    expected = dict(
        batch=2,
        learning_rate=1e-4,
        weight_decay=1e-5,
        decay="l2",
        reduction="mean",
        units="raw",
        zero_gradients=True,
        replacement=False,
        discriminator_draw="one",
        system_draw="iteration",
        matching_optimiser="shared",
        prediction_iterations=100,
        discriminator_iterations=20,
        matching_iterations=20,
        p_expert=0.5,
    )
    assert {name: getattr(training, name) for name in expected} == expected
    assert arm(study, "R", "system1", RECIPES["R"], [0])[0].training.p_expert == 0.75
    assert (
        arm(study, "R", "system1", RECIPES["R"], [0])[0].network.initialisation
        == "pytorch"
    )


def test_what_decides_most_is_run_first(study):
    trials = arm(study, "R", "system1", RECIPES["R"], SEEDS)
    assert [t.novice_minutes for t in trials[:10]] == [5.0] * 10
    assert [t.seed for t in trials[:4]] == [0, 0, 1, 1]
    assert {t.novice_minutes for t in trials[10:30]} == {1.0, 20.0}


def test_draws_are_the_same_everywhere():
    """The draws are those of the stored search, number by number."""
    assert search.draw("sidm", 7).changes == {
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
        (name, value) for _, name, value in search.draw(FINETUNING, 9).changes["tuned"]
    )
    expected = (0.000237, 0.0126, 2)
    assert (tuned["learning_rate"], tuned["weight_decay"], tuned["batch"]) == expected


def test_scores_are_by_least_squares_on_the_same_split(study, make_row):
    trials = search.first_search(study)
    hard = {trial.seed: 1 + trial.seed % 7 for trial in trials}  # factor of a split
    good = {("sidm", 1004): 0.5, ("novice_only", 1003): 0.7}
    rows = [
        make_row(
            t, hard[t.seed] * (1.0 if t.solved else good.get((t.method, t.seed), 0.9))
        )
        for t in trials
    ]
    scores = search.scores(frame_of(rows)).groupby("method").first()
    assert scores.score.to_dict() == pytest.approx(
        {"sidm": 0.5, "novice_only": 0.7, FINETUNING: 0.9}
    )
    assert (
        scores.learning_rate["sidm"] == search.draw("sidm", 4).changes["learning_rate"]
    )


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
    assert small[small.recipe == "R"].value.tolist() == pytest.approx(
        [20**-0.25] * 4, rel=0.03
    )


@pytest.mark.more
def test_the_saving_shrinks_along_the_training(make_results, tmp_path):
    """An early saving is gone at the end: the line ends at the point of the end."""
    worth = {(recipe, "sidm"): 4.0 for recipe in RECIPES}
    results = make_results(power(worth), power({}, level=0.5))
    table = along.along_training(results)
    line = table[
        (table.recipe == "R") & (table.system == "system1") & (table.quantity == "data")
    ]
    points, line = (
        line[line.rule != ""].set_index("rule"),
        line[line.rule == ""].set_index("samples"),
    )
    assert line.value[line.index > 1e6].iloc[0] == pytest.approx(4, rel=0.1)
    assert set(points.index) == set(RULES)
    assert (
        line.value.iloc[-1]
        == pytest.approx(1, rel=0.1)
        == pytest.approx(points.value["the end"], rel=0.1)
    )
    assert points.value["the released code's"] == pytest.approx(4, rel=0.1)
    assert (
        points.samples["this book's"]
        < points.samples["the released code's"]
        < points.samples["the end"]
    )
    figures.by_length(table).savefig(tmp_path / "length.png")
    drawn = figures.by_rule(results, "T", "system2")
    assert [len(axes.lines) for axes in drawn.axes] == [3] * 4
    assert len(figures.by_length(table).axes) == 4
    assert not len(along.along_training(results[:0]))


def unpacked(text):
    return np.frombuffer(base64.b64decode(text), "<u2") / stopping_point.SCALE


@pytest.mark.more
def test_the_page_has_the_published_numbers(make_results):
    """What a rule keeps, Figure 3 and the savings are those of figures and verdicts."""
    worth = {(recipe, "sidm"): 4.0 for recipe in RECIPES}
    results = make_results(power(worth), power({}, level=0.5))
    draws = results[(results.recipe == "T") & (results.system == "system1")]
    saved = along.along_training(results)
    draws = draws.assign(seed=draws.seed + 1000)
    contents = stopping_point.contents(results, draws, saved)
    judged = verdicts.verdicts(results)
    recipe = next(one for one in contents["recipes"] if one["id"] == "R-system1")
    chosen = results[(results.recipe == "R") & (results.system == "system1")]
    for verdict, rule in (("R1", verdicts.RELEASED), ("R2", verdicts.END)):
        published = line(judged, verdict, "system1")
        (shown,) = recipe["rules"][rule]["saving"]["data 5"]
        assert shown == pytest.approx(
            [published.value, published.low, published.high], rel=1e-3
        )
        losses = verdicts.losses_by(chosen, rule).loss
        kept = [loss for loss, _, _ in recipe["rules"][rule]["kept"]]
        assert kept == pytest.approx(losses.tolist(), abs=1e-4)
    after = along.losses_after(chosen, contents["lengths"])
    for place, length in enumerate(contents["lengths"]):
        kept = [unpacked(one["kept"])[place] for one in recipe["trainings"]]
        assert kept == pytest.approx(after[length].loss.tolist(), abs=1e-4)
    assert len(contents["search"]) == len(draws)
    assert json.loads(json.dumps(contents, allow_nan=False))["rules"] == list(RULES)


def test_the_page_without_results_is_empty(make_results):
    none = make_results(power({}), power({}))[:0]
    contents = stopping_point.contents(none, none, along.along_training(none))
    assert contents["recipes"] == contents["lengths"] == contents["search"] == []
    assert set(stopping_charts.charts(contents["methods"])) == {
        "losses",
        "figure3",
        "saving",
        "search",
    }


def test_harm_is_contrary(make_results):
    worth = {(recipe, "sidm"): 0.5 for recipe in RECIPES}
    table = verdicts.verdicts(make_results(power(worth), power(worth)))
    assert set(table[table.method == "sidm"].says) == {CONTRARY}
    assert line(table, "R2", "system1").value == pytest.approx(0.5, rel=0.1)


def test_too_few_seeds_have_no_verdict(make_results):
    table = verdicts.verdicts(make_results(power({}), power({}), seeds=range(2)))
    assert set(table.says) == {NO_VERDICT} and set(table.seeds) == {2}
    assert not verdicts.verdicts(
        make_results(power({}), power({}), seeds=())
    ).seeds.any()


SIZES = (1.0, 5.0, 20.0, 60.0, 120.0)
CURVE = np.array([0.5, 0.4, 0.3, 0.25, 0.2])


def test_a_recipe_without_rows_takes_no_types_away(study, make_row, tmp_path):
    """Results of one recipe alone have the types that figures compute with."""
    trials = arm(study, "R", "system1", RECIPES["R"], range(3))
    store = Results(tmp_path)
    for trial in trials:
        store.put(make_row(trial, 0.3))
    stored = verdicts.results(study, store)
    assert len(stored) == len(trials) and stored.validation_loss.dtype == float
    assert len(verdicts.page_table(verdicts.verdicts(stored))) == 0


def test_a_table_of_verdicts_for_a_page(make_results):
    """Bounds are in words, and what is not run is left out."""

    rival = power({})

    def loss(trial, recipe):
        """The SIDM is better than its rival can be, fine-tuning much worse."""
        others = {"sidm": 0.01, FINETUNING: 9.0}
        return others.get(trial.method) or rival(trial, recipe)

    table = verdicts.page_table(verdicts.verdicts(make_results(loss, loss)))
    ratios = table[table.Quantity == "data ratio"].set_index("Of")
    ratios = ratios["Ours (95 % interval)"]
    assert set(ratios["SIDM, 5 min"]) == {"at least 24"}
    assert set(ratios["fine-tuning, 5 min"]) == {"at most 0.20"}


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
    assert shorter.text() == "at least 12"
    assert verdict_of(above) == verdict_of(shorter, 20.0) == NO_VERDICT
    below = data_ratio(SIZES, three, np.array([0.6, 0.55, 0.51]), 5.0)
    assert (below.low, below.high) == (0, pytest.approx(0.2))
    assert verdict_of(below) == NO_VERDICT
    both = data_ratio(SIZES, three, np.array([0.6, 0.1, 0.3]), 5.0)
    assert both.text() == "at least 24 in 1 of 3 seeds, at most 0.20 in 1, 4.0 in 1"
    assert verdict_of(both) == NO_VERDICT
    few = data_ratio(SIZES, three[:2], np.array([0.3, 0.3]), 5.0)
    assert few.text() == "no value" and verdict_of(few) == NO_VERDICT


def test_progress_counts_trainings_and_their_hours(study, make_row, tmp_path):
    store, trials = Results(tmp_path), search.first_search(study)
    for trial in (*trials[:3], trials[-1]):
        store.put(make_row(trial))
    progress = design.progress(study, store).set_index("step")
    assert progress.stored["0"] == 3
    assert progress.planned.sum() == 358 + 103
    assert progress.core_hours["0"] == pytest.approx(36 / 3600)
    lines, unknown = design.overview_by_step(study, store, trials)
    assert lines[0].startswith(
        "step 0: search, system 1: 3 of 40 trainings stored, 0.0 core-hours"
    )
    planned = sum(step.trainings for step in STEPS)
    assert unknown == planned - sum(
        not trial.solved for step in STEPS for trial in step.trials(study)
    )


def test_steps_can_be_run_alone(study):
    """Trials keep their order; other figures and other names have no steps."""
    folders = dict(data=study.data, results=study.results)
    some = grid("study", "decisive", steps=["A2", "A1"], **folders)
    first, second = (design.STEPS[i].trials(study) for i in (3, 5))
    assert some == first + second
    one = grid("study", "decisive", "system2", steps=["A2", "A1"], **folders)
    assert one == second
    with pytest.raises(ConfigError, match="unknown step 'A3'"):
        grid("study", "decisive", steps=["A3"], **folders)
    with pytest.raises(ConfigError, match="the figure decisive alone has steps"):
        grid("study", "3", steps=["A1"], **folders)
