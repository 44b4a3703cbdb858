"""Several experts: an SIDM that learnt from 1, 2, 4 and 8 robots, and what a novice needs of its own then (section 6).

`python -m sidm.experiments.experts` simulates and trains what is not stored and stores it in results/experts.
"""

from __future__ import annotations

import argparse
import functools
import time
from collections.abc import Iterable, Mapping
from pathlib import Path

from sidm.config import config
from sidm.experiments.datasets import load_dataset
from sidm.experiments.family import FAMILY_SEED, collect_members, collection
from sidm.experiments.measure import THREADS, Library, one_thread
from sidm.experiments.methods import METHODS, change
from sidm.experiments.presets import PRESETS, load_preset
from sidm.experiments.provenance import Provenance, here, source_hash
from sidm.experiments.records import Records
from sidm.experiments.study import Study
from sidm.experiments.trials import Dataset, Trial
from sidm.learning.dataset import Datasets, Motion, Standardisation, load_motion
from sidm.learning.evaluation import validation_loss
from sidm.learning.settings import Training
from sidm.learning.several import Parts, as_novice, fresh_around, nearest, train_several
from sidm.learning.training import train
from sidm.pool import local_pool
from sidm.systems import SYSTEMS, find_system

COUNTS = (1, 2, 4, 8)  # of experts; all together have the minutes that the paper's has alone
SIZES = (1.0, 5.0, 20.0)  # of the novice's data, min

#: How the novice goes on: from the nearest expert's encoder and decoder or fresh ones, the SIDM learning on or frozen.
WAYS = {
    "all": "all parts, from the nearest expert's",
    "parts": "encoder and decoder, from the nearest expert's",
    "fresh_parts": "encoder and decoder, fresh",
}


@config
class Pretraining:
    """One SIDM of several experts, and the novices that are learnt with it."""

    trial: Trial  # of the novice's data and of training 'all' and 'parts'; its size is the largest
    fresh: Training  # of 'fresh_parts'
    sizes: tuple[float, ...]  # of the novice's data, min
    experts: int
    minutes_each: float  # of each expert's data
    family_seed: int


@config
class Pretrained:
    """What came out; W ways of WAYS by M sizes."""

    about: Pretraining
    nearest: tuple[str, ...]  # (M,) the expert that the novice went on from
    before: tuple[float, ...]  # (M,) validation loss with that expert's parts as they are
    validation_loss: tuple[tuple[float, ...], ...]  # (W, M)
    samples: tuple[tuple[float, ...], ...]  # (W, M) seen until the weights that were kept
    seconds: tuple[tuple[float, ...], ...]  # (W, M) of training, stopping's patience included
    experts_samples: int  # seen by the SIDM before
    experts_loss: float  # mean test loss of the experts, smoothed
    source: str  # hash of the code
    provenance: Provenance

    @property
    def stale(self) -> bool:
        """Whether the code has changed since."""
        return self.source != source_hash("experts")


def pretrainings(
    study: Study, system: str, counts: Iterable[int] = COUNTS, sizes: Iterable[float] = SIZES
) -> list[Pretraining]:
    """Every number of experts with every seed."""
    preset, sizes = study.preset, tuple(sizes)
    fresh = METHODS["novice_only"].training(preset, system)
    return [
        Pretraining(
            trial=study.trial(system, "pretrain_finetune", max(sizes), seed),
            fresh=change(fresh, frozen="sidm"),
            sizes=sizes,
            experts=count,
            minutes_each=preset.expert_minutes / count,
            family_seed=FAMILY_SEED,
        )
        for seed in range(preset.seeds)
        for count in counts
    ]


def members_needed(jobs: Iterable[Pretraining]) -> dict[int, int]:
    """How many trajectories of each member of the family; the first expert is the paper's."""
    needed: dict[int, int] = {}
    for job in jobs:
        for number in range(job.experts - 1):
            needed[number] = max(needed.get(number, 0), _each(job))
    return needed


def _each(about: Pretraining) -> int:
    """Trajectories of each expert."""
    return about.trial.datasets["expert"].count // about.experts


