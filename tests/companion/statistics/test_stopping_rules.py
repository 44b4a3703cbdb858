"""What stopping rules keep of made-up curves, and of trainings that they stopped."""

import dataclasses

import numpy as np
import pytest

from companion.statistics.stopping_rules import (
    Curve,
    KeptWeights,
    StoppingRule,
    kept_after,
    kept_weights,
)
from sidm.learning import train
from sidm.learning.evaluation import mean_loss


def curve(test_losses, training_losses=None, iteration=1) -> Curve:
    training = training_losses or [1.0] * len(test_losses)
    samples = [10 * (k + 1) for k in range(len(test_losses))]
    validation = [-loss for loss in test_losses]
    return Curve(samples, training, test_losses, validation, iteration)


def test_the_end_keeps_the_lowest_smoothed_loss():
    # smoothed 4, 3, 3.25, 1.875, 3.9375
    kept = kept_weights(curve([4.0, 2.0, 3.5, 0.5, 6.0]), StoppingRule())
    assert kept == KeptWeights(
        samples=40, test_loss=1.875, validation_loss=-0.5, seen=50, ended=False
    )


@pytest.mark.parametrize(
    ("limit", "samples", "seen"),
    [
        ({"patience": 30}, 20, 50),
        ({"patience": 29}, 20, 40),  # over before the test at 50
        ({"patience": 0}, 20, 30),  # that of one test
        ({"patience": 60}, 70, 70),
        ({"max_samples": 30}, 20, 30),
        ({"max_samples": 39}, 20, 30),
        ({"max_samples": 70}, 70, 70),
    ],
)
def test_patience_or_a_cap_ends_before_a_second_descent(limit, samples, seen):
    losses = [3.0, 2.0, 2.5, 2.5, 2.5, 2.5, 1.0]
    kept = kept_weights(curve(losses), StoppingRule(smoothing=0.0, **limit))
    assert (kept.samples, kept.seen) == (samples, seen)
    assert kept.ended == (limit != {"patience": 60})


def test_lengths_keep_what_a_cap_keeps_and_nothing_without_a_test():
    losses = np.random.default_rng(0).uniform(1, 2, 40).round(1).tolist()
    run, lengths = curve(losses, iteration=3), list(range(10, 420))
    rules = [StoppingRule(max_samples=length) for length in lengths]
    kept = [run.samples[test] for test in kept_after(run, lengths)]
    assert kept == [kept_weights(run, rule).samples for rule in rules]
    with pytest.raises(ValueError, match="without a test"):
        kept_weights(curve([]), StoppingRule())
    with pytest.raises(ValueError, match="without a test"):
        kept_after(curve([1.0]), [9])


def test_a_rule_keeps_what_a_training_that_it_stopped_kept(
    datasets, small_network, small_training
):
    """Samples, test loss and validation loss of the weights agree to the last digit."""

    def run(**changes):
        limits = dict(max_samples=24 * 200, patience=24 * 200) | changes
        training = dataclasses.replace(small_training, learning_rate=5e-3, **limits)
        return train(datasets, small_network, training, 0)

    long = run()
    names = ("samples", "training_loss", "test_loss", "validation_loss")
    columns = ([getattr(test, name) for test in long.history] for name in names)
    curve = Curve(*columns, iteration=24)
    for changes in (dict(patience=24 * 13), dict(max_samples=24 * 22)):
        short, kept = run(**changes), kept_weights(curve, StoppingRule(**changes))
        assert kept.samples == short.best_samples < long.best_samples
        assert kept.test_loss == short.best_test_loss
        assert kept.validation_loss == mean_loss(short.model, datasets.validation)
        assert kept.seen == short.history[-1].samples and kept.ended
