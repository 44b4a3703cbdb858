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

ID = "sidm.simulation.env:sidm/Rover-v0"


@pytest.fixture
def env():
    with gymnasium.make(ID, system="system1", role="expert", pixels=12) as made:
        yield made


@pytest.mark.filterwarnings(
    "error", "ignore:.*infinity", "ignore:.*different from the unwrapped version"
)
@pytest.mark.parametrize("wrap", [lambda env: env, ReachPoint])
def test_passes_gymnasiums_checker(wrap):
    with wrap(Rover("system2", "novice", pixels=8)) as env:
        check_env(env, skip_render_check=True)


def test_registered_with_the_length_of_a_trajectory(env):
    assert env.spec.id == "sidm/Rover-v0"
    assert env.spec.max_episode_steps == 64


def test_observation_is_the_input_of_the_networks(env):
    env.reset(seed=3)
    for action in np.array([[0.8, 0.3], [1.0, -0.5], [-0.4, 1.0]], np.float32):
        observation, *_, info = env.step(action)
    assert env.observation_space.contains(observation)
    state, heights = torch.as_tensor(info["state"]), env.unwrapped.simulator.heights
    np.testing.assert_allclose(
        observation["motion"], encode_inputs(state, torch.as_tensor(action)), atol=1e-6
    )
    np.testing.assert_allclose(
        observation["map"], robot_centred_map(heights, state, 12), atol=1e-6
    )


def test_same_seed_same_episode_and_the_simulators_motion(env):
    actions = np.random.default_rng(0).uniform(-1, 1, (4, 2)).astype(np.float32)
    runs = []
    for _ in range(2):
        _, info = env.reset(
            seed=5, options={"terrain_seed": 7, "start": (1.0, -2.0, 0.3)}
        )
        runs.append(
            [info["state"]] + [env.step(action)[-1]["state"] for action in actions]
        )
    assert np.array_equal(*runs)
    with Simulator(
        SYSTEMS["system1"].expert, env.unwrapped.simulator.heights
    ) as simulator:
        expected = [simulator.reset(1.0, -2.0, 0.3)] + [
            simulator.step(action) for action in actions
        ]
    assert np.array_equal(runs[0], expected)


def test_border_truncates_and_a_stuck_robot_terminates(env):
    flat = np.zeros((61, 61))  # the border's margin begins 2 m from the origin
    env.reset(seed=0, options={"heights": flat, "start": (1.5, 0.0, 0.0)})
    for _ in range(30):
        _, reward, terminated, truncated, info = env.step(
            np.array([1.0, 0.0], np.float32)
        )
        if terminated or truncated:
            break
    assert truncated and not terminated and info["ended"] == "border" and reward == 0
    env.reset(seed=0, options={"heights": flat, "start": (0.0, 0.0, 0.0)})
    ends = [env.step(np.zeros(2, np.float32))[2] for _ in range(26)]
    assert ends == [False] * 25 + [True]


def test_a_failed_simulation_terminates_with_the_last_observation(env, monkeypatch):
    before, _ = env.reset(seed=0)
    monkeypatch.setattr(
        env.unwrapped.simulator, "step", lambda action: np.full(13, np.nan)
    )
    observation, _, terminated, truncated, info = env.step(np.zeros(2, np.float32))
    assert terminated and not truncated and info["ended"] == "unstable"
    assert all(np.array_equal(observation[name], before[name]) for name in before)


def test_after_a_failed_simulation_the_goal_is_where_it_was(monkeypatch):
    with ReachPoint(Rover(pixels=4)) as env:
        before, _ = env.reset(seed=0)
        monkeypatch.setattr(
            env.unwrapped.simulator, "step", lambda action: np.full(13, np.nan)
        )
        observation, reward, terminated, _, info = env.step(np.zeros(2, np.float32))
        assert terminated and reward == 0 and not info["reached"]
        assert np.array_equal(observation["goal"], before["goal"])


def test_goal_rewards_metres_gained_and_ends_when_reached():
    with ReachPoint(Rover(pixels=4), nearest=2.0, farthest=2.0, radius=1.0) as env:
        observation, info = env.reset(
            seed=1, options={"heights": np.zeros((300, 300)), "start": (0.0, 0.0, 0.0)}
        )
        assert np.linalg.norm(observation["goal"]) == pytest.approx(2.0, abs=1e-5)
        env.goal, total, terminated = np.array([2.0, 0.0]), 0.0, False
        env._distance = before = float(np.linalg.norm(env.goal - info["state"][:2]))
        while not terminated:
            observation, reward, terminated, _, info = env.step(
                np.array([1.0, 0.0], np.float32)
            )
            total += reward
        after = float(np.linalg.norm(env.goal - info["state"][:2]))
        assert info["reached"] and after < 1.0
        assert total == pytest.approx(before - after + 1.0, abs=1e-6)
        assert observation["goal"] == pytest.approx([after, 0.0], abs=0.1)


def test_pictures_show_the_robot_and_wrong_arguments_are_named():
    with Rover(pixels=4, render_mode="rgb_array") as env:
        env.reset(seed=0)
        picture = env.render()
        assert picture.shape == (480, 640, 3)
        assert picture.dtype == np.uint8
        assert picture.std() > 5
        with pytest.raises(ValueError, match="unknown option 'seeed'"):
            env.reset(options={"seeed": 1})
    system = SYSTEMS["system2"]
    assert Rover(system, "expert", pixels=4).robot == system.expert
    with pytest.raises(ValueError, match="rgb_array"):
        Rover(render_mode="human")
    with pytest.raises(gymnasium.error.ResetNeeded, match="reset"):
        Rover(pixels=4).step(np.zeros(2, np.float32))
