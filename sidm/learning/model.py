"""The model of Figure 1: encoders and decoders around one SIDM, and shared weights."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Mapping

import torch
from torch import Tensor, nn

from sidm.config import ConfigError
from sidm.learning.dataset import Windows
from sidm.learning.losses import prediction_loss
from sidm.learning.networks import SIDM, Decoder, Encoder, Memory, seeded
from sidm.learning.units import Units, role_units
from sidm.settings import Network
from sidm.systems import ROLES

#: `Network.own` -> how the names of a part's parameters end that are a system's own
OWN = {"none": (), "biases": ("bias",), "flag": ("dense.0.bias",)}


class Predictor(nn.Module):
    """A model of the transitions of systems: model(role, inputs, maps, memory)."""

    @property
    def device(self) -> torch.device:
        """The device that the weights are on."""
        return next(self.parameters()).device

    def loss_weights(self, role: str) -> Tensor | None:
        """Weights (Y,) of a system's components in equation (1); None: all are 1."""
        return None


class DynamicsModel(Predictor):
    """Figure 1: an encoder and a decoder for each system around one SIDM.

    Args:
        network: sizes of all parts.
        standardisation: units of inputs and outputs, one for all systems or one for
            each; raw units by default.
        seed: of the initial weights. Each part draws from its own stream, so that its
            weights do not depend on the other parts.
        roles: the systems, 'novice' and 'expert' or one of them.
    """

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

        def build(part: type[nn.Module], name: str) -> nn.ModuleDict:
            parts = nn.ModuleDict()
            for role in roles:
                units = standardisation and role_units(standardisation, role)
                make = functools.partial(part, network, units, network.body(role))
                parts[role] = seeded(seed, f"{role} {name}", make)
            return parts

        self.encoders = build(encoder, "encoder")
        self.sidm = seeded(seed, "sidm", lambda: sidm(network))
        self.decoders = build(decoder, "decoder")
        if len(roles) > 1 and network.own != "all":
            own = OWN[network.own]
            share(self.encoders["expert"], self.encoders["novice"], own)
            in_decoder = () if network.own == "flag" else own
            share(self.decoders["expert"], self.decoders["novice"], in_decoder)

    def forward(
        self, role: str, inputs: Tensor, maps: Tensor, memory: Memory | None = None
    ) -> tuple[Tensor, Memory]:
        """Predict the transitions of one system.

        Args:
            role: 'novice' or 'expert'.
            inputs: (B, T, X), raw units.
            maps: (B, T, P, P), m.
            memory: the SIDM's after the step before; None where trajectories begin.

        Returns:
            State transitions y' (B, T, Y) in raw units, and the SIDM's last memory.

        Raises:
            ConfigError: a system that the model does not have.
        """
        self._refuse_unknown(role)
        transitions, memory = self.sidm(self.encoders[role](inputs, maps), memory)
        return self.decoders[role](transitions), memory

    def _refuse_unknown(self, role: str) -> None:
        if role not in self.encoders:
            known = ", ".join(self.encoders)
            raise ConfigError(f"this model has {known}, not {role!r}")

    def loss_weights(self, role: str) -> Tensor | None:
        """Weights (Y,) of a system's components in equation (1); None: all are 1."""
        self._refuse_unknown(role)
        return self.decoders[role].weights  # type: ignore[return-value]

    def encode(self, role: str, windows: Windows) -> Tensor:
        """Latent state-actions (B, T, latent) of a system's windows."""
        return self.encoders[role](windows.inputs, windows.maps)

    def latents(self, batch: Mapping[str, Windows]) -> dict[str, Tensor]:
        """Latents (B, T, latent) of several systems' windows, by system."""
        return {role: self.encode(role, windows) for role, windows in batch.items()}

    def losses(
        self, batch: Mapping[str, Windows], latents: Mapping[str, Tensor]
    ) -> dict[str, Tensor]:
        """Equation (1) for each sample, (B, T), of several systems' windows, by system.

        The SIDM sees the latents (B, T, latent) of all systems as one batch.
        """
        transitions, _ = self.sidm(torch.cat(list(latents.values())))
        parts = transitions.split([len(windows) for windows in batch.values()])
        losses = {}
        for (role, windows), part in zip(batch.items(), parts, strict=True):
            predicted, weights = self.decoders[role](part), self.loss_weights(role)
            losses[role] = prediction_loss(predicted, windows.targets, weights)
        return losses

    def initialise_from(self, weights: Mapping[str, Tensor]) -> None:
        """Load initial weights by name.

        Where the expert's encoder and decoder are missing, they become copies of the
        novice's. Where there is only the SIDM, encoders and decoders stay as they are.
        """
        before = self.state_dict()
        if all(name.startswith("sidm.") for name in weights):
            weights = before | dict(weights)
        for name in before:
            source = name if name in weights else name.replace(".expert.", ".novice.")
            before[name] = weights[source]
        self.load_state_dict(before)


def share(part: nn.Module, other: nn.Module, own: tuple[str, ...]) -> None:
    """Give `part` the parameters of `other`, but those with a name that ends in `own`.

    Both have the same structure; training then changes the shared parameters for both.
    """
    for name, parameter in other.named_parameters():
        if not name.endswith(own):
            layer, _, leaf = name.rpartition(".")
            setattr(part.get_submodule(layer), leaf, parameter)
