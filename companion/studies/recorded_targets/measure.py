"""A target from another simulator: recorded motion is the novice, this package's simulator the cheap expert.

`companion run --figure recorded-targets` makes what is not stored of it in
results/recorded_targets.
"""

from __future__ import annotations

import functools
import hashlib
import json
import time
from collections.abc import Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Any, Literal

from companion.beyond.mirror import mirror_image
from companion.digests import find_digest
from companion.engine.datasets import collect_dataset, note_collected
from companion.engine.execute import curve, load_checked, plain
from companion.engine.pretrained import kept
from companion.engine.provenance import Provenance
from companion.engine.records import Making, by_field, records_of
from companion.methods import FINER_TESTS, METHODS
from companion.numerics import numbered
from companion.presets import Preset
from companion.studies.recorded_targets.recorded import (
    Recorded,
    checksum_of,
    load_recorded,
    path_errors,
    piece_losses,
    recordings_of,
)
from companion.studies.recorded_targets.recorded import subsets as recorded_subsets
from companion.study import Study
from companion.training import StudyTraining
from companion.trials import Dataset
from sidm.body import ROVER
from sidm.config import config, replace
from sidm.learning.arithmetic import one_thread
from sidm.learning.dataset import Datasets, Windows
from sidm.learning.model import DynamicsModel, Predictor
from sidm.learning.networks import Network
from sidm.learning.training import Trained, train
from sidm.learning.units import Standardisation
from sidm.recordings import read_drives
from sidm.rivals.fine_tuning import Start, expert_in_place, frozen
from sidm.rivals.least_squares import fit

SIZES = (1.0, 2.0, 5.0)  # of the recorded novice, train and test together, min
HELD_OUT = 8  # of the 25 grounds, whose recordings judge and nothing else
#: section 4's for similar robots: for the simulated novice, which is nearly the
#: recorded one
P_EXPERT = 0.75
#: by which the recorded robots were driven; the simulated ones are as well
POLICY = "bounded_noise"

