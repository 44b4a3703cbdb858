"""Training by likelihood beside its deterministic twin: tables and claims."""

import dataclasses

import numpy as np
import pytest
from scipy import stats

from companion.engine.frame import records_frame
from companion.studies.uncertainty import measure as u
from companion.studies.uncertainty.results import claims, coverage, table
from sidm.config import to_mapping
from tests.companion.conftest import made


@pytest.fixture
def jobs(study):
    return u.jobs(study, "system1", [0.75], particles=8)


@pytest.fixture
def made_up(jobs):
    """The likelihood's models are 2 nats better; their twins cover too much."""
    results = []
    for seed in range(3):
        for job in jobs:
            cover = (0.5, 0.9) if job.likelihood else (0.7, 0.95)
            result = made(
                u.FitResult,
                dataclasses.replace(job, trial=job.trial.replace(seed=seed)),
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
            results.append(result)
    return records_frame(u.FitResult, map(to_mapping, results))


def test_models_are_compared_with_their_twins_seed_by_seed(made_up):
    rows = table(made_up).set_index(["method", "likelihood"])
    mine, twin = rows.loc[("sidm", True)], rows.loc[("sidm", False)]
    assert len(rows) == 4 and mine.seeds == 3 and np.isnan(twin.difference)
    assert (mine.nll, mine.difference, mine.loss) == pytest.approx((3.1, -2, 2.1))
    assert mine.high < -1.9
    assert mine.constant == pytest.approx(13 * stats.norm(0, 0.1**0.5).entropy())
    (claim,) = claims(table(made_up)).itertuples()
    assert claim.value == pytest.approx(-2) and claim.ours.endswith(" nats")
    assert claim.verdict == "In the same direction"


def test_coverage_is_a_mean_over_seeds_with_its_least_and_most_component(made_up):
    cover = list(made_up.coverage)
    cover[0] = ((0.2, *[0.5] * 12), cover[0][1])  # first seed of the first model
    table = coverage(made_up.assign(coverage=cover))
    rows = table.set_index(["method", "likelihood", "level"])
    half = rows.loc[("sidm", True, 0.5)]
    assert (half.least, half.most, half.rollout) == pytest.approx((0.4, 0.5, 0.5))
    assert half.one_step == pytest.approx((12 * 0.5 + 0.4) / 13)
    assert half.position == pytest.approx(0.1)
    assert rows.one_step["sidm", False, 0.9] == pytest.approx(0.95)
