"""Recorded motion of another simulator as novice, this package's simulator as expert.

`companion run --figure recorded-targets` makes the results that are not stored in
results/recorded_targets.jsonl yet.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

from companion.engine.datasets import digest_of
from companion.engine.library import dataset_windows
from companion.engine.outcomes import as_lists, curve
from companion.engine.pretrained import load_or_pretrain, settings_of, weights_folder
from companion.engine.provenance import Provenance
from companion.engine.records import ProvenanceTimer, by_field, records_of
from companion.extensions.trainer import mirror_image
from companion.methods import FINER_TESTS, METHODS
from companion.presets import Preset
from companion.studies.recorded_targets.recorded import (
    Recorded,
    checksum_of,
    load_recorded,
    path_errors,
    recordings_of,
    subsets,
    window_losses,
)
from companion.study import Study
from companion.training import StudyTraining
from companion.trials import Dataset
from ownrobot.methods.fine_tuning import Pretrained, frozen_model, pretraining_datasets
from ownrobot.methods.least_squares import fit
from ownrobot.recordings import read_drives
from sidm.body import ROVER
from sidm.config import config, replace
from sidm.learning.arithmetic import one_thread
from sidm.learning.dataset import Datasets, Windows
from sidm.learning.model import DynamicsModel, Predictor
from sidm.learning.networks import Network
from sidm.learning.training import Trained, train
from sidm.learning.units import Standardisation

SIZES = (1.0, 2.0, 5.0)  # min of the recorded novice, train and test split together
HELD_OUT = 8  # of the 25 grounds; their recordings serve validation alone
#: section 4's value for similar robots, used with the simulated novice, which is nearly
#: the recorded one
P_EXPERT = 0.75
#: exploration policy of the recorded robots, and of the simulated ones here
POLICY = "bounded_noise"

#: the simulated robot that is the expert
Proxy = Literal["none", "expert", "novice"]
#: Methods and proxies that are compared. Ordered so that consecutive entries do not
#: share a pretraining.
METHODS_AND_PROXIES: tuple[tuple[str, Proxy], ...] = (
    ("novice_only", "none"),
    ("sidm", "expert"),
    ("pretrain_finetune", "expert"),
    ("sidm", "novice"),
    ("pretrain_finetune", "novice"),
    ("least_squares", "none"),
    ("corrected", "expert"),
    ("least_squares_mirrored", "none"),
    ("corrected", "novice"),
    ("corrected_averaged", "expert"),
    ("corrected_averaged", "novice"),
)


@config
class Transfer:
    """Trainings on all sizes of recorded data, with one method, proxy and seed."""

    system: str
    method: str  # a name of `methods.METHODS`
    proxy: Proxy
    seed: int  # of the chosen recordings, the initial weights and the batches
    sizes: tuple[float, ...]  # min of the recorded novice
    held_out: int  # number of grounds for validation
    recorded_data: str  # checksum of the recordings
    #: simulated expert; gives the units inside the networks, and is the proxy's data if
    #: `proxy` is 'expert'
    expert: Dataset
    #: simulated novice; is the proxy's data if `proxy` is 'novice'
    proxy_novice: Dataset
    network: Network
    training: StudyTraining
    pretraining: StudyTraining | None
    fit: Literal["gradients", "least_squares"] = "gradients"  # as of a Trial

    @property
    def datasets(self) -> dict[str, Dataset]:
        """The simulated datasets, by their kind."""
        return {"expert": self.expert, "novice": self.proxy_novice}


@config
class TransferResult:
    """Results of a Transfer, on the N held-out windows.

    Fields on models have an entry per size, after one for no recorded data where the
    method has such a model. Fields on trainings have an entry per size.
    """

    about: Transfer
    minutes: tuple[float, ...]  # per model; 0: the proxy's model as it is
    validation_loss: tuple[float, ...]  # per model: equation (1), a step, raw units
    component_losses: tuple[tuple[float, ...], ...]  # per model: (13,)
    #: per model: (N,) equation (1) on each window
    piece_losses: tuple[tuple[float, ...], ...]
    #: per model: (25,) m, mean over the windows
    position_error: tuple[tuple[float, ...], ...]
    heading_error: tuple[tuple[float, ...], ...]  # per model: (25,) rad
    #: per training: seen by the prediction phases, without the pretraining
    samples: tuple[int, ...]
    best_samples: tuple[int, ...]  # per training: seen until the kept weights
    best_test_loss: tuple[float, ...]  # per training: smoothed
    #: per training: at most 40 of the tests
    curve_samples: tuple[tuple[int, ...], ...]
    curve_test_loss: tuple[tuple[float, ...], ...]
    curve_training_loss: tuple[tuple[float, ...], ...]
    #: per training: s of processor time without the pretraining
    seconds: tuple[float, ...]
    pretraining_samples: int
    provenance: Provenance


#: the stored results, under a folder of results
records = records_of(TransferResult, "recorded-targets")


def proxies(preset: Preset, system: str) -> dict[str, Dataset]:
    """The datasets of the two simulated robots, 'expert' and 'novice'.

    Each has as many trajectories as the preset's expert.
    """
    sets = preset.replace(policy=POLICY).datasets(system)
    count = sets["expert"].count
    return {
        role: Dataset(collection=sets[role].collection, count=count)
        for role in ("expert", "novice")
    }


def motion(about: Transfer) -> dict[Dataset, Sequence[int]]:
    """The simulated motion that a job needs: both robots', whole."""
    return {one: range(one.count) for one in about.datasets.values()}


