"""M models of one Network computed as one, with stacked weights.

Convolutions and fully connected layers are the modules of `sidm.learning.networks`
under `torch.func.vmap`. vmap cannot batch the LSTM, so that is `lstm`.
M trials, B trajectories, T steps, P map pixels a side, H hidden units.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence

import torch
from torch import Tensor, nn
from torch.func import functional_call, vmap

from companion.bundle.fused import (
    FusedConvolutions,
    FusedRecurrence,
    fuses_convolutions,
    fuses_steps,
)
from sidm.learning.trainer import Trainer
from sidm.systems import ROLES

#: whose trajectories a batch holds: (M, B) bool, True for the expert's; or one role
Systems = Tensor | str


class StackedModels:
    """The models and discriminators of M trials.

    Args:
        trainers: of the trials, whose weights are copied. Novice and expert are of one
            body and one system of units; some trials may lack the expert.
        device: where to compute.

    Attributes:
        weights: (M, ...) each, by name, such as 'model.sidm.lstm.weight_ih_l0'
            (M, 4 H, K); 0 where a trial has none
    """

    def __init__(self, trainers: Sequence[Trainer], device: torch.device) -> None:
        self.device, self.slope = device, trainers[0].network.slope
        modules = [
            nn.ModuleDict({"model": t.model, "discriminator": t.discriminator})
            for t in trainers
        ]
        largest = max(modules, key=lambda module: len(tensors_of(module)))
        self.modules = copy.deepcopy(largest).to("meta")  # shapes only, no memory
        self.weights = stacked([tensors_of(module) for module in modules], device)
        for name, _ in self.modules.named_parameters():
            self.weights[name].requires_grad_()

    def parameters(self, part: str) -> dict[str, Tensor]:
        """Trainable parameters (M, ...) of a part, e.g. 'model.sidm', by full name."""
        return {
            name: weights
            for name, weights in self.weights.items()
            if name.startswith(f"{part}.") and weights.requires_grad
        }

    def encode(self, systems: Systems, inputs: Tensor, maps: Tensor) -> Tensor:
        """Latent state-actions (M, B, T, latent).

        Args:
            systems: whose trajectories the batch holds.
            inputs: (M, B, T, X), raw units.
            maps: (M, B, T, P, P), m.
        """
        if isinstance(systems, str):  # one system: a single batch of B T rows per trial
            rows, pixels = (tensor.flatten(1, 2)[:, None] for tensor in (inputs, maps))
            latents = self._encode(systems, rows, pixels)
            return latents.reshape(*inputs.shape[:3], -1)
        return self._encode(systems, inputs, maps)

    def _encode(self, systems: Systems, inputs: Tensor, maps: Tensor) -> Tensor:
        input_mean, input_std, map_mean, map_std = (
            self._buffer(f"encoders.novice.{name}", inputs.ndim)
            for name in ("input_mean", "input_std", "map_mean", "map_std")
        )
        rows = (inputs - input_mean) / input_std  # (M, B, T, X)
        pixels = (maps.to(inputs.dtype) - map_mean[..., None]) / map_std[..., None]
        features = self._convolve(systems, pixels)
        return self._dense("encoders", systems, torch.cat([features, rows], dim=-1))

    def _convolve(self, systems: Systems, pixels: Tensor) -> Tensor:
        """Map features (M, B, T, 4 (P - 6)^2) of standardised maps (M, B, T, P, P).

        Every trajectory is convolved with the kernels of its own system.
        """
        role = systems if isinstance(systems, str) else "novice"
        path = f"model.encoders.{role}.convolutions"
        kernels = {}
        for name, weights in within(path, self.weights).items():
            kernel = weights[:, None]
            if not isinstance(systems, str):
                expert = self.weights[f"model.encoders.expert.convolutions.{name}"]
                kernel = torch.where(
                    with_ndim(systems, kernel.ndim), expert[:, None], kernel
                )
            kernel = kernel.expand(-1, pixels.shape[1], *kernel.shape[2:])
            kernels[name] = kernel.flatten(0, 1)  # (M B, ...)
        module = self.modules.get_submodule(path)
        rows = pixels.flatten(0, 1).unsqueeze(2)  # (M B, T, 1, P, P)
        if fuses_convolutions(module, rows):
            features = FusedConvolutions.apply(rows, self.slope, *kernels.values())
            return features.unflatten(0, pixels.shape[:2])
        features = batched_call(module, kernels, rows)  # (M B, T, 4, P - 6, P - 6)
        return features.movedim(2, -1).flatten(2).unflatten(0, pixels.shape[:2])

    def _dense(self, part: str, systems: Systems, rows: Tensor) -> Tensor:
        """The dense layers of 'encoders' or 'decoders' on rows (M, B, T, .).

        Every trajectory goes through the layers of its own system.
        """
        if isinstance(systems, str):
            return self._layers(f"model.{part}.{systems}.dense", rows)
        novice, expert = (
            self._layers(f"model.{part}.{role}.dense", rows) for role in ROLES
        )
        return torch.where(with_ndim(systems, rows.ndim), expert, novice)

    def _layers(self, path: str, rows: Tensor) -> Tensor:
        """The module at `path` on rows (M, B, T, .), with each trial's own weights."""
        module, weights = self.modules.get_submodule(path), within(path, self.weights)
        outputs = batched_call(module, weights, rows.flatten(1, 2))
        return outputs.unflatten(1, rows.shape[1:3])

    def _buffer(self, name: str, ndim: int) -> Tensor:
        """A stacked buffer with `ndim` dimensions: (M, 1, 1, .) for 4."""
        buffer = self.weights[f"model.{name}"]
        return buffer.reshape(len(buffer), *[1] * (ndim - 2), -1)

    def predict(self, systems: Systems, inputs: Tensor, maps: Tensor) -> Tensor:
        """State transitions y' (M, B, T, Y), raw units; arguments as for `encode`."""
        latents = self.encode(systems, inputs, maps)
        return self.decode(systems, self.transitions(latents))

    def transitions(self, latents: Tensor) -> Tensor:
        """Latent state transitions (M, B, T, 64) of latents (M, B, T, latent)."""
        hidden = lstm(within("model.sidm.lstm", self.weights), latents)
        return self._layers("model.sidm.output", hidden)

    def decode(self, systems: Systems, transitions: Tensor) -> Tensor:
        """State transitions y' (M, B, T, Y) of latent ones (M, B, T, 64), raw units."""
        scaled = self._dense("decoders", systems, transitions)
        mean, std = (
            self._buffer(f"decoders.novice.{name}", scaled.ndim)
            for name in ("target_mean", "target_std")
        )
        return mean + std * scaled

    def logits(self, latents: Tensor) -> Tensor:
        """Logits (M, B, T) of the discriminators for latents (M, B, T, latent)."""
        return self._layers("discriminator.dense", latents).squeeze(-1)


