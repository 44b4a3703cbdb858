"""Parts that two systems share, equal initial weights, and the use of sharing."""

import dataclasses
import math

import pytest
import torch

import sidm
from sidm.config import ConfigError, replace
from sidm.learning import Datasets, DynamicsModel, Windows, parameter_count, train
from sidm.learning.evaluation import mean_loss
from sidm.learning.trainer import Trainer
from sidm.learning.training import prediction_phase

CONVOLUTIONS = ("convolutions.0", "convolutions.2")


@pytest.fixture
def make_model(small_network):
    def make(own, **given) -> DynamicsModel:
        return DynamicsModel(dataclasses.replace(small_network, own=own), **given)

    return make


@pytest.mark.parametrize(
    ("own", "differing"),
    [
        ("none", set()),
        ("flag", {"encoders.dense.0.bias"}),
        (
            "biases",
            {f"encoders.{name}.bias" for name in (*CONVOLUTIONS, "dense.0", "dense.2")}
            | {f"decoders.{name}.bias" for name in ("dense.0", "dense.2")},
        ),
    ],
)
def test_each_system_learns_what_is_its_own_and_both_the_rest(
    datasets, small_network, small_training, own, differing
):
    network = dataclasses.replace(small_network, own=own)
    training = dataclasses.replace(small_training, p_expert=0.5, regularise=False)
    trainer = Trainer(datasets, network, training, 0)
    prediction_phase(trainer)
    weights = trainer.weights()
    found = {
        name.replace(".novice", "")
        for name in weights
        if not torch.equal(weights[name], weights[name.replace("novice", "expert")])
    }
    assert {name for name in found if ".expert" not in name} == differing


def test_the_paper_shares_the_sidm_alone(make_model):
    both, one = make_model("all"), make_model("all", roles=["novice"])
    shared = parameter_count(both.sidm)
    assert parameter_count(both) - shared == 2 * (parameter_count(one) - shared)
    with pytest.raises(ConfigError, match="this model has novice, not 'expert'"):
        one("expert", torch.zeros(1, 1, 11), torch.zeros(1, 1, 8, 8))


@pytest.mark.parametrize("own", ["all", "biases", "flag", "none"])
def test_both_systems_begin_as_copies_of_a_start(make_model, make_motion, own):
    start, motion = make_model("all", seed=7, roles=["novice"]), make_motion(2)
    model = make_model(own)
    model.initialise_from(start.state_dict())
    expected = start("novice", motion.inputs, motion.maps)[0]
    for role in ("novice", "expert"):
        assert torch.equal(model(role, motion.inputs, motion.maps)[0], expected)


def test_shared_parts_have_the_novices_initial_weights(make_model):
    """So a method with shared parts begins like a method without."""
    shared, apart = make_model("none").state_dict(), make_model("all").state_dict()
    for name in shared:
        assert torch.equal(shared[name], apart[name.replace(".expert.", ".novice.")])


def test_one_encoder_has_nothing_to_match(datasets, small_network, small_training):
    network = dataclasses.replace(small_network, own="none")
    with pytest.raises(ConfigError, match="nothing to match"):
        Trainer(datasets, network, small_training, 0)


def motion(count: int, seed: int, gain: float, steps: int = 16) -> Windows:
    """Motion of a hidden state that decays and takes in the inputs.

    Robots differ in the gains of inputs and outputs.
    """

    def normal(key: int, *shape: int) -> torch.Tensor:
        return torch.randn(*shape, generator=torch.Generator().manual_seed(key))

    inputs = normal(seed, count, steps, 11)
    law, output = normal(99, 11, 6) / 3, normal(98, 6, 13) / 2
    state, targets = torch.zeros(count, 6), []
    for step in range(steps):
        state = 0.8 * state + torch.tanh(gain * inputs[:, step] @ law)
        targets.append(gain * torch.tanh(state) @ output)
    maps = torch.zeros(count, steps, 8, 8).half()
    return Windows(inputs, torch.stack(targets, 1), maps)


@pytest.mark.more
def test_an_sidm_helps_where_dynamics_are_shared():
    """SIDM lowers the loss on unseen motion by a margin: 0.80, mean of 3 seeds."""
    sizes = dict(encoder_hidden=32, latent=16, layers=1, hidden=32, decoder_hidden=32)
    sizes |= dict(latent_transition=16, discriminator_hidden=32)
    network = sidm.Network(pixels=8, **sizes)
    together = sidm.Training(
        max_samples=90_000, batch=16, learning_rate=3e-3, validation_trajectories=0
    )
    alone = replace(together, p_expert=0.0, regularise=False)
    validation, expert = motion(40, 3, 1.0), motion(200, 4, 1.6)
    ratios = []
    for seed in range(3):
        parts = motion(6, 10 + seed, 1.0), motion(3, 20 + seed, 1.0), validation
        sets = Datasets(*parts, expert)
        losses = [
            mean_loss(train(sets, network, training, seed).model, validation)
            for training in (together, alone)
        ]
        ratios.append(math.log(losses[0] / losses[1]))
    assert math.exp(sum(ratios) / 3) < 0.9
