"""Predicted distributions against SciPy, against their samples, and in training."""

import dataclasses
import math

import numpy as np
import pytest
import torch
from scipy import stats

from companion.beyond.distributions import (
    INITIAL_LOG_STD,
    MAX_LOG_STD,
    MIN_LOG_STD,
    ConstantSpread,
    DistributionModel,
    Gaussian,
    StdHead,
)
from companion.beyond.likelihood import mean_nll, train_distributions
from companion.beyond.particles import (
    central_interval,
    one_step,
    particle_rollout,
    path_coverage,
)
from sidm import rotations
from sidm.config import ConfigError
from sidm.learning import DynamicsModel, Standardisation
from sidm.settings import Training

HERE = torch.tensor([0, 0, 0.2, 0, 0, 0, 1, *[0] * 6], dtype=torch.float64)


@pytest.fixture
def model(small_network):
    return DistributionModel(small_network, seed=1).eval()


def test_likelihood_is_scipys(generator):
    mean, std, values = torch.randn(5, 13), torch.rand(5, 13) + 0.1, torch.randn(5, 13)
    expected = -stats.norm.logpdf(values.numpy(), mean.numpy(), std.numpy()).sum(-1)
    assert Gaussian(mean, std).nll(values).numpy() == pytest.approx(expected, rel=1e-5)


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


def test_latents_begin_quiet_and_stay_within_bounds():
    spread, mean = StdHead(2), torch.tensor([1.0, -2.0])
    predicted = spread(mean)
    assert predicted.mean is mean
    assert predicted.std.tolist() == pytest.approx([math.exp(INITIAL_LOG_STD)] * 2)
    torch.nn.init.constant_(spread.dense.bias, 1e9)
    assert spread(mean).std.tolist() == pytest.approx([math.exp(MAX_LOG_STD)] * 2)
    torch.nn.init.constant_(spread.dense.bias, -1e9)
    assert spread(mean).std.tolist() == pytest.approx([math.exp(MIN_LOG_STD)] * 2)


def test_means_begin_as_the_deterministic_twins(small_network, make_motion):
    """Without random draws the two models predict the same."""
    motion, units = make_motion(2), Standardisation.none()
    probabilistic, twin = (
        build(small_network, units, 3).eval()
        for build in (DistributionModel, DynamicsModel)
    )
    for role in ("novice", "expert"):
        means, values = (
            model(role, motion.inputs, motion.maps)[0]
            for model in (probabilistic, twin)
        )
        assert torch.allclose(means, values, atol=1e-6)


def test_without_a_generator_a_prediction_is_repeated(model, make_motion, generator):
    motion = make_motion(2)
    first, memory = model("novice", motion.inputs, motion.maps)
    predicted, _ = model.predict("novice", motion.inputs, motion.maps)
    assert torch.equal(first, predicted.mean)
    assert first.shape == (2, 6, 13)
    assert memory[0].shape[1] == 2
    drawn, _ = model.predict("novice", motion.inputs, motion.maps, None, generator)
    assert not torch.equal(drawn.mean, predicted.mean) and (drawn.std > 0).all()


def test_units_are_those_of_the_data(small_network, make_motion):
    """A decoder's spread grows with the units of its targets."""
    motion = make_motion(4)
    wide = Standardisation.none()._replace(target_std=torch.full((13,), 100.0))
    plain, scaled = (
        DistributionModel(small_network, units, seed=1) for units in (None, wide)
    )
    one, hundred = (
        m.predict("novice", motion.inputs, motion.maps)[0] for m in (plain, scaled)
    )
    assert torch.allclose(hundred.std, 100 * one.std)


def test_training_finds_how_noisy_the_data_are(small_network, make_motion, datasets):
    """Learnt deviations match noise of 0.3 and 0.03, and a second run is the same."""
    noisy = []
    for number, motion in enumerate((datasets.train, datasets.test)):
        noise = torch.randn(
            motion.targets.shape, generator=torch.Generator().manual_seed(number)
        )
        scale = torch.full((13,), 0.1)
        scale[0], scale[1] = 0.3, 0.03
        noisy.append(type(motion)(motion.inputs, noise * scale, motion.maps))
    sets = datasets._replace(train=noisy[0], test=noisy[1])
    training = Training(
        p_expert=0.0,
        regularise=False,
        batch=6,
        prediction_iterations=20,
        test_interval=10,
        max_samples=36 * 300,
        learning_rate=3e-3,
    )
    runs = [
        train_distributions(sets, small_network, training, 0, Standardisation.none())
        for _ in range(2)
    ]
    tests = [test.test_loss for test in runs[0].history]
    assert min(tests) < tests[0] - 1 and runs[0].history == runs[1].history
    predicted, _ = runs[0].model.predict("novice", noisy[1].inputs, noisy[1].maps)
    first, second = predicted.std.mean((0, 1))[:2].tolist()
    assert 0.15 < first < 0.5 and second < 0.5 * first
    assert mean_nll(runs[0].model, noisy[1]) == pytest.approx(min(tests), abs=1.0)


def test_the_whole_method_trains(datasets, small_network, small_training):
    """Both algorithms run on data of both systems; the best test likelihood is kept."""
    trained = train_distributions(
        datasets, small_network, small_training, 0, Standardisation.none()
    )
    assert trained.iterations == 12 and len(trained.history) == 3
    assert trained.history[-1].discriminator_accuracy is not None


