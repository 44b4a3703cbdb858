"""The two stopping rules on made-up test losses."""

import pytest

from sidm.learning.stopping import RELEASED_PATIENCE, Stopper


def feed(stopper: Stopper, test_losses, training_loss: float = 1.0, step: int = 10) -> list[bool]:
    """Which tests, `step` samples and one iteration apart, were new minima."""
    return [stopper.update(step * k, k, training_loss, loss) for k, loss in enumerate(test_losses, start=1)]


def test_smoothing_by_hand():
    stopper = Stopper("test_loss", 0.5, 100, 1000)
    assert feed(stopper, [4.0, 2.0, 3.5]) == [True, True, False]  # smoothed 4, 3, 3.25
    assert stopper.test_loss == 3.25 and stopper.best == 3.0 and stopper.best_samples == 20


def test_stops_when_patience_is_over():
    stopper = Stopper("test_loss", 0.0, 30, 1000)
    feed(stopper, [2.0, 1.0, 1.5, 1.5])
    assert not stopper.finished(40, 4) and not stopper.finished(49, 4)
    assert stopper.finished(50, 5)


def test_an_equal_loss_is_no_improvement():
    assert feed(Stopper("test_loss", 0.0, 30, 1000), [2.0, 2.0]) == [True, False]


def test_cap_holds_before_any_test():
    stopper = Stopper("test_loss", 0.5, 10, 100)
    assert not stopper.finished(99, 3) and stopper.finished(100, 3)


def test_a_loss_that_is_not_a_number_is_never_best():
    stopper = Stopper("test_loss", 0.0, 30, 1000)
    assert feed(stopper, [2.0, float("nan"), float("nan")]) == [True, False, False]
    assert stopper.best == 2.0 and stopper.finished(50, 5)


@pytest.mark.parametrize(("training_loss", "ends"), [(0.7, True), (0.9, False)])
def test_released_rule_waits_for_overfitting(training_loss, ends):
    stopper = Stopper("released", 0.0, 1, 10**9)
    stopper.update(1, 1, training_loss, 1.0)
    stopper.update(2, 2, training_loss, 1.0)
    assert not stopper.finished(10**6, RELEASED_PATIENCE)
    assert stopper.finished(10**6, RELEASED_PATIENCE + 1) is ends


def test_released_rule_smooths_by_nine_tenths():
    stopper = Stopper("released", 0.0, 1, 10**9)
    feed(stopper, [1.0, 2.0])
    assert stopper.test_loss == pytest.approx(1.1)
