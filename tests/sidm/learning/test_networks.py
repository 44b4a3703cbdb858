"""Shapes, parameter counts in closed form, standardisation, seeds, memory."""

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
    Standardisation,
    parameter_count,
)


def weights(module: nn.Module) -> torch.Tensor:
    return torch.cat(
        [parameter.detach().reshape(-1) for parameter in module.parameters()]
    )


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


@pytest.mark.parametrize("network", [Network(), RELEASED_NETWORK])
def test_parameter_counts(network):
    assert parameter_count(Encoder(network)) == encoder_count(network.pixels)
    assert parameter_count(SIDM(network)) == lstm_count(network.layers, network.hidden)
    assert parameter_count(Decoder(network)) == 65 * 64 + 65 * 13
    assert parameter_count(Discriminator(network)) == 129 * 1024 + 1025


def test_the_papers_sizes():
    """Section 4: a map of 300 x 300 and an LSTM of 4 x 1024, without filling memory."""
    with torch.device("meta"):
        encoder, sidm = Encoder(PAPER_NETWORK), SIDM(PAPER_NETWORK)
        latents = encoder(
            torch.zeros(2, 3, 11), torch.zeros(2, 3, 300, 300, dtype=torch.float16)
        )
        transitions, memory = sidm(latents)
    assert parameter_count(encoder) == encoder_count(300)
    assert parameter_count(sidm) == lstm_count(4, 1024)
    assert latents.shape == (2, 3, 128) and transitions.shape == (2, 3, 64)
    assert memory[0].shape == (4, 2, 1024)


def test_scaled_weights_carry_the_inputs_through():
    """Latents and LSTM output change ten times as much as with PyTorch's weights.

    Both numbers and maps move them.
    """
    generator = torch.Generator().manual_seed(0)
    inputs = torch.randn(2, 8, 16, 11, generator=generator)
    maps = torch.randn(2, 8, 16, 16, 16, generator=generator)

    def moved(initialisation: str) -> list[float]:
        network = Network(pixels=16, initialisation=initialisation)
        model = DynamicsModel(network, seed=0, roles=["novice"])
        encoder = model.encoders["novice"]
        with torch.no_grad():
            base = encoder(inputs[0], maps[0])
            by_numbers = encoder(inputs[1], maps[0])
            by_map = encoder(inputs[0], maps[1])
            outputs = [
                model.sidm.lstm(latents)[0][:, -1]
                for latents in (base, encoder(inputs[1], maps[1]))
            ]
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
        biases = (
            getattr(lstm, f"bias_ih_l{layer}") + getattr(lstm, f"bias_hh_l{layer}")
        ).detach()
        assert [float(gate.mean()) for gate in biases.chunk(4)] == [0, 1, 0, 0]
        assert biases.sum() == 32


def test_encoder_is_the_papers_stack(small_network, make_motion):
    """Plain convolutions in the default layout give the same features.

    The order of features is height, width, channel.
    """
    motion, encoder = make_motion(2), Encoder(small_network)
    first, _, second, _ = encoder.convolutions
    assert (first.kernel_size, first.stride, first.padding, first.out_channels) == (
        (4, 4),
        (1, 1),
        (0, 0),
        8,
    )
    assert (second.kernel_size, second.stride, second.padding, second.out_channels) == (
        (4, 4),
        (1, 1),
        (0, 0),
        4,
    )
    pixels = motion.maps.float().reshape(12, 1, 8, 8)
    hidden = pixels
    for layer in (first, second):
        hidden = nn.functional.conv2d(hidden, layer.weight.contiguous(), layer.bias)
        hidden = nn.functional.leaky_relu(hidden, 0.01)
    flat = torch.cat(
        [hidden.permute(0, 2, 3, 1).reshape(12, -1), motion.inputs.reshape(12, 11)],
        dim=1,
    )
    for layer in (encoder.dense[0], encoder.dense[2]):
        flat = nn.functional.leaky_relu(flat @ layer.weight.T + layer.bias, 0.01)
    assert torch.allclose(
        encoder(motion.inputs, motion.maps).reshape(12, -1), flat, atol=1e-5
    )


