"""Training by likelihood beside its deterministic twin: tables and figures."""

import dataclasses

import numpy as np
import pytest
import torch
from scipy import stats

from companion import Study
from companion.engine import models
from companion.engine.frame import records_frame
from companion.engine.library import Library
from companion.studies.uncertainty import measure as u
from companion.studies.uncertainty.results import (
    claims,
    coverage,
    coverage_figure,
    figure,
    quantiles,
    table,
)
from tests.companion.conftest import kept, made


@pytest.fixture(scope="module")
def jobs(tiny, data, tmp_path_factory):
    return u.jobs(
        Study(tiny, data, tmp_path_factory.mktemp("results")),
        "system1",
        [0.75],
        particles=8,
    )


def test_every_model_has_its_twin(jobs):
    assert [(job.trial.method, job.likelihood) for job in jobs] == [
        ("sidm", True),
        ("sidm", False),
        ("novice_only", True),
        ("novice_only", False),
    ]


@pytest.mark.parametrize("number", [0, 3])
def test_a_fit_is_judged_and_stored(jobs, data, tmp_path, golden, number):
    job = jobs[number]
    result = u.measure(job, data)
    assert np.isfinite([result.nll, result.validation_loss]).all()
    half, most = np.array(result.coverage)
    assert half.shape == (13,)
    assert (half >= 0).all()
    assert (half <= most).all()
    assert (most <= 1).all()
    assert np.array(result.steps_coverage).shape == (2, 25, 3)
    assert (result.samples > 0) == job.likelihood
    assert np.array(result.steps_width).shape == (2, 25, 3)
    assert np.array(result.steps_error).shape == (25, 3)
    assert sum(result.component_losses) == pytest.approx(result.validation_loss)
    assert len(result.position_error) == len(result.heading_error) == 25
    assert result.position_error[-1] > 0
    assert (
        (len(result.curve_samples) > 0)
        == (result.training_seconds > 0)
        == job.likelihood
    )
    assert all((value > 0) == job.likelihood for value in result.latent_spread)
    # without random latents, components are independent and draws are equal
    if not job.likelihood:
        assert (
            sum(result.component_nll)
            == pytest.approx(result.nll)
            == result.nll_at_means
        )
    names = ("validation_loss", "nll", "nll_at_means", "coverage", "spread")
    figures = {name: getattr(result, name) for name in names} | {
        "rollouts": result.steps_error[4]
    }
    golden.hold(
        "a fit by likelihood" if job.likelihood else "its twin",
        "uncertainty",
        figures,
        rel=0.05,
        abs=0.02,
    )
    assert kept(u.records(tmp_path), result)


def test_the_twins_spread_is_that_of_its_errors(jobs, data):
    """The expected deviation on the test split is written out."""
    twin = models.model_of(jobs[3].trial, data)
    sets = Library(data).datasets(jobs[3].trial)
    test = sets.test.take(range(len(sets.test)))
    with torch.inference_mode():
        errors = twin("novice", test.inputs, test.maps)[0] - test.targets
    assert torch.allclose(
        u.residual_spread(twin, sets),
        errors.square().mean((0, 1)).sqrt().clamp_min(1e-6),
        rtol=1e-4,
    )


@pytest.fixture
def made_up(jobs):
    """Results of three seeds.

    The models of the likelihood are 2 nats better and cover as they should; the twins
    cover too much.
    """
    results = []
    for seed in range(3):
        for job in jobs:
            about = dataclasses.replace(job, trial=job.trial.replace(seed=seed))
            cover = (0.5, 0.9) if job.likelihood else (0.7, 0.95)
            results.append(
                made(
                    u.FitResult,
                    about,
                    validation_loss=1.0 + 0.1 * seed + job.likelihood,
                    component_losses=(0.1,) * 13,
                    nll=5.0 + 0.1 * seed - 2 * job.likelihood,
                    nll_quantiles=(4.0, 5.0, 6.0, 7.0),
                    component_nll=(0.5,) * 13,
                    coverage=tuple((level,) * 13 for level in cover),
                    steps_coverage=tuple(((level,) * 3,) * 25 for level in cover),
                    steps_width=(((0.1,) * 3,) * 25,) * 2,
                    position_error=(0.1,) * 25,
                )
            )
    return records_frame(u.FitResult, results)


def test_models_are_compared_with_their_twins_seed_by_seed(made_up):
    rows = table(made_up).set_index(["method", "likelihood"])
    mine, twin = rows.loc[("sidm", True)], rows.loc[("sidm", False)]
    assert mine.seeds == 3 and np.isnan(twin.difference)
    assert mine.nll == pytest.approx(3.1)
    assert mine.difference == pytest.approx(-2)
    assert mine.high < -1.9
    assert mine.loss == pytest.approx(2.1)
    assert len(rows) == 4
    assert set(rows.system) == {"system1"}
    assert mine.constant == pytest.approx(13 * stats.norm(0, 0.1**0.5).entropy())


def test_coverage_is_a_mean_over_seeds_with_the_least_and_most_of_its_components(
    made_up,
):
    cover = list(made_up.coverage)
    cover[0] = ((0.2, *[0.5] * 12), cover[0][1])  # first seed of the first model
    rows = coverage(made_up.assign(coverage=cover)).set_index(
        ["method", "likelihood", "level"]
    )
    half = rows.loc[("sidm", True, 0.5)]
    assert (half.least, half.most, half.rollout) == pytest.approx((0.4, 0.5, 0.5))
    assert half.one_step == pytest.approx((12 * 0.5 + 0.4) / 13)
    assert half.position == pytest.approx(0.1)
    assert rows.one_step["sidm", False, 0.9] == pytest.approx(0.95)
    assert half.width.shape == (3,)


def test_steps_and_the_redundant_component_have_lines(made_up):
    first, twin, *_ = quantiles(made_up).itertuples(index=False)
    assert first[:4] == ("system1", 0.75, "sidm", True)
    assert first[4:] == pytest.approx((4, 5, 6, 7, 3.1, 0.5))
    assert twin.likelihood == False  # noqa: E712 - a NumPy bool


def test_the_claim_is_of_the_pairs(made_up):
    (claim,) = claims(table(made_up)).itertuples()
    assert claim.value == pytest.approx(-2) and claim.ours.endswith(" nats")
    assert claim.verdict == "In the same direction"


def test_figures_draw_all(made_up):
    left, right = coverage_figure(made_up, 0.75, ["system1", "system2"]).axes
    assert len([line for line in left.get_lines() if len(line.get_ydata()) == 25]) == 8
    assert right.texts[0].get_text() == "no trials stored"
    axes = figure(table(made_up), ["system1"]).axes[0]
    assert len(axes.get_lines()) == 4
    assert axes.get_lines()[0].get_ydata()[0] == pytest.approx(2.1)


def test_nothing_stored_makes_empty_tables(made_up):
    nothing = records_frame(u.FitResult, [])
    tables = [measure(nothing) for measure in (table, coverage, quantiles)]
    assert not any(map(len, [*tables, claims(tables[0])]))
    twins = table(made_up[~made_up.likelihood])
    assert len(twins) == 2 and not len(claims(twins))
