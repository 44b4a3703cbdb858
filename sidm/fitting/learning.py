"""Training of a method on drives of any body, for `sidm fit` and for real robots."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from sidm.body import Body
from sidm.config import ConfigError, replace, unknown_name
from sidm.drives import Drive
from sidm.fitting.settings import SETTINGS, Settings
from sidm.learning.dataset import Datasets, windows_of
from sidm.learning.training import Progress, Trained, train
from sidm.learning.units import (
    Standardisation,
    Units,
    default_units,
    loss_weights,
    role_units,
)
from sidm.rivals.fine_tuning import (
    Pretrained,
    frozen_model,
    pretrained_from,
    pretraining_datasets,
)
from sidm.rivals.least_squares import fit as fit_least_squares
from sidm.rivals.methods import METHODS
from sidm.settings import Network


def refuse_method(method: str, novice: Body, expert: Body | None) -> None:
    """Raise ConfigError for a method that is unknown or cannot learn these robots."""
    if method not in METHODS:
        raise unknown_name(method, METHODS, "the methods of 'sidm fit'")
    config = METHODS[method]
    if (config.expert or config.pretrained) and expert is None:
        raise ConfigError(
            f"{method} learns from an expert's drives too: "
            "pass them, or take novice_only"
        )
    network = Network(novice_body=novice, expert_body=expert)
    if config.pretrained and config.carried == "all" and not network.same_body:
        raise ConfigError(
            f"{method} copies the expert's encoder and decoder, "
            "which needs robots of one body; take sidm or core_finetune"
        )


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
    """Drives of equal length as tensors.

    Args:
        train_part: the novice's drives to learn from.
        test_part: the novice's drives for the test that stops the training.
        validation: the novice's drives to evaluate on.
        expert: the expert's drives, if there is an expert.
        pixels: side of the height maps where the body does not set it.
    """
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
) -> Pretrained | None:
    """Weights learnt from the expert alone, which a method starts from.

    The arguments are those of `learn`.

    Returns:
        The weights, or None for a method that starts from random weights.
    """
    _refuse_method_of(method, sets, network)
    training = METHODS[method].pretraining(settings.training)
    if training is None:
        return None
    alone = replace(network, novice_body=network.expert_body)
    expert = pretraining_datasets(sets, seed)
    return pretrained_from(
        train(expert, alone, training, seed, checkpoint=folder, progress=progress)
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
) -> Trained:
    """Train a method on recorded robots.

    Args:
        method: a name in METHODS.
        sets: the novice's drives, and the expert's where the method learns from them.
        network: networks with the robots' bodies.
        seed: seed of initial weights and batches.
        settings: networks and training.
        start: the weights that `pretrain` returned.
        folder: folder for the state of an unfinished training, which is resumed.
        progress: called after each test.

    Returns:
        The trained model with its losses.

    Raises:
        ConfigError: the method cannot learn these robots.
    """
    _refuse_method_of(method, sets, network)
    config, units = METHODS[method], units_in(sets, network)
    if start is not None and config.carried == "sidm":
        start = start.core()
    if config.fit == "least_squares":
        novice_units = role_units(units, "novice")
        base = None if start is None else frozen_model(network, start, novice_units)
        scale = loss_weights(network.body("novice"), novice_units)
        return fit_least_squares(sets, novice_units, base, scale=scale)
    return train(
        sets,
        network,
        settings.training_of(config),
        seed,
        standardisation=units,
        checkpoint=folder,
        progress=progress,
        start=None if start is None else start.weights,
    )
