"""Least squares: the closed form, the cross-validation, and the fitted model."""

import numpy as np
import pytest
import torch

from companion.beyond.mirror import INPUT_SIGNS, TARGET_SIGNS, mirror_image
from ownrobot.methods import least_squares as ls
from sidm.learning import DynamicsModel, Standardisation, validation_loss
from sidm.learning.dataset import Datasets, Windows
from sidm.learning.evaluation import rollout


@pytest.fixture
def base(small_network, datasets) -> DynamicsModel:
    """An expert's model that has learnt nothing."""
    units = Standardisation.fit(datasets.expert)
    return (
        DynamicsModel(small_network, units, roles=["novice"])
        .eval()
        .requires_grad_(False)
    )


@pytest.fixture
def many(make_motion) -> Datasets:
    """Enough motion of a law that is linear in the inputs to learn the law."""
    return Datasets(make_motion(30, 1), make_motion(10, 2), make_motion(8, 3))


@pytest.fixture
def made(rng) -> ls.NormalEquations:
    """Made-up data of 50 steps, 4 functions and the 13 components."""
    rows, left = (torch.from_numpy(rng.normal(size=(50, size))) for size in (4, 13))
    return ls.normal_equations(rows, left)


def test_the_weights_are_those_of_ridge_regression(rng):
    """NumPy's least squares with a row more for each penalty gives the same weights."""
    rows = rng.normal(size=(50, 4))
    left = rng.normal(size=(50, 13))
    penalties = np.array([0.0, 0.1, 0.1, 2.0])
    weights = ls.normal_equations(torch.from_numpy(rows), torch.from_numpy(left)).solve(
        torch.from_numpy(penalties)
    )
    more = (
        np.vstack([rows, np.diag(np.sqrt(50 * penalties))]),
        np.vstack([left, np.zeros((4, 13))]),
    )
    assert np.allclose(
        weights.numpy(), np.linalg.lstsq(*more, rcond=None)[0], atol=1e-10
    )


def test_normal_equations_know_the_loss(rng, made):
    rows, left = (torch.from_numpy(rng.normal(size=(20, size))) for size in (4, 13))
    weights = torch.from_numpy(rng.normal(size=(4, 13)))
    other = ls.normal_equations(rows, left)
    assert other.loss(weights) == pytest.approx(
        float((left - rows @ weights).square().sum(-1).mean())
    )
    both = made.plus(other)
    assert both.steps == 70
    assert both.without(other).loss(weights) == pytest.approx(made.loss(weights))


def test_a_linear_law_is_found(many):
    """The rest of the loss is the maps' part, which the method does not use."""
    units = Standardisation.none()
    fitted = ls.fit(many, units)
    loss = validation_loss(fitted.model, many.validation)
    spread = many.validation.targets.var((0, 1))
    assert float(loss.sum()) < 0.01 * float(spread.sum())
    assert fitted.best_test_loss == pytest.approx(float(loss.sum()), rel=0.5)
    assert fitted.samples == 40 * 6 and fitted.iterations == 0


def test_the_cross_validated_loss_is_of_steps_that_were_not_seen(many, monkeypatch):
    """One pair of penalties is fitted by hand without each fold, and tested on it."""
    monkeypatch.setattr(ls, "PENALTIES", (0.1,))
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


def test_the_lowest_is_taken(many, monkeypatch):
    """Some penalties drown the law, and one does not."""
    lowest = {}
    for grid in ((1e6,), (1e-4,), (1e6, 1e-4)):
        monkeypatch.setattr(ls, "PENALTIES", grid)
        lowest[grid] = ls.fit(many, Standardisation.none()).best_test_loss
    assert lowest[(1e6, 1e-4)] == lowest[(1e-4,)] < 0.1 * lowest[(1e6,)]


def test_a_correction_is_added_to_the_base(datasets, base):
    """The correction is zero at first; then it explains what the base leaves."""
    units, seen = Standardisation.fit(datasets.expert), datasets.train
    model = ls.LeastSquares(units, base)
    predicted, memory = base("novice", seen.inputs, seen.maps)
    found, carried = model("novice", seen.inputs, seen.maps)
    assert torch.equal(found, predicted) and all(map(torch.equal, memory, carried))
    fitted = ls.fit(datasets, units, base).model
    alone, corrected = (
        float(validation_loss(one, datasets.train).sum()) for one in (base, fitted)
    )
    assert corrected < 0.2 * alone
    assert all(
        torch.equal(tensor, base.state_dict()[name])
        for name, tensor in fitted.base.state_dict().items()
    )


def test_with_mirror_images_left_and_right_are_alike(many):
    """The symmetry is exact in symmetric units; without mirror images it is not."""
    inputs, maps = many.validation.inputs, many.validation.maps
    signs = torch.tensor(INPUT_SIGNS), torch.tensor(TARGET_SIGNS)
    gaps = []
    for image in (mirror_image, None):
        fitted = ls.fit(many, Standardisation.none(), image=image).model
        seen, turned = (
            fitted("novice", one, maps)[0] for one in (inputs, inputs * signs[0])
        )
        gaps.append(float((turned - seen * signs[1]).abs().max()))
    assert gaps[0] < 1e-4 < 1e-2 < gaps[1]


def test_what_was_never_seen_is_held_at_the_edge(datasets):
    fitted = ls.fit(datasets, Standardisation.none()).model
    far = torch.full((1, 1, 11), 1e9)
    edge = fitted.high[None, None]
    maps = datasets.train.maps[:1, :1]
    assert torch.equal(fitted("novice", far, maps)[0], fitted("novice", edge, maps)[0])


def test_two_trajectories_are_enough(make_motion):
    """A dataset has at least two: one for training and one for testing."""
    fitted = ls.fit(
        Datasets(make_motion(1, 1), make_motion(1, 2), make_motion(2, 3)),
        Standardisation.none(),
    )
    assert np.isfinite(fitted.best_test_loss)


@pytest.mark.parametrize("alone", [True, False])
def test_it_rolls_out(datasets, base, alone):
    """Rollouts work with and without a memory, until a number is infinite."""
    fitted = ls.fit(
        datasets, Standardisation.fit(datasets.expert), None if alone else base
    ).model
    state = torch.tensor(
        [0, 0, 0.2, 0, 0, 0, 1, 0.5, 0, 0, 0, 0, 0], dtype=torch.float64
    )
    path = rollout(
        fitted, torch.zeros(81, 81), state, torch.full((25, 2), 0.5), pixels=8
    )
    assert path.shape == (26, 13) and torch.isfinite(path).all()


def test_parts_give_what_the_whole_does(many):
    """Data that lie in a larger set are taken from it."""
    whole = Windows(
        *(
            torch.cat([getattr(windows, name) for windows in many[:2]])
            for name in ("inputs", "targets", "maps")
        )
    )
    parts = many._replace(
        train=whole.subset(range(30)), test=whole.subset(range(30, 40))
    )
    first, second = (
        ls.fit(one, Standardisation.none()).model.weights for one in (many, parts)
    )
    assert torch.equal(first, second)
