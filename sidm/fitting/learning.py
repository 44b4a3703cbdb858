"""A method's training on drives of any body: what `sidm fit` runs, and the study of real robots."""

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
    loss_weights,
    units_for,
    units_of,
)
from sidm.rivals.fine_tuning import Start, expert_in_place, frozen, start_from
from sidm.rivals.least_squares import fit as fit_least_squares
from sidm.rivals.methods import METHODS
from sidm.settings import Network


def refuse_method(method: str, novice: Body, expert: Body | None) -> None:
    """ConfigError for a method that is not known, or not for such robots."""
    if method not in METHODS:
        raise unknown_name(method, METHODS, "the methods of 'sidm fit'")
    one = METHODS[method]
    if (one.expert or one.pretrained) and expert is None:
        raise ConfigError(
            f"{method} learns from an expert's drives too: name them, or take novice_only"
        )
    network = Network(novice_body=novice, expert_body=expert)
    if one.pretrained and one.carried == "all" and not network.alike:
        raise ConfigError(
            f"{method} copies the expert's encoder and decoder, which needs robots of one body; "
            "take sidm or core_finetune"
        )


def network_for(chosen: Settings, novice: Body, expert: Body | None = None) -> Network:
    """The networks around robots of these bodies."""
    return replace(chosen.network, novice_body=novice, expert_body=expert or novice)


def datasets(
    train_part: Sequence[Drive],
    test_part: Sequence[Drive],
    validation: Sequence[Drive],
    expert: Sequence[Drive] | None,
    pixels: int = 0,
) -> Datasets:
    """What a method learns from and is judged by, with maps of `pixels` a side where a body does not say how many."""
    own, stops, judges = (
        windows_of(part, pixels) for part in (train_part, test_part, validation)
    )
    return Datasets(
        own, stops, judges, None if expert is None else windows_of(expert, pixels)
    )


def units_in(sets: Datasets, network: Network) -> Units:
    """Units inside the networks: `units_of`, or the novice's own where it is alone."""
    return (
        {"novice": Standardisation.of(sets.train)}
        if sets.expert is None
        else units_of(sets, network)
    )


def pretrain(
    method: str,
    sets: Datasets,
    network: Network,
    seed: int = 0,
    chosen: Settings = SETTINGS,
    folder: Path | None = None,
    progress: Progress | None = None,
) -> Start | None:
    """The weights that a method starts from, of the expert alone; None for one that begins afresh. As of `learn`."""
    refuse_method(
        method,
        network.body("novice"),
        None if sets.expert is None else network.body("expert"),
    )
    training = METHODS[method].pretraining(chosen.training)
    if training is None:
        return None
    alone = replace(network, novice_body=network.expert_body)
    expert = expert_in_place(sets, seed)
    return start_from(
        train(expert, alone, training, seed, checkpoint=folder, progress=progress)
    )


def learn(
    method: str,
    sets: Datasets,
    network: Network,
    seed: int = 0,
    chosen: Settings = SETTINGS,
    start: Start | None = None,
    folder: Path | None = None,
    progress: Progress | None = None,
) -> Trained:
    """Train a method on recorded robots.

    Args:
        method: one of METHODS.
        sets: the novice's, and the expert's where the method wants it.
        network: of the robots' bodies.
        seed: of initial weights and batches.
        chosen: the settings.
        start: what `pretrain` gave.
        folder: of the state of an unfinished training, to go on from.
        progress: called after each test.

    Raises:
        ConfigError: a method for other robots than these.
    """
    refuse_method(
        method,
        network.body("novice"),
        None if sets.expert is None else network.body("expert"),
    )
    one, units = METHODS[method], units_in(sets, network)
    if start is not None and one.carried == "sidm":
        start = start.core()
    if one.fit == "least_squares":
        own = units_for(units, "novice")
        base = None if start is None else frozen(network, start, own)
        return fit_least_squares(
            sets, own, base, scale=loss_weights(network.body("novice"), own)
        )
    weights = None if start is None else start.weights
    training = chosen.training_of(one)
    return train(
        sets,
        network,
        training,
        seed,
        standardisation=units,
        checkpoint=folder,
        progress=progress,
        start=weights,
    )
