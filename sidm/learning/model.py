"""The whole of Figure 1: encoders, one system invariant dynamics model, decoders; and what the systems may share."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Mapping

import torch
from torch import Tensor, nn

from sidm.config import ConfigError
from sidm.learning.dataset import Windows
from sidm.learning.losses import prediction_loss
from sidm.learning.networks import SIDM, Decoder, Encoder, Memory, seeded
from sidm.learning.units import Units, units_for
from sidm.settings import Network
from sidm.systems import ROLES

#: whether each system has the parameter of that name for itself
Own = Callable[[str], bool]

OWN_OF_DECODER: dict[str, Own] = {
    "none": lambda name: False,
    "flag": lambda name: False,
    "biases": lambda name: name.endswith("bias"),
}
OWN_OF_ENCODER: dict[str, Own] = OWN_OF_DECODER | {
    "flag": lambda name: name == "dense.0.bias"
}


class Predictor(nn.Module):
    """What predicts the transitions of one system or more: called as DynamicsModel is."""

    @property
    def device(self) -> torch.device:
        """Where the weights are."""
        return next(self.parameters()).device

    def loss_weights(self, role: str) -> Tensor | None:
        """Weights (Y,) of a system's components in equation (1); None: all 1, as in the paper's body."""
        return None


class DynamicsModel(Predictor):
    """Figure 1: an encoder and a decoder for each system around one SIDM.

    Args:
        network: the sizes.
        standardisation: units of inputs and outputs, of all systems or of each; none by
            default.
        seed: of the initial weights; each part has its own, so that parts are equal
            whatever else the model has.
        roles: the systems, 'novice' and 'expert' or one of them.
    """

    # Encoder, SIDM and decoder.
    _parts: tuple[type[Encoder], type[SIDM], type[Decoder]] = (Encoder, SIDM, Decoder)

    def __init__(
        self,
        network: Network,
        standardisation: Units | None = None,
        seed: int = 0,
        roles: Iterable[str] = ROLES,
    ):
        super().__init__()
        roles = tuple(roles)
        encoder, sidm, decoder = self._parts
        units = {
            role: None if standardisation is None else units_for(standardisation, role)
            for role in roles
        }

        def drawn(part: type[nn.Module], name: str, role: str) -> nn.Module:
            make = functools.partial(part, network, units[role], network.body(role))
            return seeded(seed, f"{role} {name}", make)

        self.encoders = nn.ModuleDict({r: drawn(encoder, "encoder", r) for r in roles})
        self.sidm = seeded(seed, "sidm", lambda: sidm(network))
        self.decoders = nn.ModuleDict({r: drawn(decoder, "decoder", r) for r in roles})
        if len(roles) > 1 and network.own != "all":
            for parts, own in (
                (self.encoders, OWN_OF_ENCODER),
                (self.decoders, OWN_OF_DECODER),
            ):
                share(parts["expert"], parts["novice"], own[network.own])

    def forward(
        self, role: str, inputs: Tensor, maps: Tensor, memory: Memory | None = None
    ) -> tuple[Tensor, Memory]:
        """Predictions of one system.

        Args:
            role: 'novice' or 'expert'.
            inputs: (B, T, X), raw units.
            maps: (B, T, P, P), m.
            memory: of the SIDM after the step before; None where the trajectories
                begin.

        Returns:
            State transitions y' (B, T, Y) in raw units, and the memory after the last
            step.

        Raises:
            ConfigError: a system that the model does not have.
            ValueError: wrong shapes.
        """
        if role not in self.encoders:
            raise ConfigError(
                f"this model has {', '.join(self.encoders)}, not {role!r}"
            )
        transitions, memory = self.sidm(self.encoders[role](inputs, maps), memory)
        return self.decoders[role](transitions), memory

    def loss_weights(self, role: str) -> Tensor | None:
        """Weights (Y,) of a system's components in equation (1); None: all 1, as in the paper's body."""
        return self.decoders[role].weights  # type: ignore[return-value]

    def encode(self, role: str, batch: Windows) -> Tensor:
        """Latent state-actions (b, T, latent) of a system's windows."""
        return self.encoders[role](batch.inputs, batch.maps)

    def loss(self, role: str, batch: Windows) -> Tensor:
        """Equation (1) for each sample of a system's windows, (b, T)."""
        return self.losses({role: batch}, {role: self.encode(role, batch)})[role]

    def losses(
        self, batch: Mapping[str, Windows], latents: Mapping[str, Tensor]
    ) -> dict[str, Tensor]:
        """Equation (1) for each sample of windows of several systems: `loss` of each, with the SIDM seeing all at once.

        Args:
            batch: windows by system.
            latents: what `encode` makes of them.

        Returns:
            Losses (b, T) by system.
        """
        transitions, _ = self.sidm(torch.cat(list(latents.values())))
        parts = transitions.split([len(windows) for windows in batch.values()])
        return {
            role: prediction_loss(
                self.decoders[role](part), windows.targets, self.loss_weights(role)
            )
            for (role, windows), part in zip(batch.items(), parts, strict=True)
        }

    def start(self, weights: Mapping[str, Tensor]) -> None:
        """Take over weights; from those of a model that has the novice's parts alone, the expert's become copies.

        Weights of the SIDM alone leave encoders and decoders as they are.
        """
        own = self.state_dict()
        if all(name.startswith("sidm.") for name in weights):
            weights = own | dict(weights)
        self.load_state_dict(
            {
                n: weights[n if n in weights else n.replace(".expert.", ".novice.")]
                for n in own
            }
        )


def share(part: nn.Module, other: nn.Module, own: Own) -> None:
    """Let `part` learn with the parameters of its like, `other`, but for those that are its `own`."""
    for name, parameter in other.named_parameters():
        if not own(name):
            layer, _, leaf = name.rpartition(".")
            setattr(part.get_submodule(layer), leaf, parameter)
