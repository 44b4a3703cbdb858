"""Planning with a known law of motion, and imagined paths that equal rollouts."""

import math

import numpy as np
import pytest
import torch

from companion.extensions.planning import (
    ROLLED_OVER,
    ModelImagination,
    Planner,
    Planning,
    cost,
    steer_to_goal,
)
from sidm import rotations
from sidm.drives import STEPS
from sidm.learning import DynamicsModel, rollout

FREE = Planning(replan=1, slowest=-1.0, fastest=1.0)
HERE = np.array([0, 0, 0.2, 0, 0, 0, 1, *[0] * 6], float)
AHEAD = np.array([3.0, 1.0])  # a goal


def slide(state: np.ndarray, actions: torch.Tensor) -> torch.Tensor:
    """States (N, H + 1, 13) of a body that throttle drives and steering turns.

    Full throttle drives at 2 m/s, full steering turns right at 1.5 rad/s.
    """
    states = torch.as_tensor(state, dtype=torch.float64).expand(len(actions), -1)
    path, yaw = [states], rotations.yaw(states[:, 3:7])
    for throttle, steering in actions.double().permute(1, 2, 0):  # (H, 2, N)
        yaw = yaw - 0.15 * steering
        after = path[-1].clone()
        after[:, 0] += 0.2 * throttle * yaw.cos()
        after[:, 1] += 0.2 * throttle * yaw.sin()
        after[:, 3:7] = rotations.from_yaw(yaw)
        path.append(after)
    return torch.stack(path, dim=1)


def plan(planner: Planner, state: np.ndarray = HERE, seen: list | None = None):
    """The planner's next plan; the first actions that it tries are added to `seen`."""

    def imagine(actions):
        if seen is not None:
            seen.append(actions.clone())
        return slide(state, actions)

    return planner.plan(imagine)


def drive(goal: np.ndarray, act, most: int = 80) -> int:
    """Number of control steps until the goal is within 0.3 m, or `most`."""
    state = HERE
    for step in range(most):
        if np.hypot(*(state[:2] - goal)) < 0.3:
            return step
        state = slide(state, torch.as_tensor(act(state)).reshape(1, 1, 2))[0, 1].numpy()
    return most


def test_a_planner_reaches_its_goal_about_as_fast_as_can_be():
    """Five metres at 2 m/s take 25 steps, and turning takes some more."""
    goal = np.array([-3.0, 4.0])
    planner = Planner(FREE, goal, seed=0)
    assert drive(goal, lambda state: plan(planner, state)[0].numpy()) < 45


def test_a_plan_goes_on_where_the_one_before_led():
    settings = Planning(samples=4, elites=1, horizon=6, hold=3, replan=2, spread=5.0)
    planner, drawn = Planner(settings, AHEAD, 0), []
    best = plan(planner)
    assert torch.equal(best[0], best[2]), "an action is held"
    assert torch.allclose(planner.foreseen, slide(HERE, best[None])[0])
    assert (planner.spread[-2:] == settings.spread).all()  # beyond the plan
    assert torch.equal(planner.mean[:4], best[2:])
    assert torch.equal(planner.mean[4:], best[-1:].expand(2, -1))
    plan(planner, seen=drawn)
    low, high = drawn[0].flatten(0, 1).aminmax(dim=0)
    assert (low >= torch.tensor([-0.2, -1])).all(), "throttles that data have"
    assert (high <= torch.tensor([0.6, 1])).all()
    assert torch.equal(drawn[0][0], torch.cat([best[2:], best[-1:], best[-1:]]))


def test_cost_is_distance_and_a_rollover_costs_more_than_any():
    """By hand: 3 m and then 1 m from the goal, and one step tilted by 60 degrees."""
    states, goal = torch.from_numpy(HERE).repeat(1, 3, 1), torch.tensor([4.0, 0.0])
    states[0, 1, 0], states[0, 2, 0] = 1.0, 3.0
    assert float(cost(states, goal, 50.0)) == pytest.approx((3 + 1) / 2 + 1)
    states[0, 1, 3:7] = torch.tensor([0.5, 0, 0, math.cos(math.pi / 6)])
    assert float(cost(states, goal, 50.0)) == pytest.approx(3 + ROLLED_OVER)
    assert float(cost(states, goal, 61.0)) == pytest.approx(3)


def test_dreams_are_the_models_rollouts(small_network, rng):
    model = DynamicsModel(small_network, roles=["novice"]).eval()
    heights = 0.1 * rng.normal(size=(61, 61))
    actions = torch.from_numpy(rng.uniform(-1, 1, (3, 7, 2)))
    dreamer = ModelImagination(model, heights, small_network.pixels)
    paths = torch.stack(
        [rollout(model, heights, torch.from_numpy(HERE), some, 8) for some in actions]
    )
    assert torch.allclose(dreamer.imagine(HERE, actions), paths, atol=2e-3)
    for step in range(3):  # and after observed steps
        dreamer.observe(paths[0, step].numpy(), actions[0, step])
    later = dreamer.imagine(paths[0, 3].numpy(), actions[:1, 3:])
    assert torch.allclose(later[0], paths[0, 3:], atol=2e-3)


def test_a_memory_is_never_longer_than_training_has_seen(small_network, rng):
    model = DynamicsModel(small_network, roles=["novice"]).eval()
    heights = np.zeros((61, 61))
    actions = rng.uniform(-1, 1, (STEPS - 12 + 1, 2))
    long, short = (ModelImagination(model, heights, 8, horizon=12) for _ in range(2))
    for action in actions:
        long.observe(HERE, action)
    for action in actions[-(STEPS - 12) // 2 :]:
        short.observe(HERE, action)
        short.remember()
    long.remember()
    assert len(long.done) == len(short.done) == 26
    # rounded to float32, 26 steps at once and one by one
    assert all(
        torch.allclose(a, b, atol=1e-6)
        for a, b in zip(long.memory, short.memory, strict=True)
    )


def test_the_straight_driver_turns_towards_its_goal():
    steering = steer_to_goal(HERE, np.array([5.0, 1.0]))[1]
    assert steering == pytest.approx(-1.5 * math.atan(0.2))
    assert steer_to_goal(HERE, np.array([5.0, -1.0]))[1] > 0
    goal = np.array([4.0, 3.0])
    assert drive(goal, lambda state: steer_to_goal(state, goal), 200) < 200


def test_plans_are_functions_of_their_seed():
    plans = [plan(Planner(Planning(), AHEAD, seed)) for seed in (1, 1, 2)]
    assert torch.equal(plans[0], plans[1]) and not torch.equal(plans[0], plans[2])
    assert torch.equal(plans[0][0], plans[0][2])  # an action is held
