"""Several experts: an SIDM that learnt from 1, 2, 4 and 8 robots, and what a novice needs of its own then (section 6).

`companion run --figure several-experts` makes what is not stored of it in
results/several_experts.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import time
from collections.abc import Iterable, Mapping
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

from torch import Tensor

from companion.beyond.several import (
    Parts,
    as_novice,
    fresh_around,
    nearest,
    train_several,
)
from companion.digests import find_digest
from companion.engine.execute import Library, curve, judge, load_checked, plain
from companion.engine.provenance import Provenance
from companion.engine.records import Making, by_field, records_of
from companion.methods import FINER_TESTS, METHODS
from companion.numerics import numbered
from companion.studies.several_experts.family import collect_members, dataset
from companion.study import Study
from companion.training import StudyTraining
from companion.trials import Dataset, Trial
from sidm.config import config, replace
from sidm.learning import checkpoint
from sidm.learning.arithmetic import one_thread
from sidm.learning.dataset import Datasets, Windows, split
from sidm.learning.evaluation import mean_loss, validation_loss
from sidm.learning.model import DynamicsModel
from sidm.learning.training import Trained, train
from sidm.learning.units import Standardisation

#: of experts; all together have the minutes that the paper's has alone
COUNTS = (1, 2, 4, 8)
SIZES = (1.0, 5.0, 20.0)  # of the novice's data, min
#: of the single expert's novice besides, so that what others save can be told
BEYOND = (60.0,)

#: How the novice goes on: from the nearest expert's encoder and decoder or fresh ones,
#: the SIDM learning on or frozen.
WAYS = {
    "all": "all parts, from the nearest expert's",
    "parts": "encoder and decoder, from the nearest expert's",
    "fresh_parts": "encoder and decoder, fresh",
}


@config
class Pretraining:
    """One SIDM of several experts, and the novices that are learnt with it."""

    #: of the novice's data and of training 'all' and 'parts'; its size is the largest
    trial: Trial
    fresh: StudyTraining  # of 'fresh_parts'
    sizes: tuple[float, ...]  # of the novice's data, min
    experts: int  # the paper's, if it is one of them, and members of the family
    paper: bool  # whether it is
    roles: tuple[str, ...]  # of the members' collections
    members_data: tuple[str, ...]  # digests of their datasets

    @property
    def members(self) -> tuple[Dataset, ...]:
        """The members' datasets, each as large a share."""
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
        return self.trial.digests | dict(
            zip(self.roles, self.members_data, strict=True)
        )


@config
class Pretrained:
    """What came out; W ways of WAYS by M sizes; of each novice's training unless said."""

    about: Pretraining
    nearest: tuple[str, ...]  # (M,) the expert that the novice went on from
    #: (M, E) validation loss with each expert's parts as they are
    before: tuple[tuple[float, ...], ...]
    validation_loss: tuple[tuple[float, ...], ...]  # (W, M)
    component_losses: tuple[tuple[tuple[float, ...], ...], ...]  # (W, M, 13)
    #: (W, M) m, after 2.5 s, mean over the rollouts of the trial
    position_error: tuple[tuple[float, ...], ...]
    heading_error: tuple[tuple[float, ...], ...]  # (W, M) rad
    samples: tuple[tuple[int, ...], ...]  # (W, M) seen in all
    #: (W, M) seen until the weights that were kept
    best_samples: tuple[tuple[int, ...], ...]
    #: (W, M) of a processor in all, stopping's patience included
    seconds: tuple[tuple[float, ...], ...]
    #: (W, M, at most 40) of its tests
    curve_samples: tuple[tuple[tuple[int, ...], ...], ...]
    curve_test_loss: tuple[tuple[tuple[float, ...], ...], ...]
    experts_samples: int  # seen by the SIDM before
    #: (E,) test loss of each expert, the paper's first if it is one of them
    experts_loss: tuple[float, ...]
    experts_curve_samples: tuple[int, ...]  # of the SIDM's own training
    experts_curve_test_loss: tuple[float, ...]  # mean over the experts
    provenance: Provenance


#: where they are kept, under a folder of results
records = records_of(Pretrained, "several-experts")


