"""Training of a method on drives of any body, for `fit` and for real robots."""

from __future__ import annotations

import importlib.util
from collections.abc import Sequence
from typing import Any

from ownrobot.fitting.settings import SETTINGS, Settings
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
from ownrobot.methods.registry import METHODS
from sidm.body import Body
from sidm.config import ConfigError, replace, unknown_name
from sidm.drives import Drive
from sidm.learning.dataset import Datasets, windows_of
from sidm.learning.training import Trained, train
from sidm.learning.units import (
    Standardisation,
    Units,
    default_units,
    loss_weights,
    role_units,
)
from sidm.settings import Network

#: The method of each way to fit that needs no expert.
ALONE = {"least_squares": "least_squares", "trees": "trees", "gaussian_process": "gp"}


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
        others = ALONE.get(config.fit, "")
        kind = "trees" if config.fit == "trees" else "least squares"
        needed = f"corrects the expert's {kind}"
        if config.fit == "gradients" or config.pretrained:
            needed = "copies the expert's encoder and decoder"
            others = "sidm or core_finetune"
        elif config.pooled:
            needed = "learns from the samples of both robots as one"
        raise ConfigError(
            f"{method} {needed}, which needs robots of one body; take {others}"
        )
    require_packages(method)
    if config.fit == "kinematics":
        drivetrain_of(novice, method)  # type: ignore[arg-type]


def network_for(
    settings: Settings, novice: Body, expert: Body | None = None
) -> Network:
    """Networks of the settings' sizes for robots with these bodies."""
    return replace(settings.network, novice_body=novice, expert_body=expert or novice)


def datasets(
    train_part: Sequence[Drive],
    test_part: Sequence[Drive],
    validation: Sequence[Drive],
    expert: Sequence[Drive] | None,
    pixels: int = 0,
) -> Datasets:
    """Drives of equal length as tensors."""
    return Datasets(
        windows_of(train_part, pixels),
        windows_of(test_part, pixels),
        windows_of(validation, pixels),
        None if expert is None else windows_of(expert, pixels),
    )


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