#: the simulated robot that is the expert here
Proxy = Literal["none", "expert", "novice"]
#: Neighbours in this list wait for no pretraining of one another.
METHODS_HERE: tuple[tuple[str, Proxy], ...] = (
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
    """Trainings on all sizes of recorded data with one method, one proxy and one seed."""

    system: str
    method: str  # a name of `methods.METHODS`
    proxy: Proxy
    seed: int  # of the recordings chosen, the initial weights and the batches
    sizes: tuple[float, ...]  # of the recorded novice, min
    held_out: int  # grounds that judge
    recorded_data: str  # checksum of the recordings
    #: simulated; gives the units inside the networks, and the proxy's data if it is the
    #: proxy
    expert: Dataset
    expert_data: str  # its digest
    proxy_novice: Dataset  # simulated, the proxy's data if it is the proxy
    proxy_novice_data: str
    network: Network
    training: StudyTraining
    pretraining: StudyTraining | None
    fit: Literal["gradients", "least_squares"] = "gradients"  # as that of a Trial

    @property
    def datasets(self) -> dict[str, Dataset]:
        """The simulated ones, by their kind."""
        return {"expert": self.expert, "novice": self.proxy_novice}

    @property
    def digests(self) -> dict[str, str]:
        """Theirs, by the same names."""
        return {"expert": self.expert_data, "novice": self.proxy_novice_data}


@config
class Transferred:
    """What came out.

    Of a model there is an entry a size, before them one for no recorded data where the
    method has that; of a training there is an entry a size. Losses are on the N
    held-out pieces.
    """

    about: Transfer
    minutes: tuple[float, ...]  # of a model; 0: the proxy's model as it is
    validation_loss: tuple[float, ...]  # of a model, equation (1), a sample, raw units
    component_losses: tuple[tuple[float, ...], ...]  # of a model, (13,) each
    piece_losses: tuple[tuple[float, ...], ...]  # of a model, (N,) each, equation (1)
    #: of a model, (25,) m each, mean over the pieces
    position_error: tuple[tuple[float, ...], ...]
    heading_error: tuple[tuple[float, ...], ...]  # of a model, (25,) rad each
    #: of a training, seen by its prediction phases, without the pretraining's
    samples: tuple[int, ...]
    best_samples: tuple[int, ...]  # of a training, until the weights that were kept
    best_test_loss: tuple[float, ...]  # of a training, smoothed
    #: of a training, of at most 40 of its tests
    curve_samples: tuple[tuple[int, ...], ...]
    curve_test_loss: tuple[tuple[float, ...], ...]
    curve_training_loss: tuple[tuple[float, ...], ...]
    #: of a training, of a processor, without the pretraining's
    seconds: tuple[float, ...]
    pretraining_samples: int
    provenance: Provenance


#: where they are kept, under a folder of results
records = records_of(Transferred, "recorded-targets")


def proxies(preset: Preset, system: str) -> dict[str, Dataset]:
    """The motion of the two simulated robots, 'expert' and 'novice', each as long as the preset's of the expert."""
    found = preset.replace(policy=POLICY).datasets(system)
    count = found["expert"].count
    return {
        role: Dataset(collection=found[role].collection, count=count)
        for role in ("expert", "novice")
    }


def collect_proxies(
    study: Study, system: str, executor: Executor | None = None
) -> None:
    """Simulate what is missing of them and note their digests; ImportError without PyBullet, in one line."""
    for dataset in proxies(study.preset, system).values():
        collect_dataset(dataset, study.data, executor)
        note_collected(dataset, study.data, study.results)


def jobs(
    study: Study,
    system: str,
    recordings: str | Path = "recordings",
    sizes: Sequence[float] = SIZES,
) -> list[Transfer]:
    """All trainings of a system, those of a seed side by side; `sizes` are minutes of recorded data."""
    preset, sets = study.preset, proxies(study.preset, system)
    expert, novice = (
        find_digest(one, study.data, study.results) for one in sets.values()
    )
    recorded = checksum_of(read_drives(recordings_of(system, recordings), ROVER))
    found = []
    for seed in range(preset.seeds):
        for method, proxy in METHODS_HERE:
            training = preset.training_of(METHODS[method], system)
            if METHODS[method].fit == "gradients":
                training = replace(training, **FINER_TESTS)
            if proxy == "novice" and training.p_expert > 0:
                training = replace(training, p_expert=P_EXPERT)
            found.append(
                Transfer(
                    system=system,
                    method=method,
                    proxy=proxy,
                    seed=seed,
                    sizes=tuple(sizes),
                    held_out=HELD_OUT,
                    recorded_data=recorded,
                    expert=sets["expert"],
                    expert_data=expert,
                    proxy_novice=sets["novice"],
                    proxy_novice_data=novice,
                    network=preset.network,
                    training=training,
                    pretraining=preset.pretraining_of(METHODS[method]),
                    fit=METHODS[method].fit,
                )
            )
    return found


#: The recordings are read once for all trainings of a process; their checksum is among
#: what they are known by.
_recorded = functools.lru_cache(maxsize=1)(load_recorded)


def measure(
    about: Transfer, data: str | Path = "data", recordings: str | Path = "recordings"
) -> Transferred:
    """Train and judge one; RecordingError or ShardError where data are missing or others than they should be."""
    making = Making("elsewhere", about, data)
    with one_thread():
        recorded = _recorded(
            about.system,
            about.held_out,
            about.network.pixels,
            recordings,
            about.recorded_data,
        )
        expert = load_checked(
            about.expert, about.expert_data, data, about.network.pixels
        )
        proxy = expert
        if about.proxy == "novice":
            proxy = load_checked(
                about.proxy_novice, about.proxy_novice_data, data, about.network.pixels
            )
        units = Standardisation.of(expert)
        start = _start(about, recorded, proxy, units, data)
        alone = None if start is None else frozen(about.network, start, units)
        models = [] if alone is None else [_judged(0.0, alone, about, recorded)]
        trainings = []
        for minutes in about.sizes:
            begun = time.process_time()
            trained = _learn(about, minutes, recorded, proxy, units, start, alone)
            trainings.append(_training(trained, time.process_time() - begun))
            models.append(_judged(minutes, trained.model, about, recorded))
    return Transferred(
        about=about,
        **by_field(models),
        **by_field(trainings),
        pretraining_samples=start.samples if start else 0,
        provenance=making.done(),
    )


def _judged(
    minutes: float, model: Predictor, about: Transfer, recorded: Recorded
) -> dict[str, Any]:
    """The fields on a model."""
    losses = piece_losses(model, recorded)
    position, heading = path_errors(model, recorded, about.network.pixels)
    return {
        "minutes": minutes,
        "validation_loss": float(losses.mean(0).sum()),
        "component_losses": plain(losses.mean(0)),
        "piece_losses": plain(losses.sum(1)),
        "position_error": plain(position),
        "heading_error": plain(heading),
    }


def _training(trained: Trained, seconds: float) -> dict[str, Any]:
    """The fields on a training that took so many seconds of a processor."""
    own = {
        "samples": trained.samples,
        "best_samples": trained.best_samples,
        "seconds": seconds,
    }
    return own | {"best_test_loss": float(trained.best_test_loss)} | curve(trained)


def _learn(
    about: Transfer,
    minutes: float,
    recorded: Recorded,
    proxy: Windows,
    units: Standardisation,
    start: Start | None,
    alone: DynamicsModel | None,
) -> Trained:
    """From fresh weights or the proxy's; or by least squares, which leave the proxy's model as it is."""
    training, testing = (
        recorded.motion.subset(part)
        for part in recorded_subsets(recorded, minutes, about.seed)
    )
    sets = Datasets(training, testing, recorded.judges, proxy)
    if about.fit == "least_squares":
        return fit(sets, units, alone, mirror_image if about.training.mirror else None)
    weights = start and start.weights
    return train(
        sets,
        about.network,
        about.training,
        about.seed,
        standardisation=units,
        start=weights,
    )


def _start(
    about: Transfer,
    recorded: Recorded,
    proxy: Windows,
    units: Standardisation,
    data: str | Path,
) -> Start | None:
    """Weights that learnt from the proxy alone, kept for all methods that begin with them; None where none does."""
    if about.pretraining is None:
        return None
    whose = about.proxy_novice_data if about.proxy == "novice" else about.expert_data
    made_from = [
        whose,
        about.expert_data,
        *map(repr, (about.network, about.pretraining)),
        about.seed,
    ]
    key = hashlib.sha256(json.dumps(made_from).encode()).hexdigest()[:20]
    where = Path(data) / "pretrained" / f"elsewhere-{key}-{numbered('training')}"
    sets = expert_in_place(
        Datasets(recorded.judges, recorded.judges, recorded.judges, proxy), about.seed
    )
    how = (about.network, about.pretraining, about.seed)
    return kept(
        where, lambda state: train(sets, *how, standardisation=units, checkpoint=state)
    )
