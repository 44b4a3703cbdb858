"""Validation loss and rollouts against direct computation."""

import math

import pytest
import torch

from sidm import rotations
from sidm.learning import (
    DynamicsModel,
    encode_inputs,
    integrate,
    robot_centred_map,
    rollout,
    rollout_errors,
    validation_loss,
)
from sidm.learning.evaluation import EVALUATION_BATCH, mean_loss


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


def test_validation_loss_is_the_mean_square_by_component(model, make_motion):
    motion = make_motion(EVALUATION_BATCH + 3)
    losses = validation_loss(model, motion)
    with torch.no_grad():
        predicted, _ = model("novice", motion.inputs, motion.maps)
    expected = (predicted - motion.targets).double().square().mean((0, 1))
    assert losses.shape == (13,) and torch.allclose(losses, expected, rtol=1e-4)
    assert mean_loss(model, motion) == pytest.approx(float(losses.sum()), rel=1e-6)


def test_rollout_step_by_step(model, scene):
    heights, state, actions = scene
    predicted = rollout(model, heights, state, actions, 8)
    assert predicted.shape == (3, 6, 13) and predicted.dtype == torch.float32
    assert torch.equal(predicted[:, 0], state)
    now, memory = state.double(), None
    for k in range(5):
        inputs = encode_inputs(now, actions[:, k].double()).float()
        maps = robot_centred_map(heights, now, 8)
        with torch.no_grad():
            step, memory = model(
                "novice", inputs[:, None], maps.half()[:, None], memory
            )
        now = integrate(now, step[:, 0].double())
        assert torch.allclose(predicted[:, k + 1], now.float(), atol=1e-5)


def test_rollout_of_one_is_that_of_many(model, scene):
    heights, state, actions = scene
    together = rollout(model, heights, state, actions, 8, role="expert")
    alone = rollout(model, heights[1].numpy(), state[1], actions[1], 8, role="expert")
    assert alone.shape == (6, 13)
    # different rounding in float32 may give the next float16
    assert torch.allclose(alone, together[1], atol=1e-3)


def test_rollout_needs_no_gradient_and_can_be_learnt_from(model, scene):
    predicted = rollout(model, *scene, 8)
    assert not predicted.requires_grad and not predicted.is_inference()


def test_rollout_refuses_unlike_batches(model, scene):
    heights, state, actions = scene
    with pytest.raises(ValueError, match=r"\(3, 60, 60\), \(2, 13\) and \(3, 5, 2\)"):
        rollout(model, heights, state[:2], actions, 8)


def test_errors_of_a_known_deviation():
    actual = torch.zeros(2, 4, 13)
    actual[..., 6] = 1.0
    predicted = actual.clone()
    predicted[0, 2, :3] = torch.tensor([2.0, 3.0, 6.0])
    predicted[1, 3, 3:7] = rotations.from_yaw(torch.tensor(-0.5))
    position, heading = rollout_errors(predicted, actual)
    assert position.shape == heading.shape == (2, 3)
    assert position.tolist() == [[0.0, 7.0, 0.0], [0.0, 0.0, 0.0]]
    assert heading[1, 2].item() == pytest.approx(0.5, abs=1e-6)
    assert heading[0].abs().max() == 0


def test_heading_error_takes_the_short_way_round():
    states = torch.zeros(2, 2, 13)
    states[..., 3:7] = rotations.from_yaw(torch.tensor([[3.1, 3.1], [-3.1, -3.1]]))
    _, heading = rollout_errors(states[0], states[1])
    assert heading.item() == pytest.approx(2 * math.pi - 6.2, abs=1e-5)


def test_errors_refuse_unlike_shapes():
    with pytest.raises(ValueError, match=r"\(2, 4, 13\) and \(2, 5, 13\)"):
        rollout_errors(torch.zeros(2, 4, 13), torch.zeros(2, 5, 13))