def load_experts(about: Pretraining, data: str | Path) -> tuple[dict[str, Motion], Standardisation]:
    """The experts' motion by name, and the units inside the networks, which are those of the paper's expert's data."""
    trial, count = about.trial, _each(about)
    paper, terrain, pixels = trial.datasets["expert"], find_system(trial.system).terrain, trial.network.pixels
    load_dataset(paper, trial.digests["expert"], data)
    whole = load_motion(data, paper.collection, paper.count, terrain, pixels)
    experts = {"expert": whole.first(count)}
    for number in range(about.experts - 1):
        own = Dataset(collection=collection(trial.system, number, trial.policy), count=count)
        experts[f"member{number}"] = load_motion(data, own.collection, own.count, terrain, pixels)
    return experts, Standardisation.of(whole)


def pretrain(about: Pretraining, data: str | Path = "data") -> Pretrained:
    """Train the SIDM and all novices of one job; ShardError where data are missing."""
    begun, trial = time.perf_counter(), about.trial
    assert trial.pretraining is not None
    with one_thread():
        experts, units = load_experts(about, data)
        several = train_several(experts, trial.network, trial.pretraining, trial.seed, units)
        model, library = several.model, Library(data)
        found: dict[str, list[tuple[float, float, float]]] = {way: [] for way in WAYS}
        chosen, before = [], []
        for minutes in about.sizes:
            sets = library.datasets(trial.replace(novice_minutes=minutes))
            role = nearest(model, sets.train)  # type: ignore[arg-type]
            chosen.append(role)
            before.append(float(validation_loss(model, sets.validation, role).sum()))
            starts = {way: as_novice(model, role) for way in ("all", "parts")}  # type: ignore[arg-type]
            starts["fresh_parts"] = fresh_around(model, trial.network, units, trial.seed)  # type: ignore[arg-type]
            for way, start in starts.items():
                found[way].append(_novice(about, way, sets, start, units))
    losses, samples, seconds = (tuple(tuple(one[k] for one in some) for some in found.values()) for k in range(3))
    return Pretrained(
        about=about,
        nearest=tuple(chosen),
        before=tuple(before),
        validation_loss=losses,
        samples=samples,
        seconds=seconds,
        experts_samples=several.samples,
        experts_loss=float(several.best_test_loss),
        source=source_hash("experts"),
        provenance=here(time.perf_counter() - begun, THREADS, False),
    )


def _novice(
    about: Pretraining, way: str, sets: Datasets, start: Parts, units: Standardisation
) -> tuple[float, float, float]:
    """Validation loss, samples until the weights kept, and seconds, of one novice."""
    begun = time.perf_counter()
    trainings: Mapping[str, Training] = {
        "all": about.trial.training,
        "parts": change(about.trial.training, frozen="sidm"),
        "fresh_parts": about.fresh,
    }
    trained = train(sets, about.trial.network, trainings[way], about.trial.seed, standardisation=units, start=start)
    seconds = time.perf_counter() - begun
    return float(validation_loss(trained.model, sets.validation).sum()), float(trained.best_samples), seconds


def stored(results: str | Path = "results") -> Records[Pretrained]:
    """Where the results are kept."""
    return Records(Pretrained, Path(results) / "experts", "python -m sidm.experiments.experts")


def main() -> None:
    """Simulate and train what is missing of a preset."""
    parser = argparse.ArgumentParser(description="Learn novices with an SIDM of several experts.")
    parser.add_argument("--preset", choices=PRESETS, default="laptop", help="whose settings (%(default)s)")
    parser.add_argument("--system", choices=SYSTEMS, default="system1", help="whose novice and ground (%(default)s)")
    parser.add_argument("--data", type=Path, default=Path("data"), help="trajectories (%(default)s)")
    parser.add_argument("--results", type=Path, default=Path("results"), help="the results store (%(default)s)")
    parser.add_argument("--workers", type=int, default=2, help="processes of one thread each (%(default)s)")
    given = parser.parse_args()
    study = Study(load_preset(given.preset), given.data, given.results)
    jobs = pretrainings(study, given.system)
    with local_pool(given.workers) as pool:
        collect_members(given.system, study.preset.policy, members_needed(jobs), given.data, pool)
        stored(given.results).run(jobs, functools.partial(pretrain, data=given.data.absolute()), pool, "job")


if __name__ == "__main__":
    main()
