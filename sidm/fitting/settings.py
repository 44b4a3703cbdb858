"""What recorded robots are learnt with: sizes of the networks, a training, and what methods were tuned to."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from sidm.config import config, replace, unknown_name
from sidm.rivals.methods import Method
from sidm.settings import Network, Training


@config
class Settings:
    """Networks and training of every method."""

    network: Network
    training: Training
    #: method, setting of its training, value instead of `training`'s
    tuned: tuple[tuple[str, str, Any], ...] = ()

    def tuned_values(self, method: str) -> dict[str, Any]:
        """The settings that a method was tuned to, by name."""
        return {setting: value for name, setting, value in self.tuned if name == method}

    def training_of(self, method: Method) -> Training:
        """A method's training on the novice, with what the method was tuned to."""
        return method.training(self.training, self.tuned_values(method.tuned_as))

    def with_values(self, values: Mapping[str, Any]) -> Settings:
        """The settings with single values of network or training changed by name, for every method.

        Raises:
            ConfigError: an unknown name, with the nearest right one, or a value of the
                wrong type. `regularise` is the method's to set, and bodies are the
                robots'; neither is known here.
        """
        sizes = {
            field.name
            for field in dataclasses.fields(Network)
            if not field.name.endswith("_body")
        }  # type: ignore
        choices = {field.name for field in dataclasses.fields(Training)} - {
            "regularise"
        }  # type: ignore[arg-type]
        for name in values:
            if name not in sizes | choices:
                raise unknown_name(
                    name, sorted(sizes | choices), "networks and training"
                )
        return Settings(
            network=replace(
                self.network,
                **{name: value for name, value in values.items() if name in sizes},
            ),
            training=replace(
                self.training,
                **{name: value for name, value in values.items() if name in choices},
            ),
            tuned=tuple(one for one in self.tuned if one[1] not in values),
        )


#: Networks and patience for minutes of motion of robots that see no ground, the same
#: for every method. The share of the expert is the paper's for robots that are alike,
#: p_e = 0.75; what methods are tuned to was chosen on system 1.
SETTINGS = Settings(
    network=Network(pixels=32, layers=1, hidden=128),
    training=Training(
        batch=16,
        discriminator_batch=16,
        matching_batch=16,
        patience=100_000,
        max_samples=1_500_000,
    ),
    tuned=(
        ("novice_only", "weight_decay", 0.1),
        ("sidm", "matching_iterations", 5),
        ("pretrain_finetune", "learning_rate", 1e-4),
    ),
)


def settings_with(
    network: Network | None = None,
    training: Training | None = None,
    values: Mapping[str, Any] = MappingProxyType({}),
) -> Settings:
    """SETTINGS with networks and a training of your own.

    Args:
        network: the sizes; the robots' bodies are put in.
        training: of every method, in place of what each was tuned to; `regularise` is
            the method's, and `p_expert` holds where the method learns from the expert's
            drives.
        values: single settings of both by name, as `{"hidden": 64, "p_expert": 0.5}`;
            the others stay as they are.

    Raises:
        ConfigError: a name or a value that is not known.
    """
    chosen: Settings = SETTINGS
    if network is not None:
        chosen = replace(chosen, network=network)
    if training is not None:
        chosen = replace(chosen, training=training, tuned=())
    return chosen.with_values(values)
