"""Statistics against closed forms and SciPy."""

import numpy as np
import pytest
import scipy.stats

from companion.statistics import coverage
from companion.statistics.intervals import (
    MANY_SEEDS,
    bootstrap,
    interval,
    leave_one_out,
)
from companion.statistics.savings import isotonic_fit, minutes_needed
from sidm.storage import read_record
from tests.companion.conftest import RESULTS

FILE = RESULTS / coverage.FILE.name
MINUTES = np.array([1.0, 2, 5, 20, 60, 120])


def test_bootstrap_agrees_with_scipy():
    samples = np.random.default_rng(1).lognormal(size=12)
    interval = bootstrap(np.mean, samples, resamples=20_000)
    expected = scipy.stats.bootstrap(
        (samples,),
        np.mean,
        n_resamples=20_000,
        method="percentile",
        rng=np.random.default_rng(2),
    ).confidence_interval
    assert interval.value == samples.mean()
    assert interval.low == pytest.approx(expected.low, rel=0.02)
    assert interval.high == pytest.approx(expected.high, rel=0.02)


def test_leaving_one_out_of_a_mean_is_students_interval():
    samples = np.random.default_rng(1).normal(size=7)
    expected = scipy.stats.ttest_1samp(samples, 0).confidence_interval()
    assert leave_one_out(np.mean, samples) == pytest.approx(
        (samples.mean(), expected.low, expected.high)
    )


def test_intervals_of_degenerate_samples():
    for few in ([2.0], [1.5, 2.5]):
        assert interval(np.mean, np.array(few)).text(3) == "2.00"
    for many in (4, 40):
        assert interval(np.mean, np.full(many, 2.0)) == (2, 2, 2)
    for many in (5, 40):
        assert np.isnan(interval(lambda _: float("nan"), np.ones((many, 2)))).all()
    samples = np.random.default_rng(1).lognormal(size=MANY_SEEDS)
    assert interval(np.mean, samples) == bootstrap(np.mean, samples)
    assert interval(np.mean, samples[1:]) == leave_one_out(np.mean, samples[1:])


def test_coverage_is_as_stored():
    """95 % intervals contain the true ratio in 92 to 98 % of 500 studies of 30 seeds.

    Percentiles of few seeds do not.
    """
    stored = read_record(FILE)
    for name, method in coverage.METHODS.items():
        # more seeds would take a minute
        assert stored[name]["3"] == pytest.approx(
            coverage.coverage(method, 3), abs=0.004
        )
    assert all(0.92 <= share <= 0.98 for share, _ in stored["leave_one_out"].values())
    assert 0.92 <= stored["percentile"]["30"][0] <= 0.98
    assert stored["percentile"]["3"][0] < 0.85


@pytest.mark.parametrize("name", coverage.ESTIMATORS)
def test_estimators_keep_what_they_promise(name):
    stored = (
        coverage.estimators(FILE).set_index(["estimator", "ratio", "seeds"]).loc[name]
    )
    assert len(stored) == 6
    # studies with an interval are no fair sample where nearly all have a bound
    assert stored.share[stored.open < 0.7].between(0.92, 0.98).all()
    assert (stored.above < 0.05).all()
    assert coverage.estimator_coverage(name, 1.0, 5) == pytest.approx(
        stored.loc[1.0, 5].tolist(), abs=0.011
    )


def test_a_rise_is_levelled_at_the_geometric_mean():
    assert isotonic_fit([4, 2, 1]) == pytest.approx([4, 2, 1])
    assert isotonic_fit([4, 1, 2]) == pytest.approx([4, np.sqrt(2), np.sqrt(2)])


def test_minutes_needed_reads_a_power_law():
    curve = MINUTES**-0.5
    assert minutes_needed(MINUTES, curve, 10**-0.5) == (pytest.approx(10), "=")
    assert minutes_needed(MINUTES, curve, 2.0) == (1, "<=")
    assert minutes_needed(MINUTES, curve, 0.01) == (120, ">")
    assert minutes_needed(MINUTES, curve, curve[0]) == (1, "=")


def test_splits_of_the_same_data_count_for_less(rng):
    values = rng.normal(size=10)
    plain, split = interval(np.mean, values), interval(np.mean, values, held_out=0.25)
    assert split.high - split.value == pytest.approx(
        np.sqrt(1 + 10 / 3) * (plain.high - plain.value)
    )