def lstm(weights: Mapping[str, Tensor], inputs: Tensor) -> Tensor:
    """Hidden states (M, B, T, H) of the last LSTM layer, from zero states.

    Args:
        weights: those of `nn.LSTM` by its names, stacked: 'weight_ih_l0' (M, 4 H, K),
            'bias_hh_l0' (M, 4 H), ...
        inputs: (M, B, T, K).
    """
    hidden = inputs.transpose(1, 2)  # (M, T, B, K)
    names = ("weight_ih", "weight_hh", "bias_ih", "bias_hh")
    for layer in range(sum(name.startswith("weight_ih") for name in weights)):
        w_ih, w_hh, b_ih, b_hh = (weights[f"{name}_l{layer}"] for name in names)
        bias = (b_ih + b_hh).unsqueeze(1)
        gates = torch.baddbmm(bias, hidden.flatten(1, 2), w_ih.mT)
        gates = gates.unflatten(1, hidden.shape[1:3])
        recur = FusedRecurrence.apply if fuses_steps(gates) else recurrence
        hidden = recur(gates, w_hh)
    return hidden.transpose(1, 2)


def recurrence(inputs: Tensor, recurrent: Tensor) -> Tensor:
    """Hidden states (M, T, B, H) of an LSTM layer over all steps, from zero states.

    Args:
        inputs: (M, T, B, 4 H), the gates before the recurrent product is added.
        recurrent: (M, 4 H, H), the recurrent weights.
    """
    trials, _, batch, width = inputs.shape
    output = cell = inputs.new_zeros(trials, batch, width // 4)
    outputs = []
    for gates in inputs.unbind(1):
        raw = torch.baddbmm(gates, output, recurrent.mT)
        i, f, g, o = raw.chunk(4, dim=-1)  # the order of nn.LSTM
        cell = f.sigmoid() * cell + i.sigmoid() * g.tanh()
        output = o.sigmoid() * cell.tanh()
        outputs.append(output)
    return torch.stack(outputs, dim=1)


def tensors_of(module: nn.Module) -> dict[str, Tensor]:
    """Parameters and buffers of a module by name, non-persistent buffers included."""
    return {**dict(module.named_parameters()), **dict(module.named_buffers())}


def stacked(
    parts: Sequence[Mapping[str, Tensor]], device: torch.device
) -> dict[str, Tensor]:
    """Tensors of M trials as one (M, ...) each, by name; 0 where a trial has none."""
    largest = max(parts, key=len)
    return {
        name: torch.stack(
            [part.get(name, torch.zeros_like(like)).detach() for part in parts]
        ).to(device)
        for name, like in largest.items()
    }


def within(prefix: str, tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """The tensors named 'prefix.rest', by the rest of their names."""
    return {
        name.removeprefix(f"{prefix}."): tensor
        for name, tensor in tensors.items()
        if name.startswith(f"{prefix}.")
    }


def batched_call(
    module: nn.Module, weights: Mapping[str, Tensor], inputs: Tensor
) -> Tensor:
    """Outputs (M, ...) of a module for inputs (M, ...), with weights (M, ...)."""

    def call(module_weights: dict[str, Tensor], batch: Tensor) -> Tensor:
        return functional_call(module, module_weights, (batch,))

    return vmap(call)(dict(weights), inputs)


def with_ndim(tensor: Tensor, ndim: int) -> Tensor:
    """`tensor` with trailing dimensions of size 1 added, `ndim` dimensions in all."""
    return tensor.reshape(*tensor.shape, *[1] * (ndim - tensor.ndim))