def jobs(
    study: Study,
    system: str,
    counts: Iterable[int] = COUNTS,
    sizes: Iterable[float] = SIZES,
) -> list[Pretraining]:
    """Every number of experts with every seed; beside several, also a single one of the family."""
    preset, sizes, counts, found = (
        study.preset,
        study.preset.held(system, sizes),
        tuple(counts),
        [],
    )
    fresh = replace(preset.training_of(METHODS["novice_only"], system), **FINER_TESTS)
    trained = replace(
        preset.training_of(METHODS["pretrain_finetune"], system), **FINER_TESTS
    )
    further = tuple(size for size in preset.held(system, BEYOND) if size > max(sizes))
    whole = preset.datasets(system)["expert"].count
    groups = [(count, True) for count in counts] + [(1, False)] * (max(counts) > 1)
    for count, paper in groups:
        members = tuple(
            dataset(system, number, preset.policy, whole // count)
            for number in range(count - paper)
        )
        digests = tuple(find_digest(one, study.data, study.results) for one in members)
        own = sizes + (further if count == 1 and paper else ())
        found += [
            Pretraining(
                trial=study.trial(system, "pretrain_finetune", max(own), seed, trained),
                fresh=replace(fresh, frozen="sidm"),
                sizes=own,
                experts=count,
                paper=paper,
                roles=tuple(one.collection.role for one in members),
                members_data=digests,
            )
            for seed in range(preset.seeds)
        ]
    return found


def collect_family(
    study: Study,
    system: str,
    executor: Executor,
    wanted: Iterable[Pretraining] | None = None,
) -> None:
    """Simulate what is missing of the experts of the family, for some jobs or for all."""
    needed = members_needed(jobs(study, system) if wanted is None else wanted)
    collect_members(
        system, study.preset.policy, needed, study.data, study.results, executor
    )


def members_needed(wanted: Iterable[Pretraining]) -> dict[int, set[int]]:
    """Numbers of trajectories that are wanted of each member of the family."""
    needed: dict[int, set[int]] = {}
    for job in wanted:
        for number, one in enumerate(job.members):
            needed.setdefault(number, set()).add(one.count)
    return needed


def load_experts(
    about: Pretraining, data: str | Path
) -> tuple[dict[str, Windows], Standardisation]:
    """The experts' motion by name, and the units inside the networks, which are those of the paper's expert's data."""
    trial = about.trial
    paper, pixels = trial.datasets["expert"], trial.network.pixels
    whole = load_checked(paper, trial.digests["expert"], data, pixels)
    experts = (
        {"expert": whole.first(paper.count // about.experts)} if about.paper else {}
    )
    for number, own in enumerate(zip(about.members, about.members_data, strict=True)):
        experts[f"member{number}"] = load_checked(*own, data, pixels)
    return experts, Standardisation.of(whole)


def measure(about: Pretraining, data: str | Path = "data") -> Pretrained:
    """Train the SIDM and all novices of one job; ShardError where data are missing."""
    making, trial, library = Making("experts", about, data), about.trial, Library(data)
    with one_thread():
        experts, units = load_experts(about, data)
        weights, history = _sidm_of(about, experts, units, data)
        model = DynamicsModel(trial.network, units, trial.seed, tuple(experts))
        model.load_state_dict(weights)
        model.eval()
        found: list[list[dict[str, Any]]] = []  # (M, W)
        chosen, before = [], []
        for minutes in about.sizes:
            sets = library.datasets(trial.replace(novice_minutes=minutes))
            role = nearest(model, sets.train)  # type: ignore[arg-type]
            chosen.append(role)
            before.append(
                tuple(
                    float(validation_loss(model, sets.validation, one).sum())
                    for one in experts
                )
            )
            starts = {way: as_novice(model, role) for way in ("all", "parts")}
            starts["fresh_parts"] = fresh_around(
                model, trial.network, units, trial.seed
            )
            found.append(
                [_novice(about, way, sets, starts[way], units, library) for way in WAYS]
            )
        testing = {
            role: one.subset(split(len(one), len(one), trial.seed)[1])
            for role, one in experts.items()
        }
        # its training was stopped by it
        own = tuple(mean_loss(model, part, role) for role, part in testing.items())

    return Pretrained(
        about=about,
        nearest=tuple(chosen),
        before=tuple(before),
        **by_field([by_field(some) for some in zip(*found, strict=True)]),
        experts_samples=history["samples"],
        experts_loss=own,
        experts_curve_samples=history["curve_samples"],
        experts_curve_test_loss=history["curve_test_loss"],
        provenance=making.done(),
    )


def _sidm_of(
    about: Pretraining,
    experts: dict[str, Windows],
    units: Standardisation,
    data: str | Path,
) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """The weights of the SIDM and all experts' parts, and how they came about; trained once and kept under `data`."""
    trial = about.trial
    assert trial.pretraining is not None
    settings = map(repr, (trial.network, trial.pretraining))
    made_from = [
        *about.digests.values(),
        about.experts,
        about.paper,
        *settings,
        trial.seed,
    ]
    key = hashlib.sha256(json.dumps(made_from).encode()).hexdigest()[:20]
    where = Path(data) / "pretrained" / f"experts-{key}-{numbered('experts')}"
    kept = checkpoint.read(where)
    if kept is None:
        several = train_several(
            experts, trial.network, trial.pretraining, trial.seed, units
        )
        history = {"samples": several.samples, **_curve(several)}
        checkpoint.write(where, checkpoint.module_tensors(several.model), history)
        kept = checkpoint.read(where)
        assert kept is not None
    return kept


def _curve(trained: Trained) -> dict[str, tuple]:
    """The fields on its test loss along the training."""
    found = curve(trained)
    return {name: found[name] for name in ("curve_samples", "curve_test_loss")}


def _novice(
    about: Pretraining,
    way: str,
    sets: Datasets,
    start: Parts,
    units: Standardisation,
    library: Library,
) -> dict[str, Any]:
    """Train and judge one: the fields of `Pretrained` on it."""
    trial, begun = about.trial, time.process_time()
    trainings: Mapping[str, StudyTraining] = {
        "all": trial.training,
        "parts": replace(trial.training, frozen="sidm"),
        "fresh_parts": about.fresh,
    }
    trained = train(
        sets,
        trial.network,
        trainings[way],
        trial.seed,
        standardisation=units,
        start=start,
    )
    seconds = time.process_time() - begun
    found = judge(trained.model, trial, library)
    return {
        "validation_loss": float(found.losses.sum()),
        "component_losses": plain(found.losses),
        "position_error": float(found.position[-1]),
        "heading_error": float(found.heading[-1]),
        "samples": trained.samples,
        "best_samples": trained.best_samples,
        "seconds": seconds,
        **_curve(trained),
    }
