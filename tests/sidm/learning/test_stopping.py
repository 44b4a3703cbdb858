"""The stopping rules on made-up test losses."""

import pytest

from sidm.learning.stopping import RELEASED_PATIENCE, EarlyStopping


def feed(stopper: EarlyStopping, test_losses) -> list[bool]:
    """Tests that were new minima; tests are 10 samples and one iteration apart."""
    return [
        stopper.update(10 * k, k, 1.0, loss)
        for k, loss in enumerate(test_losses, start=1)
    ]


@pytest.mark.parametrize("later", [1.5, 1.0, float("nan")])
def test_stops_when_patience_is_over(later):
    """An equal loss is no improvement, nor is one that is no number."""
    stopper = EarlyStopping("test_loss", 0.0, 30, 1000)
    assert feed(stopper, [2.0, 1.0, later, later]) == [True, True, False, False]
    assert stopper.best == 1.0 and not stopper.finished(49, 4)
    assert stopper.finished(50, 5)


@pytest.mark.parametrize(("training_loss", "ends"), [(0.7, True), (0.9, False)])
def test_released_rule_waits_for_overfitting(training_loss, ends):
    stopper = EarlyStopping("released", 0.0, 1, 10**9)
    for k, smoothed in ((1, 1.0), (2, 1.1)):
        stopper.update(k, k, k * training_loss, k)
        assert stopper.test_loss == pytest.approx(smoothed)
    assert not stopper.finished(10**6, RELEASED_PATIENCE)
    assert stopper.finished(10**6, RELEASED_PATIENCE + 1) is ends
