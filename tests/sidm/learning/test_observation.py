"""Inputs, targets and rollouts of the networks against closed forms and SciPy."""

import math

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from sidm import rotations
from sidm.learning import DynamicsModel, evaluation
from sidm.learning.evaluation import rollout, rollout_errors
from sidm.learning.observation import (
    encode_inputs,
    integrate,
    robot_centred_map,
    transition,
)
from sidm.terrain import generate_terrain, height_at


def random_states(count: int, seed: int = 0, spread: float = 1.0) -> torch.Tensor:
    """States (count, 13), float64."""
    rng = np.random.default_rng(seed)
    position = rng.normal(0, spread, (count, 3))
    quaternion = Rotation.random(count, random_state=seed).as_quat()
    twist = rng.normal(size=(count, 6))
    return torch.from_numpy(np.hstack([position, quaternion, twist]))


def at(x=0.0, y=0.0, yaw=0.0) -> torch.Tensor:
    """State (13,) of a robot at rest."""
    turn = rotations.from_yaw(torch.tensor(yaw, dtype=torch.float64))
    place = turn.new_tensor([x, y, 0.0])
    return torch.cat([place, turn, turn.new_zeros(6)])


def test_inputs_are_scipys_up_direction_the_twist_and_the_action(generator):
    states = random_states(20)
    actions = torch.rand(20, 2, dtype=torch.float64, generator=generator)
    up = Rotation.from_quat(states[:, 3:7].numpy()).inv().apply([0, 0, 1])
    expected = torch.cat([torch.from_numpy(up), states[:, 7:], actions], dim=1)
    assert torch.allclose(encode_inputs(states, actions), expected)


def test_transitions_are_scipys():
    before, after = random_states(30, 1), random_states(30, 2)
    y = transition(before, after)
    first, second = (Rotation.from_quat(s[:, 3:7].numpy()) for s in (before, after))
    assert np.allclose(y[:, :3], first.inv().apply((after - before)[:, :3].numpy()))
    assert np.allclose(y[:, 3:7], (first.inv() * second).as_quat(canonical=True))


def test_maps_are_the_surface_that_the_wheels_touch(small_terrain):
    heights = np.stack([generate_terrain(small_terrain, seed) for seed in range(3)])
    states = random_states(6, 5, spread=1.5).reshape(3, 2, 13)
    together = robot_centred_map(heights, states, 16, size=5.0)
    offset = ((np.arange(16) + 0.5) / 16 - 0.5) * 5.0
    forward, left = offset[None, :], offset[:, None]
    for ground, some, maps in zip(heights, states.numpy(), together, strict=True):
        for state, found in zip(some, maps, strict=True):
            heading = Rotation.from_quat(state[3:7]).as_euler("ZYX")[0]
            cos, sin = math.cos(heading), math.sin(heading)
            x = state[0] + cos * forward - sin * left
            y = state[1] + sin * forward + cos * left
            expected = height_at(ground, x, y) - state[2]
            assert np.allclose(found, expected, atol=1e-12)


def test_a_map_covers_its_size_and_the_border_holds_beyond_it():
    line = 0.2 * (np.arange(101) - 50) * 0.1  # rises along x, over 10 m
    ramp = np.tile(line, (101, 1)).astype(np.float32)
    fine = robot_centred_map(ramp, at(), 300, size=3.0)
    assert fine[0, [0, -1]].tolist() == pytest.approx([-0.299, 0.299])
    beyond = robot_centred_map(ramp, at(x=50.0).float().numpy(), 4)
    assert beyond.shape == (4, 4) and beyond.dtype == torch.float32
    assert beyond.unique().tolist() == pytest.approx([0.2 * 5.0])


@pytest.mark.parametrize(
    ("call", "shapes"),
    [
        (encode_inputs, [(12,), (2,)]),
        (encode_inputs, [(13,), (3,)]),
        (transition, [(13,), (5,)]),
        (integrate, [(13,), (11,)]),
        (robot_centred_map, [(4, 5), (12,)]),
        (robot_centred_map, [(2, 9, 9), (3, 13)]),
        (robot_centred_map, [(9,), (13,)]),
    ],
)
def test_wrong_shapes_are_refused_with_what_was_given(call, shapes):
    more = [8] if call is robot_centred_map else []
    with pytest.raises(ValueError, match=r"must have shape \(") as error:
        call(*map(torch.zeros, shapes), *more)
    assert any(f"not {shape}" in str(error.value) for shape in shapes)


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


def test_rollout_step_by_step(model, scene):
    heights, state, actions = scene
    predicted = rollout(model, heights, state, actions, 8, role="expert")
    assert predicted.shape == (3, 6, 13) and predicted.dtype == torch.float32
    assert not predicted.requires_grad and not predicted.is_inference()
    assert torch.equal(predicted[:, 0], state)
    now, memory = state.double(), None
    for k in range(5):
        inputs = encode_inputs(now, actions[:, k].double()).float()
        maps = robot_centred_map(heights, now, 8).half()
        with torch.no_grad():
            step, memory = model("expert", inputs[:, None], maps[:, None], memory)
        now = integrate(now, step[:, 0].double())
        assert torch.allclose(predicted[:, k + 1], now.float(), atol=1e-5)
    alone = rollout(model, heights[1].numpy(), state[1], actions[1], 8, role="expert")
    # different rounding in float32 may give the next float16
    assert torch.allclose(alone, predicted[1], atol=1e-3)
    with pytest.raises(ValueError, match=r"actions .* \(2, K, 2\), not \(3, 5, 2\)"):
        rollout(model, heights, state[:2], actions, 8)
    with pytest.raises(ValueError, match=r"heights .* \(3, H, W\), not \(2, 60, 60\)"):
        rollout(model, heights[:2], state, actions, 8)


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
    with pytest.raises(ValueError, match=r"\(2, 4, 13\), not \(2, 3, 13\)"):
        rollout_errors(predicted, actual[:, 1:])
