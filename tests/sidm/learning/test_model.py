"""Sizes in closed form, initial weights, memory, and parts that two systems share."""

import dataclasses

import pytest
import torch

from sidm import learning
from sidm.config import ConfigError
from sidm.learning import DynamicsModel, Network, parameter_count
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
    for ask in (lambda: model("expert", inputs, maps), lambda: model.loss_weights("x")):
        with pytest.raises(ConfigError, match="this model has novice, not '"):
            ask()


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
    fresh, before = DynamicsModel(small_network, seed=7), model.state_dict()
    core = {name: before[name] for name in before if name.startswith("sidm.")}
    kept = fresh.state_dict()["encoders.novice.dense.0.weight"].clone()
    fresh.initialise_from(core)  # encoders and decoders stay as they are
    assert torch.equal(fresh.state_dict()["encoders.novice.dense.0.weight"], kept)
    assert all(torch.equal(fresh.state_dict()[name], core[name]) for name in core)


def test_seeds_and_purposes_differ_and_are_the_same_everywhere():
    purposes = ("novice", "expert", "matching")
    found = {derive(seed, purpose) for seed in range(50) for purpose in purposes}
    assert len(found) == 150 and all(0 <= seed < 2**63 for seed in found)
    assert derive(0, "novice") == 1983752819106747147
