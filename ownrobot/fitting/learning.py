"""Training of a method on drives of any body, and the settings that it has."""

from __future__ import annotations

import dataclasses
import importlib.util
from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

from ownrobot.methods import boosting, gaussian_process, kinematics
from ownrobot.methods import least_squares as squares
from ownrobot.methods.closed_form import learn_trivial
from ownrobot.methods.drivetrain import drivetrain_of
from ownrobot.methods.fine_tuning import (
    Pretrained,
    frozen_model,
    pretrained_from,
    pretraining_datasets,
)
from ownrobot.methods.pooled import Pooled, pooled_datasets, pooled_units
from ownrobot.methods.registry import METHODS, Method
from sidm.body import Body
from sidm.config import ConfigError, config, replace, unknown_name
from sidm.learning.dataset import Datasets
from sidm.learning.training import Trained, train
from sidm.learning.units import (
    Standardisation,
    Units,
    default_units,
    loss_weights,
    role_units,
)
from sidm.settings import Network, Training

#: The method of each way to fit that needs no expert.
ALONE = {"least_squares": "least_squares", "trees": "trees", "gaussian_process": "gp"}

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


def require_packages(method: str) -> None:
    """Raise ConfigError, one line, where a package that a method needs is missing."""
    needed = METHODS[method].fit in ("trees", "gaussian_process")
    if needed and importlib.util.find_spec("sklearn") is None:
        raise ConfigError(f'{method} needs scikit-learn: pip install "sidm[trees]"')


def refuse_method(method: str, novice: Body, expert: Body | None) -> None:
    """Raise ConfigError for a method that is unknown or cannot learn these robots."""
    if method not in METHODS:
        raise unknown_name(method, METHODS, kind="method")
    config = METHODS[method]
    if config.needs_expert and expert is None:
        alone = ALONE.get(config.fit, "novice_only")
        if config.pretrained:
            alone = "novice_only"
        raise ConfigError(
            f"{method} learns from an expert's drives too: pass them, or take {alone}"
        )
    network = Network(novice_body=novice, expert_body=expert)
    if config.needs_one_body and not network.same_body:
        others = "sidm or core_finetune" if config.pretrained else ALONE[config.fit]
        raise ConfigError(
            f"{method} ({config.label}) needs robots of one body; take {others}"
        )
    require_packages(method)
    if config.fit == "kinematics":
        drivetrain_of(novice, method)  # type: ignore[arg-type]


def network_for(
    settings: Settings, novice: Body, expert: Body | None = None
) -> Network:
    """Networks of the settings' sizes for robots with these bodies."""
    return replace(settings.network, novice_body=novice, expert_body=expert or novice)


def units_in(sets: Datasets, network: Network) -> Units:
    """Units inside the networks; without an expert they come from the novice alone."""
    if sets.expert is None:
        return {"novice": Standardisation.fit(sets.train)}
    return default_units(sets, network)


def pretrain(
    method: str,
    sets: Datasets,
    network: Network,
    seed: int = 0,
    settings: Settings = SETTINGS,
    **running: Any,
) -> Pretrained:
    """Weights of a pretrained method learnt from the expert alone, as by `learn`."""
    training = METHODS[method].pretraining(settings.training)
    assert training is not None
    alone = replace(network, novice_body=network.expert_body)
    expert = pretraining_datasets(sets, seed)
    return pretrained_from(train(expert, alone, training, seed, **running))


def learn(
    method: str,
    sets: Datasets,
    network: Network,
    seed: int = 0,
    settings: Settings = SETTINGS,
    start: Pretrained | None = None,
    **running: Any,
) -> Trained:
    """Train a method of METHODS that `refuse_method` lets learn these robots.

    `start` has the weights that `pretrain` returned; `running` is `checkpoint`,
    `progress` and `device` of `sidm.train`.
    """
    config, units = METHODS[method], units_in(sets, network)
    if start is not None and config.carried == "sidm":
        start = start.core()
    if config.fit != "gradients":
        return _learn_without_loop(method, sets, network, units, seed, start)
    return train(
        sets,
        network,
        settings.training_of(config),
        seed,
        standardisation=units,
        start=None if start is None else start.weights,
        **running,
    )


def _learn_without_loop(
    method: str,
    sets: Datasets,
    network: Network,
    units: Units,
    seed: int,
    start: Pretrained | None,
) -> Trained:
    """The model of a method that does not use the training loop."""
    config, body = METHODS[method], network.body("novice")
    own = role_units(units, "novice")
    scale, pooled = loss_weights(body, own), config.pooled
    name: Any = method  # the models of these methods have the methods' names
    if config.fit == "trivial":
        return learn_trivial(sets, body, name, scale)
    if config.fit == "kinematics":
        return kinematics.identify(sets, body, name, scale)
    if pooled:
        sets, own = pooled_datasets(sets, seed), pooled_units(own)
    if config.fit == "trees":
        trained = boosting.learn(sets, body, scale, config.residual, pooled, seed)
    else:
        base: Any = None
        if start is not None:
            base = frozen_model(network, start, own)
        elif config.residual:
            alone = pretraining_datasets(sets, seed)
            base = squares.fit(alone, own, scale=scale).model.requires_grad_(False)
        if config.fit == "gaussian_process":
            trained = gaussian_process.learn(sets, body, scale, base, pooled, seed)
        else:
            further = sets.expert if pooled else None
            trained = squares.fit(sets, own, base, scale=scale, further=further)
    if pooled:
        return trained._replace(model=Pooled(trained.model).eval())
    return trained
