"""The stopping rules on made-up test losses, and on trainings that they stopped."""

import dataclasses

import numpy as np
import pytest

from sidm.learning import train
from sidm.learning.evaluation import mean_loss
from sidm.learning.stopping import (
    RELEASED_PATIENCE,
    Curve,
    EarlyStopping,
    KeptWeights,
    StoppingRule,
    kept_after,
    kept_weights,
)


def feed(
    stopper: EarlyStopping, test_losses, training_loss: float = 1.0, step: int = 10
) -> list[bool]:
    """Tests that were new minima; tests are `step` samples and one iteration apart."""
    return [
        stopper.update(step * k, k, training_loss, loss)
        for k, loss in enumerate(test_losses, start=1)
    ]


def test_smoothing_by_hand():
    stopper = EarlyStopping("test_loss", 0.5, 100, 1000)
    assert feed(stopper, [4.0, 2.0, 3.5]) == [True, True, False]  # smoothed 4, 3, 3.25
    assert stopper.test_loss == 3.25
    assert stopper.best == 3.0
    assert stopper.best_samples == 20


def test_stops_when_patience_is_over():
    stopper = EarlyStopping("test_loss", 0.0, 30, 1000)
    feed(stopper, [2.0, 1.0, 1.5, 1.5])
    assert not stopper.finished(40, 4) and not stopper.finished(49, 4)
    assert stopper.finished(50, 5)


def test_an_equal_loss_is_no_improvement():
    assert feed(EarlyStopping("test_loss", 0.0, 30, 1000), [2.0, 2.0]) == [True, False]


def test_cap_holds_before_any_test():
    stopper = EarlyStopping("test_loss", 0.5, 10, 100)
    assert not stopper.finished(99, 3) and stopper.finished(100, 3)


def test_a_loss_that_is_not_a_number_is_never_best():
    stopper = EarlyStopping("test_loss", 0.0, 30, 1000)
    assert feed(stopper, [2.0, float("nan"), float("nan")]) == [True, False, False]
    assert stopper.best == 2.0 and stopper.finished(50, 5)


@pytest.mark.parametrize(("training_loss", "ends"), [(0.7, True), (0.9, False)])
def test_released_rule_waits_for_overfitting(training_loss, ends):
    stopper = EarlyStopping("released", 0.0, 1, 10**9)
    stopper.update(1, 1, training_loss, 1.0)
    stopper.update(2, 2, training_loss, 1.0)
    assert not stopper.finished(10**6, RELEASED_PATIENCE)
    assert stopper.finished(10**6, RELEASED_PATIENCE + 1) is ends


def test_released_rule_smooths_by_nine_tenths():
    stopper = EarlyStopping("released", 0.0, 1, 10**9)
    feed(stopper, [1.0, 2.0])
    assert stopper.test_loss == pytest.approx(1.1)


def curve(test_losses, training_losses=None, spacing=10, iteration=1) -> Curve:
    count = len(test_losses)
    training = training_losses or [1.0] * count
    samples = [spacing * (k + 1) for k in range(count)]
    validation = [-loss for loss in test_losses]
    return Curve(samples, training, test_losses, validation, iteration)


def test_the_end_keeps_the_lowest_smoothed_loss():
    # smoothed 4, 3, 3.25, 1.875, 3.9375
    kept = kept_weights(curve([4.0, 2.0, 3.5, 0.5, 6.0]), StoppingRule())
    assert kept == KeptWeights(
        samples=40, test_loss=1.875, validation_loss=-0.5, seen=50, ended=False
    )


def test_patience_ends_before_a_second_descent():
    losses = [3.0, 2.0, 2.5, 2.5, 2.5, 2.5, 1.0]
    kept = kept_weights(curve(losses), StoppingRule(smoothing=0.0, patience=30))
    assert kept == KeptWeights(
        samples=20, test_loss=2.0, validation_loss=-2.0, seen=50, ended=True
    )
    assert (
        kept_weights(curve(losses), StoppingRule(smoothing=0.0, patience=60)).samples
        == 70
    )
    # the training is over before the test at 50
    assert (
        kept_weights(curve(losses), StoppingRule(smoothing=0.0, patience=29)).seen == 40
    )


@pytest.mark.parametrize(
    ("most", "samples", "seen"),
    [(30, 20, 30), (31, 20, 30), (39, 20, 30), (40, 40, 40)],
)
def test_a_cap_takes_the_tests_until_it(most, samples, seen):
    kept = kept_weights(
        curve([3.0, 2.0, 2.5, 1.0, 0.5]), StoppingRule(smoothing=0.0, max_samples=most)
    )
    assert (kept.samples, kept.seen, kept.ended) == (samples, seen, True)


@pytest.mark.parametrize(("training_loss", "samples"), [(0.7, 10), (0.9, 80)])
def test_the_released_rule_waits_for_overfitting(training_loss, samples, monkeypatch):
    """The rule's 25,000 iterations are 3 here.

    Without overfitting it goes on to a lower loss.
    """
    monkeypatch.setattr("sidm.learning.stopping.RELEASED_PATIENCE", 3)
    losses = [1.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0, -30.0]
    rule = StoppingRule(stopping="released", samples_per_iteration=10)
    kept = kept_weights(
        curve(losses, [training_loss * loss for loss in losses[:-1]] + [1.0]), rule
    )
    assert kept.samples == samples and kept.ended == (samples == 10)


def test_nothing_is_kept_without_a_test():
    with pytest.raises(ValueError, match="without a test"):
        kept_weights(curve([]), StoppingRule())
    with pytest.raises(ValueError, match="without a test"):
        kept_after(curve([1.0]), [9])


@pytest.mark.parametrize("seed", range(3))
def test_lengths_keep_what_a_cap_keeps(seed):
    rng = np.random.default_rng(seed)
    run = curve(rng.uniform(1, 2, 40).round(1).tolist(), iteration=3)
    lengths = list(range(10, 420))
    kept = [kept_weights(run, StoppingRule(max_samples=length)) for length in lengths]
    assert kept_after(run, lengths) == kept


@pytest.mark.parametrize(
    "changes",
    [dict(patience=24 * 12), dict(patience=24 * 13), dict(max_samples=24 * 22)],
)
def test_a_rule_keeps_what_a_training_that_it_stopped_kept(
    datasets, small_network, small_training, changes
):
    """Samples, test loss and validation loss of the weights agree to the last digit."""
    common = dict(learning_rate=5e-3, max_samples=24 * 200, patience=24 * 200)
    settings = [
        dataclasses.replace(small_training, **common | more) for more in ({}, changes)
    ]
    long, short = (train(datasets, small_network, setting, 0) for setting in settings)
    history = long.history
    run = Curve(
        *(
            [getattr(test, name) for test in history]
            for name in ("samples", "training_loss", "test_loss", "validation_loss")
        ),
        iteration=24,
    )
    kept = kept_weights(run, StoppingRule(**changes))
    assert kept.samples == short.best_samples < long.best_samples
    assert kept.test_loss == short.best_test_loss
    assert kept.validation_loss == mean_loss(short.model, datasets.validation)
    assert kept.seen == short.history[-1].samples and kept.ended
    assert kept_weights(run, StoppingRule()).samples == long.best_samples
