"""Least squares: the closed form, the cross-validation, and the fitted model."""

import numpy as np
import pytest
import torch

from ownrobot.methods import least_squares as ls
from ownrobot.methods import trivial
from sidm.body import ROVER
from sidm.learning import Standardisation, validation_loss
from sidm.learning.dataset import Datasets
from sidm.learning.evaluation import rollout


@pytest.fixture
def many(make_motion) -> Datasets:
    return Datasets(make_motion(30, 1), make_motion(10, 2), make_motion(8, 3))


def test_the_weights_and_the_loss_are_those_of_ridge_regression(rng):
    """NumPy's least squares with a row more for each penalty gives the same weights."""
    rows, left = rng.normal(size=(50, 4)), rng.normal(size=(50, 13))
    penalties = np.array([0.0, 0.1, 0.1, 2.0])
    made = ls.normal_equations(torch.from_numpy(rows), torch.from_numpy(left))
    weights = made.solve(torch.from_numpy(penalties))
    more = (
        np.vstack([rows, np.diag(np.sqrt(50 * penalties))]),
        np.vstack([left, np.zeros((4, 13))]),
    )
    expected = np.linalg.lstsq(*more, rcond=None)[0]
    assert np.allclose(weights.numpy(), expected, atol=1e-10)
    loss = np.square(left - rows @ expected).sum(1).mean()
    assert made.loss(weights) == pytest.approx(loss)
    both = made.plus(made)
    assert both.steps == 100
    assert both.without(made).loss(weights) == pytest.approx(loss)


def test_a_linear_law_is_found(many):
    """The rest of the loss is the maps' part, which the method does not use."""
    units = Standardisation.none()
    fitted = ls.fit(many, units)
    loss = validation_loss(fitted.model, many.validation)
    spread = many.validation.targets.var((0, 1))
    assert float(loss.sum()) < 0.01 * float(spread.sum())
    assert fitted.best_test_loss == pytest.approx(float(loss.sum()), rel=0.5)
    far, edge = torch.full((1, 1, 11), 1e9), fitted.model.high[None, None]
    maps = many.train.maps[:1, :1]  # what was never seen is held at the edge
    assert torch.equal(*(fitted.model("novice", x, maps)[0] for x in (far, edge)))


def test_the_cross_validated_loss_is_of_steps_that_were_not_seen(many, monkeypatch):
    """Each fold is tested by hand; penalties that drown the law are not taken."""
    monkeypatch.setattr(ls, "PENALTIES", (1e6, 0.1))
    monkeypatch.setattr(ls, "PRODUCT_PENALTIES", (10.0,))
    fitted = ls.fit(many, Standardisation.none())
    inputs, targets = (
        torch.cat([getattr(windows, name) for windows in many[:2]]).double()
        for name in ("inputs", "targets")
    )
    functions, total = fitted.model.functions(inputs), 0.0
    for fold in range(ls.FOLDS):
        out = torch.arange(len(inputs)) % ls.FOLDS == fold
        weights = ls.normal_equations(functions[~out], targets[~out]).solve(
            fitted.model.penalties(0.1, 10.0)
        )
        total += float((targets[out] - functions[out] @ weights).square().sum())
    assert fitted.best_test_loss == pytest.approx(total / (40 * 6))


def test_yardsticks_predict_no_change_and_the_mean_of_the_training_data(datasets):
    still = trivial.learn(datasets, ROVER, "nothing_changes").model
    state = torch.tensor([1.0, 2.0, 3.0, 0.0, 0.0, 0.6, 0.8, *range(6)]).double()
    path = rollout(still, torch.zeros(9, 9), state, torch.ones(5, 2), 8)
    assert torch.allclose(path, state.expand(6, -1))
    trained = trivial.learn(datasets, ROVER, "mean", torch.ones(13))
    targets, mean = datasets.test.targets, datasets.train.targets.mean((0, 1))
    assert torch.allclose(trained.model("novice", targets, None)[0], mean)
    loss = (targets - mean).square().sum(-1).mean()
    assert trained.best_test_loss == pytest.approx(float(loss))
