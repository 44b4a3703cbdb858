"""A target from elsewhere: recorded motion is the novice, this package's simulator the cheap expert.

`python -m sidm study elsewhere` makes what is not stored of it in results/elsewhere.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Literal, NamedTuple

import torch
from torch import Tensor

from sidm.config import config
from sidm.experiments.datasets import load_dataset
from sidm.experiments.measure import ROLLOUT_STEPS, one_thread
from sidm.experiments.methods import METHODS, change
from sidm.experiments.pretrained import _alone as one_at_a_time
from sidm.experiments.provenance import Provenance, source_hash
from sidm.experiments.records import Making, Records
from sidm.experiments.study import Study
from sidm.experiments.trials import Dataset
from sidm.learning import pretraining
from sidm.learning.dataset import Datasets, Motion, Standardisation, load_motion, novice_split
from sidm.learning.evaluation import rollout, rollout_errors, validation_loss
from sidm.learning.least_squares import fit
from sidm.learning.model import DynamicsModel, Predictor
from sidm.learning.networks import Network
from sidm.learning.pretraining import Start, expert_in_place, start_from
from sidm.learning.recorded import Pieces, apart_by_ground, cut, recorded_motion
from sidm.learning.settings import Training
from sidm.learning.training import Trained, train
from sidm.recordings import RecordingError, read_recordings
from sidm.systems import find_system

SIZES = (1.0, 2.0, 5.0)  # of the recorded novice, train and test together, min
HELD_OUT = 8  # of the 25 grounds, whose recordings judge and nothing else
P_EXPERT = 0.75  # section 4's for similar robots: for the simulated novice, which is nearly the recorded one

Proxy = Literal["none", "expert", "novice"]  # the simulated robot that is the expert here
WITH_PROXY = ("sidm", "pretrain_finetune", "corrected", "corrected_averaged")
METHODS_HERE: tuple[tuple[str, Proxy], ...] = (
    ("novice_only", "none"),
    ("least_squares", "none"),
    *((method, "expert") for method in WITH_PROXY),
    *((method, "novice") for method in WITH_PROXY),
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
    recorded_data: str  # checksum of the file of recordings
    expert: Dataset  # simulated; gives the units inside the networks, and the proxy's data if it is the proxy
    expert_data: str  # its digest
    proxy_novice: Dataset  # simulated, the proxy's data if it is the proxy
    proxy_novice_data: str
    network: Network
    training: Training
    pretraining: Training | None
    fit: Literal["gradients", "least_squares"] = "gradients"  # as that of a Trial


@config
class Transferred:
    """What came out; a tuple has an entry a size, before them one for no recorded data where the method has that."""

    about: Transfer
    minutes: tuple[float, ...]  # 0: the proxy's model as it is
    validation_loss: tuple[float, ...]  # equation (1) on the held-out recordings, a sample, raw units
    component_losses: tuple[tuple[float, ...], ...]  # (13,) each
    position_error: tuple[tuple[float, ...], ...]  # (25,) m each, mean over the held-out recordings
    samples: tuple[int, ...]  # seen by prediction training, without the pretraining's
    pretraining_samples: int
    source: str  # hash of the code
    provenance: Provenance

    @property
    def stale(self) -> bool:
        """Whether the code has changed since."""
        return self.source != source_hash("elsewhere")


def recordings_of(system: str, folder: str | Path = "recordings") -> Path:
    """The file of a system's recorded novice."""
    return Path(folder) / f"{system}.npz"


def transfers(
    study: Study, system: str, recordings: str | Path = "recordings", sizes: Sequence[float] = SIZES
) -> list[Transfer]:
    """All trainings of a system, those of a seed side by side; `sizes` are minutes of recorded data."""
    preset, sets, digests = study.preset, study.preset.datasets(system), study.digests(system)
    recorded = _checksum(recordings_of(system, recordings))
    found = []
    for seed in range(preset.seeds):
        for method, proxy in METHODS_HERE:
            training = METHODS[method].training(preset, system)
            if proxy == "novice" and training.p_expert > 0:
                training = change(training, p_expert=P_EXPERT)
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
                    expert_data=digests["expert_data"],
                    proxy_novice=sets["novice"],
                    proxy_novice_data=digests["novice_data"],
                    network=preset.network,
                    training=training,
                    pretraining=METHODS[method].pretraining(preset),
                    fit=METHODS[method].fit,
                )
            )
    return found


class Recorded(NamedTuple):
    """The recordings of a system, apart by ground."""

    pieces: Pieces
    motion: Motion
    learning: Tensor  # numbers of the pieces to learn from
    judging: Tensor  # and of those to judge by


def load_recorded(system: str, held_out: int, pixels: int, recordings: str | Path = "recordings") -> Recorded:
    """A system's recordings; RecordingError where they have a fault."""
    pieces = cut(read_recordings(recordings_of(system, recordings)))
    return Recorded(pieces, recorded_motion(pieces, pixels), *apart_by_ground(pieces, held_out))


