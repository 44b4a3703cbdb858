"""A target from elsewhere: recorded motion is the novice, this package's simulator the cheap expert.

`python -m sidm.experiments.elsewhere` trains what is missing and stores it in results/elsewhere.
"""

from __future__ import annotations

import argparse
import functools
import hashlib
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Literal, NamedTuple

import torch
from torch import Tensor

from sidm.config import config
from sidm.experiments.datasets import load_dataset
from sidm.experiments.measure import ROLLOUT_STEPS, THREADS, one_thread
from sidm.experiments.methods import METHODS, change
from sidm.experiments.presets import PRESETS, load_preset
from sidm.experiments.provenance import Provenance, here, source_hash
from sidm.experiments.records import Records
from sidm.experiments.study import Study
from sidm.experiments.trials import Dataset
from sidm.learning.dataset import Datasets, Motion, Standardisation, load_motion, novice_split
from sidm.learning.evaluation import rollout, rollout_errors, validation_loss
from sidm.learning.model import DynamicsModel, Predictor
from sidm.learning.networks import Network
from sidm.learning.pretraining import expert_in_place, start_from
from sidm.learning.recorded import Pieces, apart_by_ground, cut, recorded_motion
from sidm.learning.settings import Training
from sidm.learning.training import train
from sidm.pool import local_pool
from sidm.recordings import read_recordings
from sidm.systems import SYSTEMS, find_system

SIZES = (1.0, 2.0, 5.0)  # of the recorded novice, train and test together, min
HELD_OUT = 8  # of the 25 grounds, whose recordings judge and nothing else
P_EXPERT = 0.75  # section 4's for similar robots: for the simulated novice, which is nearly the recorded one

Proxy = Literal["none", "expert", "novice"]  # the simulated robot that is the expert here
METHODS_HERE: tuple[tuple[str, Proxy], ...] = (
    ("novice_only", "none"),
    ("sidm", "expert"),
    ("pretrain_finetune", "expert"),
    ("sidm", "novice"),
    ("pretrain_finetune", "novice"),
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
    recorded = hashlib.sha256(recordings_of(system, recordings).read_bytes()).hexdigest()[:16]
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
    begun = time.perf_counter()
    with one_thread():
        recorded = load_recorded(about.system, about.held_out, about.network.pixels, recordings)
        expert = _simulated(about, about.expert, about.expert_data, data)
        proxy = expert
        if about.proxy == "novice":
            proxy = _simulated(about, about.proxy_novice, about.proxy_novice_data, data)
        units, judging = Standardisation.of(expert), recorded.motion.take(recorded.judging)
        models: dict[float, tuple[Predictor, int]] = {}
        start, pretraining_samples = None, 0
        if about.pretraining is not None:
            sets = expert_in_place(Datasets(judging, judging, judging, proxy), about.seed)
            found = start_from(train(sets, about.network, about.pretraining, about.seed, standardisation=units))
            start, pretraining_samples = found.weights, found.samples
            alone = DynamicsModel(about.network, units, roles=["novice"])
            alone.start(start)
            models[0.0] = alone.eval(), 0
        for minutes in about.sizes:
            sets = _sets(recorded, minutes, about.seed, judging, proxy)
            trained = train(sets, about.network, about.training, about.seed, standardisation=units, start=start)
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
        pretraining_samples=pretraining_samples,
        source=source_hash("elsewhere"),
        provenance=here(time.perf_counter() - begun, THREADS, False),
    )


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
    return Records(Transferred, Path(results) / "elsewhere", "python -m sidm.experiments.elsewhere")


def main() -> None:
    """Train what is missing of a preset."""
    parser = argparse.ArgumentParser(description="Learn a recorded robot, with simulated ones as experts.")
    parser.add_argument("--preset", choices=PRESETS, default="laptop", help="whose settings (%(default)s)")
    parser.add_argument("--system", choices=SYSTEMS, help="only this one; both unless given")
    parser.add_argument("--data", type=Path, default=Path("data"), help="trajectories (%(default)s)")
    parser.add_argument("--results", type=Path, default=Path("results"), help="the results store (%(default)s)")
    parser.add_argument("--recordings", type=Path, default=Path("recordings"), help="packed recordings (%(default)s)")
    parser.add_argument("--workers", type=int, default=2, help="processes of one thread each (%(default)s)")
    given = parser.parse_args()
    study = Study(load_preset(given.preset), given.data, given.results)
    systems = [system for system in SYSTEMS if given.system in (None, system)]
    jobs = [job for system in systems for job in transfers(study, system, given.recordings)]
    work = functools.partial(transfer, data=given.data.absolute(), recordings=given.recordings.absolute())
    with local_pool(given.workers) as pool:
        stored(given.results).run(jobs, work, pool, "transfer")


if __name__ == "__main__":
    main()
