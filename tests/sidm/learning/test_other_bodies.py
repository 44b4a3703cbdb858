"""Inputs and targets of other robots than the paper's, and pairs of two bodies."""

import dataclasses
import math

import numpy as np
import pytest
import torch

from sidm.body import DRIVE, ROVER, TWIST, Body
from sidm.config import ConfigError
from sidm.drives import Drive
from sidm.learning import Datasets, Training, Windows, evaluation, observation, train
from sidm.learning.dataset import windows_of
from sidm.learning.observation import integrate, transition
from sidm.learning.trainer import Trainer
from tests.sidm.learning.test_observation import random_states

PIXELS = 8  # of the maps of the small network
ALONE = dict(p_expert=0.0, regularise=False)
TRACKED = Body(
    name="tracked",
    pose="planar",
    columns=(("yaw_rate", "rad/s"), ("wheel", "rad/s")),
    actions=(("left", "rad/s"), ("right", "rad/s")),
)
BLIND = Body(name="blind", tilt=True, columns=TWIST, actions=DRIVE)
ARM = Body(
    name="arm", pose="none", columns=(("joint", "rad"),), actions=(("torque", "1"),)
)


def double(*values) -> torch.Tensor:
    return torch.tensor(values, dtype=torch.float64)


def motion(
    body: Body, count: int, rng: np.random.Generator, steps: int = 12
) -> Windows:
    """Smooth made-up motion of a body, `steps` a trajectory."""
    states = rng.normal(size=(count, steps + 1, len(body.state))).cumsum(1) * 0.1
    if body.pose == "spatial":
        states[..., 3:7] /= np.linalg.norm(states[..., 3:7], axis=-1, keepdims=True)
    actions = rng.normal(size=(count, steps, len(body.actions)))
    pixels = body.pixels(PIXELS)
    maps = torch.from_numpy(rng.normal(size=(count, steps, pixels, pixels))).half()
    drives = [Drive(*arrays, body) for arrays in zip(states, actions, strict=True)]
    return windows_of(drives, PIXELS, maps)


@pytest.fixture
def make_pair(rng, small_network):
    """Made-up data of a novice and an expert, and networks of their bodies."""

    def make(novice: Body, expert: Body):
        parts = [motion(novice, count, rng) for count in (4, 2, 2)]
        bodies = dict(novice_body=novice, expert_body=expert)
        network = dataclasses.replace(small_network, **bodies)
        return Datasets(*parts, motion(expert, 6, rng)), network

    return make


def test_a_planar_robot_turns_left_as_it_drives_forward():
    """Two steps, each a metre ahead and a quarter turn to the left."""
    step = double(1.0, 0, math.pi / 2, 0.2, 6)
    once = integrate(double(0.0, 0, 0, 0.1, 5), step, TRACKED)
    assert torch.allclose(once, step)
    assert torch.allclose(integrate(once, step, TRACKED)[:2], double(1, 1))


@pytest.mark.parametrize("body", [TRACKED, BLIND, ARM])
def test_integrating_a_transition_leads_to_the_next_state(body, rng):
    states = torch.from_numpy(rng.normal(size=(50, len(body.state))))
    if body.pose == "spatial":
        states = random_states(50)
    before, after = states[:-1], states[1:]
    y = transition(before, after, body)
    assert y.shape == (49, len(body.targets))
    back = integrate(before, y, body)
    assert torch.allclose(transition(before, back, body), y, atol=1e-9)
    assert torch.allclose(back[:, body.pose_size :], after[:, body.pose_size :])
    if body.pose == "spatial":  # the length of a predicted quaternion does not matter
        y[:, 3:7] *= 0.3
        assert torch.allclose(integrate(before, y, body), back, atol=1e-9)
    inputs = observation.encode_inputs(
        states, torch.zeros(50, len(body.actions)).double(), body
    )
    assert inputs.shape == (50, len(body.inputs))


def test_a_planar_robots_map_is_relative_to_the_ground_under_it():
    heights = np.tile(0.1 * np.arange(60), (60, 1))  # rises by 1 m a metre along x
    body = dataclasses.replace(TRACKED, map_size=1.0)
    states = torch.stack([double(0.4, 0.3, 0, 0, 0), double(-1.0, 0.2, 0, 0, 0)])
    maps = observation.robot_centred_map(heights, states, 4, 1.0, body=body)
    row = double(-0.375, -0.125, 0.125, 0.375)
    assert torch.allclose(maps, row.expand(2, 4, 4))


def test_a_body_without_a_map_needs_no_ground(make_pair):
    model = Trainer(*make_pair(TRACKED, ROVER), Training(**ALONE), 0).model
    actions = torch.zeros(7, 2)
    path = evaluation.rollout(model, None, torch.zeros(5), actions, 16, body=TRACKED)
    position, heading = evaluation.rollout_errors(path, torch.zeros(8, 5), TRACKED)
    assert torch.allclose(position, path[1:, :2].double().norm(dim=-1))
    assert torch.allclose(heading, path[1:, 2].double().abs(), atol=1e-6)
    with pytest.raises(ValueError, match=r"state .* \(B, 5\), not \(1, 4\)"):
        evaluation.rollout(model, None, torch.zeros(4), actions, 16, body=TRACKED)


@pytest.mark.parametrize(
    "novice, expert", [(TRACKED, ROVER), (BLIND, TRACKED), (ARM, ROVER)]
)
@pytest.mark.parametrize("regularise", [True, False])
def test_a_pair_of_any_bodies_trains_and_the_same_seed_gives_the_same(
    make_pair, small_training, novice, expert, regularise
):
    sets, network = make_pair(novice, expert)
    training = dataclasses.replace(small_training, regularise=regularise)
    first, second = (train(sets, network, training, 3) for _ in range(2))
    assert evaluation.validation_loss(first.model, sets.validation).shape == (
        len(novice.targets),
    )
    assert first.history == second.history
    assert math.isfinite(evaluation.mean_loss(first.model, sets.expert, "expert"))


def test_the_mean_of_the_training_motion_costs_one_a_component(make_pair):
    """Weights are 1 over the variance, in the units of each system's own motion."""
    sets, network = make_pair(TRACKED, BLIND)
    model = Trainer(sets, network, Training(), 0).model
    for role, windows in (("novice", sets.train), ("expert", sets.expert)):
        for parameter in model.decoders[role].dense[-1].parameters():
            parameter.data.zero_()
        losses = evaluation.validation_loss(model, windows, role)
        assert torch.allclose(losses, torch.ones_like(losses), 0, 1e-4)


def test_what_only_one_body_knows_is_refused(make_pair, small_training):
    sets, network = make_pair(TRACKED, ROVER)
    for changes, words in (
        ({"mirror": True}, "mirror knows"),
        ({"reduction": "mean"}, "reduction='mean'"),
        ({"units": "raw"}, "units='raw' leaves 'tracked' no variance"),
    ):
        with pytest.raises(ConfigError, match=words):
            training = dataclasses.replace(small_training, **changes)
            Trainer(sets, network, training, 0)
    with pytest.raises(ConfigError, match="needs robots of one body"):
        dataclasses.replace(network, own="none")
