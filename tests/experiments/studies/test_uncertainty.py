"""Training by likelihood beside its twin, on sliding bodies, and what tables and figures make of it."""

import dataclasses

import numpy as np
import pytest
import torch
from scipy import stats

from sidm.experiments import Study
from sidm.experiments.engine import models
from sidm.experiments.engine.execute import Library
from sidm.experiments.engine.provenance import here
from sidm.experiments.studies.uncertainty import fit as u
from sidm.experiments.studies.uncertainty.results import (
    claims,
    coverage_figure,
    in_short,
    likelihood_lines,
    loss_figure,
    nll_lines,
    shares,
)


@pytest.fixture(scope="module")
def jobs(tiny, data, tmp_path_factory):
    return u.fits(Study(tiny, data, tmp_path_factory.mktemp("results")), "system1", [0.75], particles=8)


def test_every_model_has_its_twin(jobs):
    assert [(job.trial.method, job.likelihood) for job in jobs] == [
        ("sidm", True), ("sidm", False), ("novice_only", True), ("novice_only", False)
    ]  # fmt: skip


@pytest.mark.parametrize("number", [0, 3])
def test_a_fit_is_judged_and_stored(jobs, data, tmp_path, golden, number):
    job, store = jobs[number], u.stored(tmp_path)
    found = u.fit(job, data)
    assert np.isfinite([found.nll, found.validation_loss]).all() and not found.provenance.stale
    half, most = np.array(found.coverage)
    assert half.shape == (13,) and (half >= 0).all() and (half <= most).all() and (most <= 1).all()
    assert np.array(found.steps_coverage).shape == (2, 25, 3) and (found.samples > 0) == job.likelihood
    assert np.array(found.steps_width).shape == (2, 25, 3) and np.array(found.steps_error).shape == (25, 3)
    assert sum(found.component_losses) == pytest.approx(found.validation_loss)
    assert len(found.position_error) == len(found.heading_error) == 25 and (found.position_error[-1] > 0)
    assert (len(found.curve_samples) > 0) == (found.training_seconds > 0) == job.likelihood
    assert all((value > 0) == job.likelihood for value in found.latent_spread)
    if not job.likelihood:  # without latents to draw components are independent, and draws are one
        assert sum(found.component_nll) == pytest.approx(found.nll) == found.nll_at_means
    names = ("validation_loss", "nll", "nll_at_means", "coverage", "spread")
    figures = {name: getattr(found, name) for name in names} | {"rollouts": found.steps_error[4]}
    golden.hold("a fit by likelihood" if job.likelihood else "its twin", "uncertainty", figures, rel=0.05, abs=0.02)
    store.put(found)
    assert store.get(job).about == job


def test_the_twins_spread_is_that_of_its_errors(jobs, data):
    """On the test split, written out."""
    twin, sets = models.model_of(jobs[3].trial, data), Library(data).datasets(jobs[3].trial)
    test = sets.test.take(range(len(sets.test)))
    with torch.inference_mode():
        errors = twin("novice", test.inputs, test.maps)[0] - test.targets
    assert torch.allclose(u.residual_spread(twin, sets), errors.square().mean((0, 1)).sqrt().clamp_min(1e-6), rtol=1e-4)


@pytest.fixture
def made_up(jobs):
    """Three seeds: the likelihood's models are 2 nats better and cover as they should, the twins too much."""
    found = []
    for seed in range(3):
        for job in jobs:
            about = dataclasses.replace(job, trial=job.trial.replace(seed=seed))
            cover = (0.5, 0.9) if job.likelihood else (0.7, 0.95)
            found.append(
                u.Fitted(
                    about=about,
                    validation_loss=1.0 + 0.1 * seed + job.likelihood,
                    component_losses=(0.1,) * 13,
                    nll=5.0 + 0.1 * seed - 2 * job.likelihood,
                    nll_at_means=5.0,
                    nll_quantiles=(4.0, 5.0, 6.0, 7.0),
                    component_nll=(0.5,) * 13,
                    spread=(0.1,) * 13,
                    latent_spread=(0.1, 0.2),
                    quietest=(0.0, 0.0, 0.5),
                    coverage=tuple((level,) * 13 for level in cover),
                    steps_coverage=tuple(((level,) * 3,) * 25 for level in cover),
                    steps_width=(((0.1,) * 3,) * 25,) * 2,
                    steps_error=((0.1,) * 3,) * 25,
                    position_error=(0.1,) * 25,
                    heading_error=(0.1,) * 25,
                    samples=1,
                    best_samples=1,
                    best_test_loss=1.0,
                    curve_samples=(1,),
                    curve_test_loss=(1.0,),
                    curve_training_loss=(1.0,),
                    training_seconds=1.0,
                    provenance=here(1.0, 1, False),
                )
            )
    return found


def test_lines_compare_with_the_twin_seed_by_seed(made_up):
    table = {(one.method, one.likelihood): one for one in likelihood_lines(made_up, "system1")}
    mine, twin = table["sidm", True], table["sidm", False]
    assert mine.seeds == 3 and twin.less is None
    assert shares(mine.coverage) == ["50% (50% to 50%)", "90% (90% to 90%)"]
    assert mine.nll == pytest.approx(3.1) and mine.less.value == pytest.approx(-2) and mine.less.high < -1.9
    assert mine.loss == pytest.approx(2.1) and likelihood_lines(made_up, "system2") == []
    assert mine.constant == pytest.approx(13 * stats.norm(0, 0.1**0.5).entropy()) and mine.error == pytest.approx(0.1)
    assert mine.last_width.shape == (2, 3)


def test_steps_and_the_redundant_component_have_lines(made_up):
    first, twin, *_ = nll_lines(made_up, "system1")
    assert first == ("with SIDM", "by likelihood", 0.75, "4.0", "5.0", "6.0", "7.0", "3.1", "0.5")
    assert twin[1] == "deterministic" and nll_lines(made_up, "system2") == []


def test_the_claim_is_of_the_pairs(made_up):
    (claim,) = claims(made_up, "system1")
    assert claim.interval == pytest.approx((2, 2, 2)) and "nats" in claim.ours
    assert claim.verdict == "In the same direction"


def test_in_short_names_sizes_and_means_shares(made_up):
    """One size, at which distributions are 2 nats likelier in every seed; losses are 2.1 and 1.1."""
    assert in_short(made_up, "system1") == (
        "system1, with SIDM: a transition is likelier under distributions than under the twin with 0.75 min; the loss "
        "of their means is 1.91 to 1.91 times the twin's. In the mean over sizes, intervals of 50% and 90% hold 50% "
        "and 90% (the twin's 70% and 95%) of what happens in one step, and "
        "50% and 90% (the twin's 70% and 95%) of the way and turn after 2.5 s."
    )
    assert in_short(made_up, "system2") == "system2: not run"
    twins = [one for one in made_up if not one.about.likelihood]
    assert in_short(twins, "system1") == "system1: not run"


def test_figures_draw_all(made_up):
    left, right = coverage_figure(made_up, 0.75, ["system1", "system2"]).axes
    assert len([line for line in left.get_lines() if len(line.get_ydata()) == 25]) == 8
    assert right.texts[0].get_text() == "no trials stored"
    axes = loss_figure(made_up, ["system1"]).axes[0]
    assert len(axes.get_lines()) == 4 and axes.get_lines()[0].get_ydata()[0] == pytest.approx(2.1)
