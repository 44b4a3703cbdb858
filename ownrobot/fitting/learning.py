"""Training of a method on drives of any body, for `fit` and for real robots."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from torch import Tensor

from ownrobot.fitting.settings import SETTINGS, Settings
from ownrobot.methods import boosting, gaussian_fitting, kinematics, trivial
from ownrobot.methods.drivetrain import drivetrain_of
from ownrobot.methods.fine_tuning import (
    Pretrained,
    frozen_model,
    pretrained_from,
    pretraining_datasets,
)
from ownrobot.methods.least_squares import fit as fit_least_squares
from ownrobot.methods.pooled import Pooled, pooled_datasets, pooled_units
from ownrobot.methods.registry import METHODS, Method
from sidm.body import Body
from sidm.config import ConfigError, replace, unknown_name
from sidm.drives import Drive
from sidm.learning.dataset import Datasets, windows_of
from sidm.learning.trainer import Progress
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
    if METHODS[method].fit in ("trees", "gaussian_process"):
        boosting.require_scikit_learn(method)


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
        if config.fit == "gradients" or config.pretrained:
            needed = "copies the expert's encoder and decoder"
            others = "sidm or core_finetune"
        else:
            others = ALONE[config.fit]
            kind = "trees" if config.fit == "trees" else "least squares"
            needed = f"corrects the expert's {kind}"
            if config.pooled:
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
    train_windows, test_windows, validation_windows = (
        windows_of(drives, pixels) for drives in (train_part, test_part, validation)
    )
    expert_windows = None if expert is None else windows_of(expert, pixels)
    return Datasets(train_windows, test_windows, validation_windows, expert_windows)


def units_in(sets: Datasets, network: Network) -> Units:
    """Units inside the networks; without an expert they come from the novice alone."""
    if sets.expert is None:
        return {"novice": Standardisation.fit(sets.train)}
    return default_units(sets, network)


def _refuse_method_of(method: str, sets: Datasets, network: Network) -> None:
    expert = None if sets.expert is None else network.body("expert")
    refuse_method(method, network.body("novice"), expert)


def pretrain(
    method: str,
    sets: Datasets,
    network: Network,
    seed: int = 0,
    settings: Settings = SETTINGS,
    folder: Path | None = None,
    progress: Progress | None = None,
    device: str = "cpu",
) -> Pretrained | None:
    """Weights learnt from the expert alone, or None for a method that has none.

    The arguments are those of `learn`.
    """
    _refuse_method_of(method, sets, network)
    training = METHODS[method].pretraining(settings.training)
    if training is None:
        return None
    alone = replace(network, novice_body=network.expert_body)
    expert = pretraining_datasets(sets, seed)
    running: dict[str, Any] = {"checkpoint": folder, "progress": progress}
    return pretrained_from(
        train(expert, alone, training, seed, device=device, **running)
    )


def learn(
    method: str,
    sets: Datasets,
    network: Network,
    seed: int = 0,
    settings: Settings = SETTINGS,
    start: Pretrained | None = None,
    folder: Path | None = None,
    progress: Progress | None = None,
    device: str = "cpu",
) -> Trained:
    """Train a method of METHODS on recorded robots.

    `start` has the weights that `pretrain` returned; an unfinished training in `folder`
    is resumed.
    """
    _refuse_method_of(method, sets, network)
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
        checkpoint=folder,
        progress=progress,
        device=device,
        start=None if start is None else start.weights,
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
    novice_units = role_units(units, "novice")
    scale = loss_weights(body, novice_units)
    if config.fit in ALONE and not config.pretrained:
        return _learn_regression(config, sets, body, novice_units, scale, seed)
    model: Any = method  # the models of these methods have the methods' names
    if config.fit == "trivial":
        return trivial.learn(sets, body, model, scale)
    if config.fit == "kinematics":
        return kinematics.identify(sets, body, model, scale)
    base = None if start is None else frozen_model(network, start, novice_units)
    return fit_least_squares(sets, novice_units, base, scale=scale)


def _learn_regression(
    config: Method,
    sets: Datasets,
    body: Body,
    units: Standardisation,
    scale: Tensor | None,
    seed: int,
) -> Trained:
    """A regression of the novice, on the expert's, or of both robots' samples."""
    if config.pooled:
        sets, units = pooled_datasets(sets, seed), pooled_units(units)
    base = None
    if config.residual and config.fit != "trees":
        expert = pretraining_datasets(sets, seed)
        base = fit_least_squares(expert, units, scale=scale).model.requires_grad_(False)
    pooled = config.pooled
    if config.fit == "trees":
        trained = boosting.learn(sets, body, scale, config.residual, pooled, seed)
    elif config.fit == "gaussian_process":
        trained = gaussian_fitting.learn(sets, body, scale, base, pooled, seed)
    else:
        further = sets.expert if pooled else None
        trained = fit_least_squares(sets, units, base, scale=scale, further=further)
    if pooled:
        return trained._replace(model=Pooled(trained.model).eval())
    return trained
