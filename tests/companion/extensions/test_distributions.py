"""Predicted distributions against SciPy, against their samples, and in training."""

import dataclasses
import math

import numpy as np
import pytest
import torch
from scipy import stats

from companion.extensions.distributions import (
    ConstantSpread,
    DistributionModel,
    Gaussian,
    mean_nll,
    train_distributions,
)
from companion.extensions.particles import (
    central_interval,
    one_step,
    particle_rollout,
    path_coverage,
)
from sidm import rotations
from sidm.config import ConfigError
from sidm.learning import DynamicsModel, Standardisation, Windows
from sidm.settings import Training

HERE = torch.tensor([0, 0, 0.2, 0, 0, 0, 1, *[0] * 6], dtype=torch.float64)


def test_draws_have_the_mean_and_spread_and_pass_gradients_on(generator):
    mean = torch.full((20000,), 2.0, requires_grad=True)
    std = torch.full((20000,), 0.5, requires_grad=True)
    drawn = Gaussian(mean, std).sample(generator)
    assert drawn.mean().item() == pytest.approx(2, abs=0.02)
    assert drawn.std().item() == pytest.approx(0.5, abs=0.02)
    drawn.sum().backward()
    assert torch.equal(mean.grad, torch.ones(20000))
    assert float(std.grad.mean()) == pytest.approx(0, abs=0.03)
    assert Gaussian(mean, std).sample(None) is mean


def test_training_finds_how_noisy_the_data_are(small_network, datasets):
    """Learnt deviations match noise of 0.3 and 0.03, and a second run is the same."""
    scale = torch.tensor([0.3, 0.03, *[0.1] * 11])

    def with_noise(motion, seed):
        drawn = torch.Generator().manual_seed(seed)
        noise = torch.randn(motion.targets.shape, generator=drawn)
        return Windows(motion.inputs, noise * scale, motion.maps)

    test = with_noise(datasets.test, 1)
    sets = datasets._replace(train=with_noise(datasets.train, 0), test=test)
    training = Training(
        p_expert=0.0,
        regularise=False,
        batch=6,
        prediction_iterations=20,
        test_interval=10,
        max_samples=36 * 300,
        learning_rate=3e-3,
    )
    one, two = (
        train_distributions(sets, small_network, training, 0, Standardisation.none())
        for _ in range(2)
    )
    tests = [tested.test_loss for tested in one.history]
    assert min(tests) < tests[0] - 1 and one.history == two.history
    predicted, _ = one.model.predict("novice", test.inputs, test.maps)
    first, second = predicted.std.mean((0, 1))[:2].tolist()
    assert 0.15 < first < 0.5 and second < 0.5 * first
    assert mean_nll(one.model, test) == pytest.approx(min(tests), abs=1.0)


def test_the_whole_method_trains_and_keeps_its_best_weights(
    datasets, small_network, small_training
):
    limits = {"max_samples": 24 * 80, "patience": 24 * 20}
    training = dataclasses.replace(
        small_training, smoothing=0.0, learning_rate=0.1, **limits
    )
    trained = train_distributions(
        datasets, small_network, training, 0, Standardisation.none()
    )
    tests = [tested.test_loss for tested in trained.history]
    assert trained.history[-1].discriminator_accuracy is not None
    assert min(tests) < tests[-1]
    assert mean_nll(trained.model, datasets.test) == pytest.approx(min(tests), rel=1e-4)


def test_a_model_begins_as_its_twin_in_the_units_of_the_data(
    small_network, make_motion, generator
):
    motion, units = make_motion(2), Standardisation.none()
    wide = units._replace(target_std=torch.full((13,), 100.0))
    model, twin, scaled = (
        build(small_network, one, 3).eval()
        for build, one in (
            (DistributionModel, units),
            (DynamicsModel, units),
            (DistributionModel, wide),
        )
    )
    data = "novice", motion.inputs, motion.maps
    mean = twin(*data)[0]
    predicted, drawn = model.predict(*data)[0], model.predict(*data, None, generator)[0]
    assert torch.allclose(predicted.mean, mean, atol=1e-6)
    assert torch.equal(model(*data)[0], predicted.mean)
    assert not torch.equal(drawn.mean, predicted.mean) and (drawn.std > 0).all()
    assert torch.allclose(scaled.predict(*data)[0].std, 100 * predicted.std)
    constant = ConstantSpread(twin, torch.full((13,), 0.2)).predict(*data)[0]
    assert torch.equal(constant.mean, mean) and (constant.std == 0.2).all()