def jobs(
    study: Study,
    system: str,
    recordings: str | Path = "recordings",
    sizes: Sequence[float] = SIZES,
) -> list[Transfer]:
    """All trainings of a system on `sizes`, min of recorded data, seed after seed."""
    preset, sets = study.preset, proxies(study.preset, system)
    recorded = checksum_of(read_drives(recordings_of(system, recordings), ROVER))
    seeds, transfers = range(preset.seeds), []
    for seed, (name, proxy) in itertools.product(seeds, METHODS_AND_PROXIES):
        method = METHODS[name]
        training = preset.training_of(method, system)
        if method.fit == "gradients":
            training = replace(training, **FINER_TESTS)
        if proxy == "novice" and training.p_expert > 0:
            training = replace(training, p_expert=P_EXPERT)
        transfers.append(
            Transfer(
                system=system,
                method=name,
                proxy=proxy,
                seed=seed,
                sizes=tuple(sizes),
                held_out=HELD_OUT,
                recorded_data=recorded,
                expert=sets["expert"],
                proxy_novice=sets["novice"],
                network=preset.network,
                training=training,
                pretraining=preset.pretraining_of(method),
                fit=method.fit,  # type: ignore[arg-type]
            )
        )
    return transfers


def measure(
    about: Transfer, data: str | Path = "data", recordings: str | Path = "recordings"
) -> TransferResult:
    """Train and evaluate the models of all sizes.

    RecordingError or ShardError says that recordings or data are missing, or others
    than those of the job.
    """
    timer, pixels = ProvenanceTimer("elsewhere", about, data), about.network.pixels
    models: list[dict[str, Any]] = []
    trainings: list[dict[str, Any]] = []

    def evaluate(minutes: float, model: Predictor) -> None:
        losses = window_losses(model, recorded)
        position, heading = path_errors(model, recorded, pixels)
        fields = {
            "minutes": minutes,
            "validation_loss": float(losses.mean(0).sum()),
            "component_losses": as_lists(losses.mean(0)),
            "piece_losses": as_lists(losses.sum(1)),
            "position_error": as_lists(position),
            "heading_error": as_lists(heading),
        }
        models.append(fields)

    with one_thread():
        recorded = load_recorded(
            about.system, about.held_out, pixels, recordings, about.recorded_data
        )
        expert = dataset_windows(about.expert, data, pixels)
        proxy = expert
        if about.proxy == "novice":
            proxy = dataset_windows(about.proxy_novice, data, pixels)
        units = Standardisation.fit(expert)
        start, proxy_model = _start(about, recorded, proxy, units, data), None
        if start is not None:
            proxy_model = frozen_model(about.network, start, units)
            evaluate(0.0, proxy_model)
        for minutes in about.sizes:
            begun = time.process_time()
            trained = _learn(about, minutes, recorded, proxy, units, start, proxy_model)
            fields = {
                "samples": trained.samples,
                "best_samples": trained.best_samples,
                "seconds": time.process_time() - begun,
                "best_test_loss": float(trained.best_test_loss),
            }
            trainings.append(fields | curve(trained))
            evaluate(minutes, trained.model)
    return TransferResult(
        about=about,
        **by_field(models),
        **by_field(trainings),
        pretraining_samples=start.samples if start else 0,
        provenance=timer.done(),
    )


def _learn(
    about: Transfer,
    minutes: float,
    recorded: Recorded,
    proxy: Windows,
    units: Standardisation,
    start: Pretrained | None,
    proxy_model: DynamicsModel | None,
) -> Trained:
    """Train on so many minutes of the recordings, from fresh weights or the proxy's.

    Least squares leave the proxy's model as it is and add a correction.
    """
    parts = subsets(recorded, minutes, about.seed)
    learning, testing = (recorded.motion.subset(part) for part in parts)
    sets = Datasets(learning, testing, recorded.validation, proxy)
    if about.fit == "least_squares":
        mirror = mirror_image if about.training.mirror else None
        return fit(sets, units, proxy_model, mirror)
    return train(
        sets,
        about.network,
        about.training,
        about.seed,
        standardisation=units,
        start=start.weights if start else None,
    )


def _start(
    about: Transfer,
    recorded: Recorded,
    proxy: Windows,
    units: Standardisation,
    data: str | Path,
) -> Pretrained | None:
    """Weights trained on the proxy alone; None for a method that starts afresh.

    They are kept under `data` for all methods that start from them.
    """
    if about.pretraining is None:
        return None
    used = about.proxy_novice if about.proxy == "novice" else about.expert
    made_from = {
        "digest": digest_of(used, data),
        "expert": digest_of(about.expert, data),
        "seed": about.seed,
    } | settings_of(about.network, about.pretraining)
    folder = weights_folder(data, made_from, "training", "elsewhere-")
    held_out = recorded.validation
    sets = pretraining_datasets(
        Datasets(held_out, held_out, held_out, proxy), about.seed
    )
    settings = (about.network, about.pretraining, about.seed)

    def pretrain(state: Path) -> Trained:
        return train(sets, *settings, standardisation=units, checkpoint=state)

    return load_or_pretrain(folder, pretrain)