def test_every_layer_but_the_decoders_last_is_leaky(small_network):
    model = DynamicsModel(small_network)
    for stack in (model.encoders["novice"].dense, model.sidm.output):
        assert isinstance(stack[-1], nn.LeakyReLU)
    assert isinstance(model.decoders["novice"].dense[-1], nn.Linear)
    assert {
        layer.negative_slope
        for layer in model.modules()
        if isinstance(layer, nn.LeakyReLU)
    } == {0.01}


def test_memory_carries_a_trajectory_on(small_network, make_motion):
    motion, model = make_motion(2), DynamicsModel(small_network)
    whole, _ = model("expert", motion.inputs, motion.maps)
    memory, parts = None, []
    for t in range(6):
        part, memory = model(
            "expert", motion.inputs[:, t : t + 1], motion.maps[:, t : t + 1], memory
        )
        parts.append(part)
    assert torch.allclose(torch.cat(parts, dim=1), whole, atol=1e-5)


def test_discriminator_gives_a_probability(small_network, generator):
    discriminator = Discriminator(small_network)
    latents = torch.randn(2, 5, 8, generator=generator)
    probability = discriminator(latents)
    assert probability.shape == (2, 5) and ((probability > 0) & (probability < 1)).all()
    assert torch.allclose(
        torch.logit(probability), discriminator.logits(latents), atol=1e-5
    )


def test_standardisation_is_the_same_net_in_other_units(small_network, make_motion):
    motion = make_motion(4)
    units = Standardisation.fit(motion)
    plain, scaled = DynamicsModel(small_network), DynamicsModel(small_network, units)
    inputs = (motion.inputs - units.input_mean) / units.input_std
    maps = (motion.maps.float() - units.map_mean) / units.map_std
    expected = units.target_mean + units.target_std * plain("novice", inputs, maps)[0]
    assert torch.allclose(
        scaled("novice", motion.inputs, motion.maps)[0], expected, atol=1e-5
    )


def test_a_part_begins_the_same_whatever_else_there_is(small_network):
    both = DynamicsModel(small_network, seed=5)
    one = DynamicsModel(small_network, seed=5, roles=["novice"])
    for part in ("encoders.novice", "decoders.novice", "sidm"):
        assert torch.equal(
            weights(both.get_submodule(part)), weights(one.get_submodule(part))
        )
    assert not torch.equal(
        weights(both.encoders["novice"]), weights(both.encoders["expert"])
    )
    other = DynamicsModel(small_network, seed=6)
    assert not torch.equal(weights(both.sidm), weights(other.sidm))


def test_an_unknown_system_is_named(small_network, make_motion):
    motion, model = make_motion(1), DynamicsModel(small_network, roles=["novice"])
    with pytest.raises(ConfigError, match="this model has novice, not 'expert'"):
        model("expert", motion.inputs, motion.maps)


def test_wrong_shapes_give_both(small_network):
    model = DynamicsModel(small_network)
    with pytest.raises(
        ValueError, match=r"maps must have shape \(2, 3, 8, 8\), not \(2, 3, 9, 9\)"
    ):
        model("novice", torch.zeros(2, 3, 11), torch.zeros(2, 3, 9, 9))
    with pytest.raises(
        ValueError, match=r"inputs must have shape \(B, T, 11\), not \(3, 11\)"
    ):
        model("novice", torch.zeros(3, 11), torch.zeros(3, 8, 8))
    with pytest.raises(
        ValueError, match=r"latents must have shape \(B, T, 8\), not \(2, 3, 9\)"
    ):
        model.sidm(torch.zeros(2, 3, 9))
    with pytest.raises(
        ValueError, match=r"latent transitions must have shape \(2, 6\), not \(2, 7\)"
    ):
        model.decoders["novice"](torch.zeros(2, 7))
    with pytest.raises(
        ValueError, match=r"latents must have shape \(2, 8\), not \(2, 7\)"
    ):
        Discriminator(small_network).logits(torch.zeros(2, 7))


@pytest.mark.parametrize(
    ("name", "value"),
    [("pixels", 6), ("layers", 0), ("slope", 1.5), ("channels", (8, 0))],
)
def test_sizes_that_make_no_network(name, value):
    with pytest.raises(ConfigError, match=f"Network.{name}"):
        Network(**{name: value})