def test_settings_that_a_likelihood_does_not_know_are_refused(datasets, small_network):
    training, units = Training(stopping="released"), Standardisation.none()
    with pytest.raises(ConfigError, match="training by likelihood has no stopping="):
        train_distributions(datasets, small_network, training, 0, units)


class Known:
    """A model that predicts a normal distribution about 0."""

    def __init__(self, std: float) -> None:
        self.std = std

    def predict(self, role, inputs, maps, memory, generator):
        shape = (*inputs.shape[:2], 13)
        return Gaussian(torch.zeros(shape), torch.full(shape, self.std)), memory


@pytest.mark.parametrize(
    ("said", "half", "most"),
    [(1.0, 0.5, 0.9), (2.0, 0.8227, 0.9990)],
)
def test_coverage_is_that_of_the_normal_distribution(
    make_motion, generator, said, half, most
):
    """Models predict the deviation of standard normal targets, and its double."""
    motion, targets = make_motion(40), torch.randn(40, 6, 13, generator=generator)
    motion = Windows(motion.inputs, targets, motion.maps)
    scores = one_step(Known(said), motion, generator)
    assert [np.mean(level) for level in scores.coverage] == pytest.approx(
        [half, most], abs=0.03
    )
    expected = -stats.norm.logpdf(targets.numpy(), 0, said).sum(-1)
    assert scores.nll == pytest.approx(expected.mean(), rel=1e-4)
    assert sum(scores.component_nll) == pytest.approx(scores.nll, rel=1e-4)
    assert scores.nll_quantiles == pytest.approx(
        np.quantile(expected, [0.5, 0.9, 0.99, 1]), rel=1e-4
    )
    assert scores.spread == pytest.approx([said] * 13)


def test_particles_spread_from_one_state(small_network, generator):
    model = DistributionModel(small_network, seed=1).eval()
    heights, actions = torch.zeros(61, 61, dtype=torch.float64), torch.zeros(4, 2)
    paths = particle_rollout(
        model, heights, HERE, actions, small_network.pixels, 20, generator
    )
    assert paths.shape == (20, 5, 13) and torch.equal(paths[:, 0], HERE.expand(20, -1))
    assert (paths[:, 1:, 0].std(0) > 0).all()


def test_intervals_of_few_particles_are_as_wide_as_they_say(generator):
    """Intervals of 19 independent samples of one distribution hold a new sample."""
    draws = torch.randn(4000, 20, generator=generator, dtype=torch.float64)
    for level in (0.5, 0.9):
        low, high = central_interval(draws[:, 1:].T, level)
        inside = (low <= draws[:, 0]) & (draws[:, 0] <= high)
        assert inside.double().mean().item() == pytest.approx(level, abs=0.025)


def test_a_turn_past_half_a_circle_is_covered():
    """Particles are about 180 degrees; some are stored as just above -180 degrees."""
    start = HERE.clone()
    turns = math.pi + torch.linspace(-0.2, 0.2, 21, dtype=torch.float64)
    paths = start.repeat(21, 2, 1)
    paths[:, 1, 3:7] = rotations.from_yaw(rotations.wrap(turns))
    for turn, expected in ((-math.pi + 0.05, True), (math.pi - 0.6, False)):
        actual = start.repeat(2, 1)
        actual[1, 3:7] = rotations.from_yaw(torch.tensor(turn, dtype=torch.float64))
        assert path_coverage(paths, actual).inside[1, 0, 2].item() == expected


def test_intervals_are_seen_from_the_start():
    start = HERE.clone()
    start[3:7] = torch.tensor([0, 0, math.sin(math.pi / 4), math.cos(math.pi / 4)])
    paths = start.repeat(10, 2, 1)
    paths[:, 1, 1] = torch.arange(10) / 10
    for y, expected in {0.45: [True, True], 0.1: [False, True]}.items():
        actual = start.repeat(2, 1)
        actual[1, 1] = y
        covered = path_coverage(paths, actual)
        assert covered.inside[:, 0, 0].tolist() == expected
        error = [abs(y - 0.45), 0, 0]
        assert covered.error[0].tolist() == pytest.approx(error, abs=1e-6)
        assert 0 < covered.width[0, 0, 0] < covered.width[1, 0, 0] <= 0.9
        assert covered.width[:, 0, 1:].abs().max() < 1e-6
