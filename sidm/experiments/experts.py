"""Several experts: an SIDM that learnt from 1, 2, 4 and 8 robots, and what a novice needs of its own then (section 6).

`python -m sidm study experts` makes what is not stored of it in results/experts.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Iterable, Mapping
from pathlib import Path

from sidm.config import config
from sidm.experiments.datasets import find_digest, load_dataset
from sidm.experiments.family import dataset
from sidm.experiments.measure import Library, one_thread
from sidm.experiments.methods import METHODS, change
from sidm.experiments.provenance import Provenance, source_hash
from sidm.experiments.records import Making, Records
from sidm.experiments.study import Study
from sidm.experiments.trials import Dataset, Trial
from sidm.learning.dataset import Datasets, Motion, Standardisation, load_motion
from sidm.learning.evaluation import validation_loss
from sidm.learning.settings import Training
from sidm.learning.several import Parts, as_novice, fresh_around, nearest, train_several
from sidm.learning.training import train
from sidm.systems import find_system

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
    experts: int  # the paper's and members of the family
    roles: tuple[str, ...]  # of the members' collections
    members_data: tuple[str, ...]  # digests of their datasets

    @property
    def members(self) -> tuple[Dataset, ...]:
        """The members' datasets, each the paper's expert's share."""
        paper = self.trial.datasets["expert"]
        return tuple(
            Dataset(
                collection=dataclasses.replace(paper.collection, role=role),  # type: ignore[type-var]
                count=paper.count // self.experts,
            )
            for role in self.roles
        )


    @property
    def datasets(self) -> dict[str, Dataset]:
        """Those of the trial and the members', by their kind."""
        return self.trial.datasets | dict(zip(self.roles, self.members, strict=True))

    @property
    def digests(self) -> dict[str, str]:
        """Theirs, by the same names."""
        return self.trial.digests | dict(zip(self.roles, self.members_data, strict=True))


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
    preset, sizes, found = study.preset, tuple(sizes), []
    fresh = METHODS["novice_only"].training(preset, system)
    whole = preset.datasets(system)["expert"].count
    for count in counts:
        members = tuple(dataset(system, number, preset.policy, whole // count) for number in range(count - 1))
        digests = tuple(find_digest(one, study.data, study.results) for one in members)
        found += [
            Pretraining(
                trial=study.trial(system, "pretrain_finetune", max(sizes), seed),
                fresh=change(fresh, frozen="sidm"),
                sizes=sizes,
                experts=count,
                roles=tuple(one.collection.role for one in members),
                members_data=digests,
            )
            for seed in range(preset.seeds)
        ]
    return found


def members_needed(jobs: Iterable[Pretraining]) -> dict[int, set[int]]:
    """Numbers of trajectories that are wanted of each member of the family."""
    needed: dict[int, set[int]] = {}
    for job in jobs:
        for number, one in enumerate(job.members):
            needed.setdefault(number, set()).add(one.count)
    return needed


def load_experts(about: Pretraining, data: str | Path) -> tuple[dict[str, Motion], Standardisation]:
    """The experts' motion by name, and the units inside the networks, which are those of the paper's expert's data."""
    trial = about.trial
    paper, terrain, pixels = trial.datasets["expert"], find_system(trial.system).terrain, trial.network.pixels
    load_dataset(paper, trial.digests["expert"], data)
    whole = load_motion(data, paper.collection, paper.count, terrain, pixels)
    experts = {"expert": whole.first(paper.count // about.experts)}
    for number, (own, digest) in enumerate(zip(about.members, about.members_data, strict=True)):
        load_dataset(own, digest, data)
        experts[f"member{number}"] = load_motion(data, own.collection, own.count, terrain, pixels)
    return experts, Standardisation.of(whole)


def pretrain(about: Pretraining, data: str | Path = "data") -> Pretrained:
    """Train the SIDM and all novices of one job; ShardError where data are missing."""
    making, trial = Making("experts", about, data), about.trial
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
        **making.done(),
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
    return Records(Pretrained, Path(results) / "experts", "python -m sidm study experts")
