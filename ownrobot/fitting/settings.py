"""Settings to fit recorded robots with: network sizes, training, and tuned values."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

from ownrobot.methods.registry import METHODS, Method
from sidm.body import Body
from sidm.config import config, replace, unknown_name
from sidm.settings import Network, Training

#: Settings of what encodes a height map.
MAPS = {"pixels", "channels", "kernel"}
NOTHING: Mapping[str, Any] = MappingProxyType({})


@config
class Settings:
    """Networks and training of every method."""

    network: Network
    training: Training
    #: (method, name of a training setting, value that replaces `training`'s)
    tuned: tuple[tuple[str, str, Any], ...] = ()

    def training_of(self, method: Method) -> Training:
        """A method's training on the novice, with the method's tuned values."""
        tuned = {name: v for owner, name, v in self.tuned if owner == method.tuned_as}
        return method.training(self.training, tuned)

    def with_values(self, values: Mapping[str, Any]) -> Settings:
        """The settings with new values of some fields of network or training, by name.

        The values hold for every method: they replace tuned values, too. The method
        sets `regularise` and the robots' drives set the bodies, so neither can be
        given.
        """
        network, training = (
            {field.name for field in dataclasses.fields(kind)}  # type: ignore[arg-type]
            for kind in (Network, Training)
        )
        network = {name for name in network if not name.endswith("_body")}
        known = network | training - {"regularise"}
        for name in values:
            if name not in known:
                raise unknown_name(name, sorted(known), kind="setting")
        sizes = {name: value for name, value in values.items() if name in network}
        others = {name: value for name, value in values.items() if name in training}
        return Settings(
            network=replace(self.network, **sizes),
            training=replace(self.training, **others),
            tuned=tuple(entry for entry in self.tuned if entry[1] not in values),
        )


#: For minutes of motion of robots that see no ground; the same networks and patience
#: for every method. `p_expert` is the paper's p_e = 0.75 for similar robots (Training's
#: default). The tuned values were chosen on system 1.
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
    values: Mapping[str, Any] = NOTHING,
) -> Settings:
    """SETTINGS with other networks, another training or single other values by name.

    A training replaces tuned values, too; its `p_expert` holds for methods that learn
    from the expert's drives.
    """
    settings: Settings = SETTINGS
    if network is not None:
        settings = replace(settings, network=network)
    if training is not None:
        settings = replace(settings, training=training, tuned=())
    return settings.with_values(values)


def without_effect(
    methods: Sequence[str], values: Iterable[str], body: Body, device: str = "cpu"
) -> str:
    """A line that names settings which change nothing in any of some methods, or ''."""
    configs = [METHODS[name] for name in methods]
    unused = [
        name
        for name in values
        if not any(config.uses(name) for config in configs)
        or (name in MAPS and not body.map_size)
    ]
    if device != "cpu" and not any(config.uses("hidden") for config in configs):
        unused.append(f"device {device}")
    if not unused:
        return ""
    return f"{', '.join(unused)}: without effect on {', '.join(methods)}"
