"""Validation loss and rollouts against direct computation."""

import math

import pytest
import torch

from sidm import rotations
from sidm.learning import DynamicsModel, evaluation, observation
from sidm.learning.evaluation import rollout, rollout_errors


@pytest.fixture
def model(small_network):
    return DynamicsModel(small_network, seed=3)


@pytest.fixture
def scene(generator):
    """Terrains (3, 60, 60), states (3, 13) and actions (3, 5, 2)."""
    heights = 0.1 * torch.randn(3, 60, 60, dtype=torch.float64, generator=generator)
    states = torch.randn(3, 13, generator=generator)
    states[:, 3:7] = rotations.normalise(states[:, 3:7])
    return heights, states, torch.rand(3, 5, 2, generator=generator) * 2 - 1


@torch.no_grad()
def test_validation_loss_is_the_mean_square_by_component(model, make_motion):
    motion = make_motion(evaluation.EVALUATION_BATCH + 3)
    losses = evaluation.validation_loss(model, motion)
    predicted, _ = model("novice", motion.inputs, motion.maps)
    squares = (predicted - motion.targets).double().square()
    assert torch.allclose(losses, squares.mean((0, 1)), rtol=1e-4)
    assert evaluation.mean_loss(model, motion) == pytest.approx(
        float(losses.sum()), rel=1e-6
    )
    by_window = squares.sum(2).mean(1)
    assert torch.allclose(evaluation.window_losses(model, motion), by_window, rtol=1e-4)


def test_rollout_step_by_step(model, scene):
    heights, state, actions = scene
    predicted = rollout(model, heights, state, actions, 8, role="expert")
    assert predicted.shape == (3, 6, 13) and predicted.dtype == torch.float32
    assert not predicted.requires_grad and not predicted.is_inference()
    assert torch.equal(predicted[:, 0], state)
    now, memory = state.double(), None
    for k in range(5):
        inputs = observation.encode_inputs(now, actions[:, k].double()).float()
        maps = observation.robot_centred_map(heights, now, 8).half()
        with torch.no_grad():
            step, memory = model("expert", inputs[:, None], maps[:, None], memory)
        now = observation.integrate(now, step[:, 0].double())
        assert torch.allclose(predicted[:, k + 1], now.float(), atol=1e-5)
    alone = rollout(model, heights[1].numpy(), state[1], actions[1], 8, role="expert")
    # different rounding in float32 may give the next float16
    assert torch.allclose(alone, predicted[1], atol=1e-3)
    with pytest.raises(ValueError, match=r"\(3, 60, 60\), \(2, 13\) and \(3, 5, 2\)"):
        rollout(model, heights, state[:2], actions, 8)


def test_errors_of_a_known_deviation_take_the_short_way_round():
    actual, angles = torch.zeros(2, 4, 13), torch.tensor([[3.1], [0.0]]).expand(2, 4)
    actual[..., 3:7] = rotations.from_yaw(angles)
    predicted = actual.clone()
    predicted[0, 2, :3] = torch.tensor([2.0, 3.0, 6.0])
    predicted[0, 1, 3:7] = rotations.from_yaw(torch.tensor(-3.1))
    predicted[1, 3, 3:7] = rotations.from_yaw(torch.tensor(-0.5))
    position, heading = rollout_errors(predicted, actual)
    assert position.tolist() == [[0.0, 7.0, 0.0], [0.0, 0.0, 0.0]]
    expected = [2 * math.pi - 6.2, 0, 0, 0, 0, 0.5]
    assert heading.flatten().tolist() == pytest.approx(expected, abs=1e-6)
    with pytest.raises(ValueError, match=r"\(2, 4, 13\) and \(2, 3, 13\)"):
        rollout_errors(predicted, actual[:, 1:])