def test_the_weights_of_the_lowest_test_likelihood_are_kept(
    datasets, small_network, small_training
):
    """The last weights are not kept: a large learning rate has spoilt them."""
    training = dataclasses.replace(
        small_training,
        smoothing=0.0,
        learning_rate=0.1,
        regularise=False,
        max_samples=24 * 80,
        patience=24 * 20,
    )
    trained = train_distributions(
        datasets, small_network, training, 0, Standardisation.none()
    )
    tests = [tested.test_loss for tested in trained.history]
    assert min(tests) < tests[-1]
    assert mean_nll(trained.model, datasets.test) == pytest.approx(min(tests), rel=1e-4)


@pytest.mark.parametrize(
    "changes",
    [{"precision": "bfloat16"}, {"reduction": "mean"}, {"stopping": "released"}],
)
def test_settings_that_a_likelihood_does_not_know_are_refused(
    datasets, small_network, changes
):
    with pytest.raises(
        ConfigError, match=f"training by likelihood has no {next(iter(changes))}="
    ):
        train_distributions(
            datasets, small_network, Training(**changes), 0, Standardisation.none()
        )


class Known:
    """A model that predicts a normal distribution about 0."""

    def __init__(self, std: float) -> None:
        self.std = std

    def predict(self, role, inputs, maps, memory, generator):
        shape = (*inputs.shape[:2], 13)
        return Gaussian(torch.zeros(shape), torch.full(shape, self.std)), memory


@pytest.mark.parametrize(
    ("said", "half", "most"),
    [(1.0, 0.5, 0.9), (2.0, 0.8227, 0.9990), (0.5, 0.2641, 0.5890)],
)
def test_coverage_is_that_of_the_normal_distribution(
    make_motion, generator, said, half, most
):
    """Models predict the deviation of standard normal targets, its double and half."""
    motion = make_motion(40)
    motion = type(motion)(
        motion.inputs, torch.randn(40, 6, 13, generator=generator), motion.maps
    )
    scores = one_step(Known(said), motion, generator)
    assert [np.mean(level) for level in scores.coverage] == pytest.approx(
        [half, most], abs=0.03
    )
    assert [len(level) for level in scores.coverage] == [13, 13]
    expected = -stats.norm.logpdf(motion.targets.numpy(), 0, said).sum(-1)
    assert (
        scores.nll
        == pytest.approx(expected.mean(), rel=1e-4)
        == sum(scores.component_nll)
    )
    assert scores.nll_quantiles == pytest.approx(
        np.quantile(expected, [0.5, 0.9, 0.99, 1]), rel=1e-4
    )
    assert scores.spread == pytest.approx((said,) * 13)


def test_the_twin_is_as_unsure_everywhere(small_network, make_motion, generator):
    twin, motion = DynamicsModel(small_network).eval(), make_motion(2)
    spread = ConstantSpread(twin, torch.full((13,), 0.2))
    predicted, _ = spread.predict("novice", motion.inputs, motion.maps, None, generator)
    assert torch.equal(predicted.mean, twin("novice", motion.inputs, motion.maps)[0])
    assert (predicted.std == 0.2).all()


def test_particles_spread_and_cover_one_of_theirs(model, small_network, generator):
    """Particles start together and part.

    A path of the same model lies within their intervals as often as it should.
    """
    heights, actions = torch.zeros(61, 61, dtype=torch.float64), torch.zeros(4, 2)
    inside = []
    for _ in range(150):
        paths = particle_rollout(
            model, heights, HERE, actions, small_network.pixels, 20, generator
        )
        assert paths.shape == (20, 5, 13)
        assert torch.equal(paths[:, 0], HERE.expand(20, -1))
        inside.append(path_coverage(paths[1:], paths[0]).inside)
    spread = paths[:, :, 0].std(0)
    assert spread[0] == 0 and spread[1] > 0
    half, most = torch.stack(inside).double().mean((0, 2, 3)).tolist()
    assert half == pytest.approx(0.5, abs=0.1) and most == pytest.approx(0.9, abs=0.06)


@pytest.mark.parametrize("count", [19, 64])
def test_intervals_of_few_particles_are_as_wide_as_they_say(count, generator):
    """Intervals of independent samples of one distribution, for any number of them."""
    draws = torch.randn(4000, count + 1, generator=generator, dtype=torch.float64)
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
    for turn, expected in (
        (math.pi + 0.02, True),
        (-math.pi + 0.05, True),
        (math.pi - 0.6, False),
    ):
        actual = start.repeat(2, 1)
        actual[1, 3:7] = rotations.from_yaw(torch.tensor(turn, dtype=torch.float64))
        assert path_coverage(paths, actual).inside[1, 0, 2].item() == expected


def test_intervals_are_seen_from_the_start():
    """Errors are in the frame of the start.

    Ten particles drive 0 to 0.9 m along y from a start that heads along y: that is
    forward, and no particle moves sideways.
    """
    start = HERE.clone()
    start[3:7] = torch.tensor([0, 0, math.sin(math.pi / 4), math.cos(math.pi / 4)])
    paths = start.repeat(10, 2, 1)
    paths[:, 1, 1] = torch.arange(10) / 10
    for y, expected in (
        (0.45, [True, True]),
        (0.1, [False, True]),
        (1.2, [False, False]),
    ):
        actual = start.repeat(2, 1)
        actual[1, 1] = y
        covered = path_coverage(paths, actual)
        forward, _, _ = covered.inside[:, 0].T.tolist()
        assert forward == expected
        assert covered.error[0].tolist() == pytest.approx(
            [abs(y - 0.45), 0, 0], abs=1e-6
        )
        assert 0 < covered.width[0, 0, 0] < covered.width[1, 0, 0] <= 0.9
        assert covered.width[:, 0, 1:].abs().max() < 1e-6
    assert np.isfinite(paths.numpy()).all()
