"""M models of one Network as one: their weights side by side, and the arithmetic on M batches at once.

Convolutions and fully connected layers are the modules of `networks` under
`torch.func.vmap`; the LSTM, which that cannot batch, is `recurrence.lstm`. M trials, B
trajectories, T steps, P map pixels a side.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import torch
from torch import Tensor, nn
from torch.func import functional_call, vmap

from companion.bundle.recurrence import lstm
from sidm.learning.model import DynamicsModel
from sidm.learning.networks import Discriminator
from sidm.settings import Network
from sidm.systems import ROLES

#: numbers in a tensor that PyTorch's convolution of one channel a group takes on a GPU
LARGEST = 2**31 - 1
#: (M, B) bool: which trajectories are the expert's; or the role of all of them
Who = Tensor | str


class Stack:
    """The models and the discriminators of M trials; a trial's are put in and taken out by name.

    Args:
        network: sizes of all.
        roles: the systems, 'novice' and 'expert' or the first alone.
        trials: M.
        device: where they are.
        low: whether the encoders compute in bfloat16, but for `predict(...,
            exact=True)`.
    """

    def __init__(
        self,
        network: Network,
        roles: Iterable[str],
        trials: int,
        device: torch.device,
        low: bool = False,
    ):
        self.device, self.low = device, low
        with torch.device("meta"):  # shapes without numbers
            parts = {
                "model": DynamicsModel(network, roles=roles),
                "discriminator": Discriminator(network),
            }
        self.modules = nn.ModuleDict(parts)
        self.weights = {
            name: torch.zeros(
                trials,
                *one.shape,
                device=device,
                requires_grad=isinstance(one, nn.Parameter),
            )
            for name, one in tensors_of(self.modules).items()
        }  # e.g. 'model.sidm.lstm.weight_ih_l0': (M, 4 H, K)

    def learnt(self, part: str) -> dict[str, Tensor]:
        """The parameters (M, ...) of a part, e.g. 'model.sidm', by their full names."""
        return {
            n: one
            for n, one in self.weights.items()
            if n.startswith(f"{part}.") and one.requires_grad
        }

    def put(self, trial: int, tensors: Mapping[str, Tensor]) -> None:
        """Make these a trial's weights, (...) each; those that it does not name become 0."""
        with torch.no_grad():
            for name, weights in self.weights.items():
                weights[trial] = tensors.get(name, torch.zeros(()))

    def encode(
        self, who: Who, inputs: Tensor, maps: Tensor, exact: bool = False
    ) -> Tensor:
        """Latent state-actions (M, B, T, latent) of inputs (M, B, T, X), raw units, and maps (M, B, T, P, P), m."""
        if isinstance(who, str):  # one system's weights serve all rows of a trial
            latents = self._encode(
                who, inputs.flatten(1, 2)[:, None], maps.flatten(1, 2)[:, None], exact
            )
            return latents.reshape(*inputs.shape[:3], -1)
        return self._encode(who, inputs, maps, exact)

    def _encode(self, who: Who, inputs: Tensor, maps: Tensor, exact: bool) -> Tensor:
        units = {
            name: self._buffer(f"encoders.{role_of(who)}.{name}", inputs.ndim)
            for name in ("input_mean", "input_std", "map_mean", "map_std")
        }
        rows = (inputs - units["input_mean"]) / units["input_std"]  # (M, B, T, X)
        pixels = (maps.to(inputs.dtype) - units["map_mean"][..., None]) / units[
            "map_std"
        ][..., None]
        # Without the cache of weights in low precision, which a recorded graph would
        # outlive.
        with torch.autocast(
            self.device.type,
            torch.bfloat16,
            enabled=self.low and not exact,
            cache_enabled=False,
        ):
            if pixels.shape[-1]:
                features = self._convolve(who, pixels)
                rows = torch.cat([features, rows.to(features.dtype)], dim=-1)
            return self._dense("encoders", who, rows).to(inputs.dtype)

    def _convolve(self, who: Who, pixels: Tensor) -> Tensor:
        """Map features (M, B, T, 4 (P - 6)^2); every trajectory is convolved with the kernels of its system."""
        kernels, path = {}, f"model.encoders.{role_of(who)}.convolutions"
        for name, mine in within(path, self.weights).items():
            mine = mine[:, None]
            if not isinstance(who, str):
                theirs = self.weights[f"model.encoders.expert.convolutions.{name}"]
                mine = torch.where(trailing(who, mine.ndim), theirs[:, None], mine)
            # (M B, ...)
            kernels[name] = mine.expand(-1, pixels.shape[1], *mine.shape[2:]).flatten(
                0, 1
            )
        module = self.modules.get_submodule(path)
        rows = pixels.flatten(0, 1).unsqueeze(2)  # (M B, T, 1, P, P)
        # numbers a step, rather more
        widest = len(rows) * kernels["0.weight"].shape[1] * pixels.shape[-1] ** 2
        pieces = [
            over(module, kernels, piece)
            for piece in rows.split(max(1, LARGEST // widest), dim=1)
        ]
        # (M B, T, 4, P - 6, P - 6)
        features = torch.cat(pieces, dim=1) if len(pieces) > 1 else pieces[0]
        return features.movedim(2, -1).flatten(2).unflatten(0, pixels.shape[:2])

    def _dense(self, part: str, who: Who, rows: Tensor) -> Tensor:
        """The fully connected layers of 'encoders' or 'decoders' on (M, B, T, .): every trajectory by its system."""
        if isinstance(who, str):
            return self._layers(f"model.{part}.{who}.dense", rows)
        novice, expert = (
            self._layers(f"model.{part}.{role}.dense", rows) for role in ROLES
        )
        return torch.where(trailing(who, rows.ndim), expert, novice)

    def _layers(self, path: str, rows: Tensor) -> Tensor:
        """The module at `path`, each trial with its own weights, on (M, B, T, .)."""
        flat = over(
            self.modules.get_submodule(path),
            within(path, self.weights),
            rows.flatten(1, 2),
        )
        return flat.unflatten(1, rows.shape[1:3])

    def _buffer(self, name: str, ndim: int) -> Tensor:
        """A buffer of the trials, (M, 1, 1, .) for `ndim` of 4."""
        buffer = self.weights[f"model.{name}"]
        return buffer.reshape(len(buffer), *[1] * (ndim - 2), -1)

    def predict(
        self, who: Who, inputs: Tensor, maps: Tensor, exact: bool = False
    ) -> Tensor:
        """State transitions y' (M, B, T, Y), raw units."""
        return self.decode(who, self.transitions(self.encode(who, inputs, maps, exact)))

    def transitions(self, latents: Tensor) -> Tensor:
        """Latent state transitions (M, B, T, 64) of latents (M, B, T, latent)."""
        return self._layers(
            "model.sidm.output", lstm(within("model.sidm.lstm", self.weights), latents)
        )

    def decode(self, who: Who, transitions: Tensor) -> Tensor:
        """State transitions y' (M, B, T, Y), raw units, of latent ones (M, B, T, 64)."""
        scaled, path = (
            self._dense("decoders", who, transitions),
            f"decoders.{role_of(who)}",
        )
        mean, std = (
            self._buffer(f"{path}.{name}", scaled.ndim)
            for name in ("target_mean", "target_std")
        )
        return mean + std * scaled

    def loss_weights(self, role: str) -> Tensor | None:
        """Weights (M, 1, 1, Y) of a system's components in equation (1); None: all 1."""
        name = f"decoders.{role}.weights"
        return self._buffer(name, 4) if f"model.{name}" in self.weights else None

    def logits(self, latents: Tensor) -> Tensor:
        """The discriminators' log odds (M, B, T) of latents (M, B, T, latent)."""
        return self._layers("discriminator.dense", latents).squeeze(-1)


def tensors_of(module: nn.Module) -> dict[str, Tensor]:
    """Parameters and buffers by name, those too that no checkpoint keeps."""
    return {**dict(module.named_parameters()), **dict(module.named_buffers())}


def role_of(who: Who) -> str:
    """Whose shapes and units hold for `who`: where both systems stand in one batch, they have the same."""
    return who if isinstance(who, str) else "novice"


def within(prefix: str, tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """The tensors whose names begin with `prefix` and a dot, by the rest of their names."""
    return {
        name[len(prefix) + 1 :]: one
        for name, one in tensors.items()
        if name.startswith(f"{prefix}.")
    }


def over(module: nn.Module, weights: Mapping[str, Tensor], inputs: Tensor) -> Tensor:
    """`module` with the first, second, ... of weights (M, ...) on the first, second, ... of inputs (M, ...)."""
    return vmap(lambda own, mine: functional_call(module, own, (mine,)))(
        dict(weights), inputs
    )


def trailing(tensor: Tensor, ndim: int) -> Tensor:
    """`tensor` with dimensions of 1 behind its own, `ndim` in all."""
    return tensor.reshape(*tensor.shape, *[1] * (ndim - tensor.ndim))
