"""Parameter counts in closed form, initial weights and their seeds, memory."""

import pytest
import torch
from torch import nn

from sidm.config import ConfigError
from sidm.learning import (
    PAPER_NETWORK,
    RELEASED_NETWORK,
    SIDM,
    Decoder,
    Discriminator,
    DynamicsModel,
    Encoder,
    Network,
    parameter_count,
)
from sidm.learning.seeds import derive


def encoder_count(pixels: int) -> int:
    """Number of the encoder's parameters.

    It has two convolutions of kernel 4 with 8 and 4 channels, and two layers of 128
    behind them.
    """
    flat = 4 * (pixels - 6) ** 2 + 11
    return (8 * 16 + 8) + (4 * 8 * 16 + 4) + (flat + 1) * 128 + (128 + 1) * 128


def lstm_count(layers: int, hidden: int) -> int:
    """Number of parameters of an LSTM and the output layer of 64.

    Each of four gates has weights to input and state and two biases.
    """
    sizes = [128] + [hidden] * (layers - 1)
    return sum(4 * hidden * (size + hidden + 2) for size in sizes) + (hidden + 1) * 64


@pytest.mark.parametrize("network", [Network(), RELEASED_NETWORK, PAPER_NETWORK])
def test_networks_have_the_papers_sizes(network):
    """Section 4: a map of 300 x 300 and an LSTM of 4 x 1024, without filling memory."""
    pixels, layers, hidden = network.pixels, network.layers, network.hidden
    with torch.device("meta"):
        encoder, sidm = Encoder(network), SIDM(network)
        assert parameter_count(Decoder(network)) == 65 * 64 + 65 * 13
        assert parameter_count(Discriminator(network)) == 129 * 1024 + 1025
        maps = torch.zeros(2, 3, pixels, pixels, dtype=torch.float16)
        latents = encoder(torch.zeros(2, 3, 11), maps)
        transitions, memory = sidm(latents)
    assert parameter_count(encoder) == encoder_count(pixels)
    assert parameter_count(sidm) == lstm_count(layers, hidden)
    assert latents.shape == (2, 3, 128) and transitions.shape == (2, 3, 64)
    assert memory[0].shape == (layers, 2, hidden)


def test_scaled_weights_carry_the_inputs_through(generator):
    """Latents and LSTM output change ten times as much as with PyTorch's weights."""
    inputs = torch.randn(2, 8, 16, 11, generator=generator)
    maps = torch.randn(2, 8, 16, 16, 16, generator=generator)

    @torch.no_grad()
    def moved(initialisation: str) -> list[float]:
        network = Network(pixels=16, initialisation=initialisation)
        model = DynamicsModel(network, seed=0, roles=["novice"])
        encoder = model.encoders["novice"]
        base, both = (encoder(inputs[k], maps[k]) for k in range(2))
        outputs = [model.sidm.lstm(latents)[0][:, -1] for latents in (base, both)]
        by_numbers, by_map = encoder(inputs[1], maps[0]), encoder(inputs[0], maps[1])
        pairs = (base, by_numbers), (base, by_map), outputs
        return [float((a - b).square().mean().sqrt()) for a, b in pairs]

    for scaled, default in zip(moved("scaled"), moved("pytorch"), strict=True):
        assert scaled > 10 * default


def test_the_lstms_gates_have_weights_of_their_own():
    """Weights from the state are orthogonal, forget gates open, other biases 0."""
    lstm = SIDM(Network(hidden=32)).lstm
    for layer in range(lstm.num_layers):
        for gate in getattr(lstm, f"weight_hh_l{layer}").chunk(4):
            assert torch.allclose(gate @ gate.T, torch.eye(32), atol=1e-5)
        inward, back = (getattr(lstm, f"bias_{name}_l{layer}") for name in ("ih", "hh"))
        gates = (inward + back).detach().chunk(4)
        assert [gate.unique().tolist() for gate in gates] == [[0], [1], [0], [0]]


def test_memory_carries_a_trajectory_on(small_network, make_motion):
    motion, model = make_motion(2), DynamicsModel(small_network)
    whole, _ = model("expert", motion.inputs, motion.maps)
    memory, parts = None, []
    steps = zip(motion.inputs.split(1, 1), motion.maps.split(1, 1), strict=True)
    for inputs, maps in steps:
        part, memory = model("expert", inputs, maps, memory)
        parts.append(part)
    assert torch.allclose(torch.cat(parts, dim=1), whole, atol=1e-5)


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


@pytest.mark.parametrize(
    ("inputs", "maps", "words"),
    [
        ((2, 3, 11), (2, 3, 9, 9), r"maps .* \(2, 3, 8, 8\), not \(2, 3, 9, 9\)"),
        ((3, 11), (3, 8, 8), r"inputs .* \(B, T, 11\), not \(3, 11\)"),
    ],
)
def test_wrong_shapes_give_both(small_network, inputs, maps, words):
    model = DynamicsModel(small_network)
    with pytest.raises(ValueError, match=words):
        model("novice", torch.zeros(inputs), torch.zeros(maps))
    parts: list[tuple[nn.Module, int]]
    parts = [(model.sidm, 9), (model.decoders["novice"], 7)]
    for part, size in [*parts, (Discriminator(small_network), 7)]:
        with pytest.raises(ValueError, match=rf"must have .* not \(2, 3, {size}\)"):
            part(torch.zeros(2, 3, size))


@pytest.mark.parametrize(
    ("name", "value"),
    [("pixels", 6), ("layers", 0), ("slope", 1.5), ("channels", (8, 0)), ("own", "a")],
)
def test_sizes_that_make_no_network(name, value):
    with pytest.raises(ConfigError, match=f"Network.{name}"):
        Network(**{name: value})
