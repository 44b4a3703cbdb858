"""Sizes in closed form, initial weights, memory, and parts that two systems share."""

import dataclasses
import math

import pytest
import torch

import sidm
from sidm import learning
from sidm.config import ConfigError, replace
from sidm.learning import Datasets, DynamicsModel, Network, Windows, parameter_count
from sidm.learning.evaluation import mean_loss
from sidm.learning.seeds import derive
from sidm.learning.trainer import Trainer
from sidm.learning.training import prediction_phase

PARTS = {
    "encoders": ("convolutions.0", "convolutions.2", "dense.0", "dense.2"),
    "decoders": ("dense.0", "dense.2"),
}
BIASES = {f"{part}.{layer}.bias" for part in PARTS for layer in PARTS[part]}


def encoder_count(pixels: int) -> int:
    """Convolutions of kernel 4 with 8 and 4 channels, then two layers of 128."""
    flat = 4 * (pixels - 6) ** 2 + 11
    return (8 * 16 + 8) + (4 * 8 * 16 + 4) + (flat + 1) * 128 + (128 + 1) * 128


def lstm_count(layers: int, hidden: int) -> int:
    """Four gates with weights to input and state and two biases; 64 outputs."""
    sizes = [128] + [hidden] * (layers - 1)
    return sum(4 * hidden * (size + hidden + 2) for size in sizes) + (hidden + 1) * 64


@pytest.mark.parametrize("network", [learning.RELEASED_NETWORK, learning.PAPER_NETWORK])
def test_networks_have_the_papers_sizes(network):
    """Section 4: a map of 300 x 300 and an LSTM of 4 x 1024, without filling memory."""
    pixels = network.pixels
    with torch.device("meta"):
        encoder, core = learning.Encoder(network), learning.SIDM(network)
        assert parameter_count(learning.Decoder(network)) == 65 * 64 + 65 * 13
        discriminator = learning.Discriminator(network)
        assert parameter_count(discriminator) == 129 * 1024 + 1025
        maps = torch.zeros(2, 3, pixels, pixels, dtype=torch.float16)
        latents = encoder(torch.zeros(2, 3, 11), maps)
        assert latents.shape == (2, 3, 128) and core(latents)[0].shape == (2, 3, 64)
    assert parameter_count(encoder) == encoder_count(pixels)
    assert parameter_count(core) == lstm_count(network.layers, network.hidden)


def test_the_lstms_gates_have_weights_of_their_own():
    """Weights from the state are orthogonal, forget gates open, other biases 0."""
    lstm = learning.SIDM(Network(hidden=32)).lstm
    for layer in range(lstm.num_layers):
        for gate in getattr(lstm, f"weight_hh_l{layer}").chunk(4):
            assert torch.allclose(gate @ gate.T, torch.eye(32), atol=1e-5)
        inward, back = (getattr(lstm, f"bias_{name}_l{layer}") for name in ("ih", "hh"))
        gates = (inward + back).detach().chunk(4)
        assert [gate.unique().tolist() for gate in gates] == [[0], [1], [0], [0]]


def test_memory_carries_a_trajectory_on(small_network, make_motion):
    motion, model = make_motion(2), DynamicsModel(small_network)
    whole, _ = model("expert", motion.inputs, motion.maps)
    first, memory = model("expert", motion.inputs[:, :2], motion.maps[:, :2])
    rest, _ = model("expert", motion.inputs[:, 2:], motion.maps[:, 2:], memory)
    assert torch.allclose(torch.cat([first, rest], dim=1), whole, atol=1e-5)


def test_a_part_begins_the_same_whatever_else_there_is(small_network):
    both = DynamicsModel(small_network, seed=5).state_dict()
    one = DynamicsModel(small_network, seed=5, roles=["novice"]).state_dict()
    other = DynamicsModel(small_network, seed=6).state_dict()
    assert all(torch.equal(both[name], weights) for name, weights in one.items())
    name = "encoders.novice.dense.0.weight"
    assert not torch.equal(both[name], both[name.replace("novice", "expert")])
    assert not torch.equal(both[name], other[name])


def test_seeds_and_purposes_differ_and_are_the_same_everywhere():
    purposes = ("novice", "expert", "matching")
    found = {derive(seed, purpose) for seed in range(50) for purpose in purposes}
    assert len(found) == 150 and all(0 <= seed < 2**63 for seed in found)
    assert derive(0, "novice") == 1983752819106747147


def test_wrong_shapes_give_both_and_an_unknown_system_is_named(small_network):
    model = DynamicsModel(small_network, roles=["novice"])
    inputs, maps = torch.zeros(2, 3, 11), torch.zeros(2, 3, 9, 9)
    with pytest.raises(ValueError, match=r"maps .* \(2, 3, 8, 8\), not \(2, 3, 9, 9\)"):
        model("novice", inputs, maps)
    with pytest.raises(ValueError, match=r"inputs .* \(B, T, 11\), not \(3, 11\)"):
        model("novice", inputs[0], maps[0])
    critic = learning.Discriminator(small_network)
    for part in (model.sidm, model.decoders["novice"], critic):
        with pytest.raises(ValueError, match=r"must have .* not \(2, 3, 11\)"):
            part(inputs)
    with pytest.raises(ConfigError, match="this model has novice, not 'expert'"):
        model("expert", inputs, maps)


@pytest.mark.parametrize(
    ("name", "value"),
    [("pixels", 6), ("layers", 0), ("slope", 1.5), ("channels", (8, 0)), ("own", "a")],
)
def test_sizes_that_make_no_network(name, value):
    with pytest.raises(ConfigError, match=f"Network.{name}"):
        Network(**{name: value})


@pytest.mark.parametrize(
    ("own", "differing"),
    [("none", set()), ("flag", {"encoders.dense.0.bias"}), ("biases", BIASES)],
)
def test_each_system_learns_what_is_its_own_and_both_the_rest(
    datasets, small_network, small_training, own, differing
):
    network = dataclasses.replace(small_network, own=own)
    if own == "none":
        with pytest.raises(ConfigError, match="nothing to match"):
            Trainer(datasets, network, small_training, 0)
    training = dataclasses.replace(small_training, p_expert=0.5, regularise=False)
    trainer = Trainer(datasets, network, training, 0)
    prediction_phase(trainer)
    weights = trainer.weights()
    found = {
        name.replace(".novice", "")
        for name in weights
        if not torch.equal(weights[name], weights[name.replace("expert", "novice")])
    }
    assert {name.replace(".expert", "") for name in found} == differing


@pytest.mark.parametrize("own", ["all", "biases", "flag", "none"])
def test_both_systems_begin_as_copies_of_a_start(small_network, make_motion, own):
    start, motion = DynamicsModel(small_network, roles=["novice"]), make_motion(2)
    model = DynamicsModel(dataclasses.replace(small_network, own=own), seed=7)
    model.initialise_from(start.state_dict())
    expected = start("novice", motion.inputs, motion.maps)[0]
    for role in ("novice", "expert"):
        assert torch.equal(model(role, motion.inputs, motion.maps)[0], expected)


def normal(key: int, *shape: int) -> torch.Tensor:
    return torch.randn(*shape, generator=torch.Generator().manual_seed(key))


def motion(count: int, seed: int, gain: float, steps: int = 16) -> Windows:
    """Motion of a hidden state that decays and takes in the inputs.

    Robots differ in the gains of inputs and outputs.
    """
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
            mean_loss(learning.train(sets, network, training, seed).model, validation)
            for training in (together, alone)
        ]
        ratios.append(math.log(losses[0] / losses[1]))
    assert math.exp(sum(ratios) / 3) < 0.9
