"""A method's training on drives of any body: what `sidm fit` runs, and the study of real robots."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from sidm.body import Body
from sidm.config import ConfigError, unknown_name
from sidm.experiments.engine.execute import frozen
from sidm.experiments.methods import CORES, METHODS
from sidm.experiments.presets import Preset, load_preset
from sidm.learning.beyond.least_squares import fit as fit_least_squares
from sidm.learning.beyond.pretraining import Start, expert_in_place, start_from
from sidm.learning.beyond.recorded import Pieces
from sidm.learning.dataset import Datasets
from sidm.learning.settings import Network, Training
from sidm.learning.training import Progress, Trained, train
from sidm.learning.units import Standardisation, Units, loss_weights, units_for, units_of

#: Methods that recorded robots are learnt by.
FITTED = (
    "novice_only", "sidm", "no_regularisation", *CORES, "pretrain_finetune", "expert_only", "least_squares", "corrected"
)  # fmt: skip

#: Networks and patience for minutes of motion of robots that see no ground, the same for every method. The share of the
#: expert is the paper's for robots that are alike, p_e = 0.75.
SETTINGS = load_preset("laptop").replace(
    layers=1, hidden=128, batch=16, discriminator_batch=16, matching_batch=16, patience=100_000, max_samples=1_500_000
)


def refuse_method(method: str, novice: Body, expert: Body | None) -> None:
    """ConfigError for a method that is not known, or not for such robots."""
    if method not in FITTED:
        raise unknown_name(method, FITTED, "the methods of 'sidm fit'")
    one = METHODS[method]
    if (one.expert or one.pretrained) and expert is None:
        raise ConfigError(f"{method} learns from an expert's drives too: name them, or take novice_only")
    network = Network(novice_body=novice, expert_body=expert)
    if one.pretrained and one.carried == "all" and not network.alike:
        raise ConfigError(
            f"{method} copies the expert's encoder and decoder, which needs robots of one body; "
            "take sidm or core_finetune"
        )


def settings(
    network: Network | None = None, training: Training | None = None, values: Mapping[str, Any] = MappingProxyType({})
) -> Preset:
    """SETTINGS with networks and a training of one's own.

    Args:
        network: the sizes; the robots' bodies are put in.
        training: of every method, in place of what each was tuned to; `regularise` is the method's, and `p_expert`
            holds where the method learns from the expert's drives.
        values: single settings of both by name, as `{"hidden": 64, "p_expert": 0.5}`; the others stay as they are.

    Raises:
        ConfigError: a name or a value that is not known.
    """
    preset: Preset = SETTINGS
    if network is not None:
        preset = dataclasses.replace(preset, network=network)  # type: ignore[type-var]
    if training is not None:
        preset = dataclasses.replace(  # type: ignore[type-var]
            preset, training=training, tuned=(), p_expert_system1=training.p_expert
        )
    names = {"p_expert": "p_expert_system1"}
    return preset.replace(**{names.get(name, name): value for name, value in values.items()})


def network_for(preset: Preset, novice: Body, expert: Body | None = None) -> Network:
    """The preset's networks around robots of these bodies."""
    return dataclasses.replace(preset.network, novice_body=novice, expert_body=expert or novice)  # type: ignore


def datasets(
    train_part: Pieces, test_part: Pieces, validation: Pieces, expert: Pieces | None, pixels: int = 0
) -> Datasets:
    """What a method learns from and is judged by, with maps of `pixels` a side where a body does not say how many."""
    own, stops, judges = (part.motion(pixels) for part in (train_part, test_part, validation))
    return Datasets(own, stops, judges, None if expert is None else expert.motion(pixels))


def units_in(sets: Datasets, network: Network) -> Units:
    """Units inside the networks: `units_of`, or the novice's own where it is alone."""
    return {"novice": Standardisation.of(sets.train)} if sets.expert is None else units_of(sets, network)


def pretrain(
    method: str, sets: Datasets, network: Network, seed: int = 0, preset: Preset = SETTINGS,
    folder: Path | None = None, progress: Progress | None = None,
) -> Start | None:  # fmt: skip
    """The weights that a method starts from, of the expert alone; None for one that begins afresh. As of `learn`."""
    refuse_method(method, network.body("novice"), None if sets.expert is None else network.body("expert"))
    training = METHODS[method].pretraining(preset)
    if training is None:
        return None
    alone = dataclasses.replace(network, novice_body=network.expert_body)  # type: ignore[type-var]
    expert = expert_in_place(sets, seed)
    return start_from(train(expert, alone, training, seed, checkpoint=folder, progress=progress))


def learn(
    method: str, sets: Datasets, network: Network, seed: int = 0, preset: Preset = SETTINGS,
    start: Start | None = None, folder: Path | None = None, progress: Progress | None = None,
) -> Trained:  # fmt: skip
    """Train a method on recorded robots.

    Args:
        method: one of FITTED.
        sets: the novice's, and the expert's where the method wants it.
        network: of the robots' bodies.
        seed: of initial weights and batches.
        preset: of settings.
        start: what `pretrain` gave.
        folder: of the state of an unfinished training, to go on from.
        progress: called after each test.

    Raises:
        ConfigError: a method for other robots than these.
    """
    refuse_method(method, network.body("novice"), None if sets.expert is None else network.body("expert"))
    one, units = METHODS[method], units_in(sets, network)
    if start is not None and one.carried == "sidm":
        start = start.core()
    if one.fit == "least_squares":
        own = units_for(units, "novice")
        base = None if start is None else frozen(network, start, own)
        return fit_least_squares(sets, own, base, scale=loss_weights(network.body("novice"), own))
    weights = None if start is None else start.weights
    training = one.training(preset, "system1")
    return train(
        sets, network, training, seed, standardisation=units, checkpoint=folder, progress=progress, start=weights
    )
