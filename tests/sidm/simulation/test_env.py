"""The Gymnasium environment: its checker, observation, endings and goal wrapper."""

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.utils.env_checker import check_env

from sidm.learning import robot_centred_map
from sidm.learning.observation import encode_inputs
from sidm.simulation import Simulator
from sidm.simulation.env import ReachPoint, Rover
from sidm.systems import SYSTEMS

AHEAD = np.array([1.0, 0.0], np.float32)
REST = np.zeros(2, np.float32)


@pytest.fixture
def env():
    name = "sidm.simulation.env:sidm/Rover-v0"
    with gymnasium.make(name, system="system1", role="expert", pixels=12) as made:
        yield made


@pytest.mark.filterwarnings(
    "error", "ignore:.*infinity", "ignore:.*different from the unwrapped version"
)
@pytest.mark.parametrize("wrap", [lambda env: env, ReachPoint])
def test_passes_gymnasiums_checker(wrap):
    with wrap(Rover("system2", "novice", pixels=8)) as env:
        check_env(env, skip_render_check=True)


def test_same_seed_gives_the_simulators_motion_as_the_networks_see_it(env):
    assert env.spec.max_episode_steps == 64
    actions = np.array([[0.8, 0.3], [1.0, -0.5], [-0.4, 1.0]], np.float32)
    options, runs = {"terrain_seed": 7, "start": (1.0, -2.0, 0.3)}, []
    for _ in range(2):
        states = [env.reset(seed=5, options=options)[1]["state"]]
        for action in actions:
            observation, *_, info = env.step(action)
            states.append(info["state"])
        runs.append(states)
    assert np.array_equal(*runs)
    heights, state = env.unwrapped.simulator.heights, torch.as_tensor(info["state"])
    with Simulator(SYSTEMS["system1"].expert, heights) as simulator:
        expected = [simulator.reset(1.0, -2.0, 0.3), *map(simulator.step, actions)]
    assert np.array_equal(runs[0], expected)
    motion = encode_inputs(state, torch.as_tensor(action))
    np.testing.assert_allclose(observation["motion"], motion, atol=1e-6)
    ground = robot_centred_map(heights, state, 12)
    np.testing.assert_allclose(observation["map"], ground, atol=1e-6)


def test_border_truncates_and_a_stuck_robot_terminates(env):
    flat = np.zeros((61, 61))  # the border's margin begins 2 m from the origin
    env.reset(seed=0, options={"heights": flat, "start": (1.5, 0.0, 0.0)})
    terminated = truncated = False
    while not (terminated or truncated):
        _, reward, terminated, truncated, info = env.step(AHEAD)
    assert truncated and not terminated and info["ended"] == "border" and reward == 0
    env.reset(seed=0, options={"heights": flat, "start": (0.0, 0.0, 0.0)})
    ends = [env.step(REST)[2] for _ in range(26)]
    assert ends == [False] * 25 + [True]


def test_a_failed_simulation_terminates_with_the_last_observation(monkeypatch):
    with ReachPoint(Rover(pixels=4)) as env:
        before, _ = env.reset(seed=0)
        simulator = env.unwrapped.simulator
        monkeypatch.setattr(simulator, "step", lambda action: np.full(13, np.nan))
        observation, reward, terminated, truncated, info = env.step(REST)
    assert terminated and not truncated and info["ended"] == "unstable"
    assert reward == 0 and not info["reached"]
    assert all(np.array_equal(observation[name], before[name]) for name in before)


def test_goal_rewards_metres_gained_and_ends_when_reached():
    options = {"heights": np.zeros((300, 300)), "start": (0.0, 0.0, 0.0)}
    with ReachPoint(Rover(pixels=4), nearest=2.0, farthest=2.0, radius=1.0) as env:
        observation, info = env.reset(seed=1, options=options)
        assert np.linalg.norm(observation["goal"]) == pytest.approx(2.0, abs=1e-5)
        env.goal, total, terminated = np.array([2.0, 0.0]), 0.0, False
        env._distance = before = float(np.linalg.norm(env.goal - info["state"][:2]))
        while not terminated:
            observation, reward, terminated, _, info = env.step(AHEAD)
            total += reward
        after = float(np.linalg.norm(env.goal - info["state"][:2]))
    assert info["reached"] and after < 1.0
    assert total == pytest.approx(before - after + 1.0, abs=1e-6)
    assert observation["goal"] == pytest.approx([after, 0.0], abs=0.1)


def test_pictures_show_the_robot_and_wrong_arguments_are_named():
    system = SYSTEMS["system2"]
    with Rover(system, "expert", pixels=4, render_mode="rgb_array") as env:
        assert env.robot == system.expert
        with pytest.raises(gymnasium.error.ResetNeeded, match="reset"):
            env.step(REST)
        env.reset(seed=0)
        picture = env.render()
        assert picture.shape == (480, 640, 3) and picture.dtype == np.uint8
        assert picture.std() > 5
        with pytest.raises(ValueError, match="unknown option 'seeed'"):
            env.reset(options={"seeed": 1})
    with pytest.raises(ValueError, match="rgb_array"):
        Rover(render_mode="human")