def transfer(about: Transfer, data: str | Path = "data", recordings: str | Path = "recordings") -> Transferred:
    """Train and judge one; RecordingError or ShardError where data are missing or others than they should be."""
    making = Making("elsewhere")
    with one_thread():
        _refuse_others(about, recordings)
        recorded = load_recorded(about.system, about.held_out, about.network.pixels, recordings)
        expert = _simulated(about, about.expert, about.expert_data, data)
        proxy = expert
        if about.proxy == "novice":
            proxy = _simulated(about, about.proxy_novice, about.proxy_novice_data, data)
        units, judging = Standardisation.of(expert), recorded.motion.take(recorded.judging)
        models: dict[float, tuple[Predictor, int]] = {}
        start = _start(about, Datasets(judging, judging, judging, proxy), units, data)
        alone = None if start is None else _as_it_is(about, start, units)
        if alone is not None:
            models[0.0] = alone, 0
        for minutes in about.sizes:
            sets = _sets(recorded, minutes, about.seed, judging, proxy)
            trained = _learn(about, sets, units, start, alone)
            models[minutes] = trained.model, trained.samples
        losses = {minutes: validation_loss(model, judging) for minutes, (model, _) in models.items()}
        errors = [_position_error(model, recorded, about.network.pixels) for model, _ in models.values()]
    return Transferred(
        about=about,
        minutes=tuple(models),
        validation_loss=tuple(float(loss.sum()) for loss in losses.values()),
        component_losses=tuple(tuple(loss.tolist()) for loss in losses.values()),
        position_error=tuple(tuple(error.tolist()) for error in errors),
        samples=tuple(samples for _, samples in models.values()),
        pretraining_samples=start.samples if start else 0,
        **making.done(),
    )


def _learn(
    about: Transfer, sets: Datasets, units: Standardisation, start: Start | None, alone: DynamicsModel | None
) -> Trained:
    """From fresh weights or the proxy's; or by least squares, which leave the proxy's model as it is."""
    if about.fit == "least_squares":
        return fit(sets, units, alone, about.training.mirror)
    weights = start and start.weights
    return train(sets, about.network, about.training, about.seed, standardisation=units, start=weights)


def _start(about: Transfer, sets: Datasets, units: Standardisation, data: str | Path) -> Start | None:
    """Weights that learnt from the proxy alone, kept for all methods that begin with them; None where none does."""
    if about.pretraining is None:
        return None
    whose = about.proxy_novice_data if about.proxy == "novice" else about.expert_data
    made_from = [whose, about.expert_data, *map(repr, (about.network, about.pretraining)), about.seed]
    key = hashlib.sha256(json.dumps(made_from).encode()).hexdigest()[:20]
    where = Path(data) / "pretrained" / f"elsewhere-{key}-{source_hash('learning')}"
    with one_at_a_time(where):
        found = pretraining.read(where)
        if found is None:
            sets = expert_in_place(sets, about.seed)
            found = start_from(train(sets, about.network, about.pretraining, about.seed, standardisation=units))
            pretraining.keep(where, found)
        return found


def _as_it_is(about: Transfer, start: Start, units: Standardisation) -> DynamicsModel:
    """The proxy's model."""
    model = DynamicsModel(about.network, units, roles=["novice"])
    model.start(start.weights)
    return model.eval().requires_grad_(False)


def _refuse_others(about: Transfer, recordings: str | Path) -> None:
    """RecordingError unless the recordings are those of the training."""
    path = recordings_of(about.system, recordings)
    found = _checksum(path)
    if found != about.recorded_data:
        raise RecordingError(f"{path}: has checksum {found}, the training wants {about.recorded_data}")


def _checksum(path: Path) -> str:
    if not path.is_file():
        raise RecordingError(f"{path}: there is no such file of recordings")
    return hashlib.sha256(path.read_bytes()).hexdigest()[:16]


def _simulated(about: Transfer, dataset: Dataset, digest: str, data: str | Path) -> Motion:
    load_dataset(dataset, digest, data)
    terrain = find_system(about.system).terrain
    return load_motion(data, dataset.collection, dataset.count, terrain, about.network.pixels)


def _sets(recorded: Recorded, minutes: float, seed: int, judging: Motion, proxy: Motion) -> Datasets:
    """Nested subsets of the recordings to learn from, split as the pool of the other studies is."""
    parts = novice_split(len(recorded.learning), minutes, seed)
    learning, testing = (recorded.motion.part(recorded.learning[torch.from_numpy(part)]) for part in parts)
    return Datasets(learning, testing, judging, proxy)


def _position_error(model: Predictor, recorded: Recorded, pixels: int) -> Tensor:
    """(25,) m: mean over the held-out pieces, predicted from their start under their own actions."""
    pieces, judging = recorded.pieces, recorded.judging
    states = pieces.states[judging, : ROLLOUT_STEPS + 1]
    heights = torch.stack([pieces.grounds[number] for number in pieces.ground[judging].tolist()])
    actions = pieces.actions[judging, :ROLLOUT_STEPS]
    path = rollout(model, heights, states[:, 0], actions, pixels, spacing=pieces.spacing[0])
    return rollout_errors(path, states)[0].mean(0)


def stored(results: str | Path = "results") -> Records[Transferred]:
    """Where the results are kept."""
    return Records(Transferred, Path(results) / "elsewhere", "python -m sidm study elsewhere")
