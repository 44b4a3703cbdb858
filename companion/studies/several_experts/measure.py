"""Several experts: an SIDM of 1, 2, 4 or 8 robots, and novices trained with it.

The question is how much data of its own a novice then needs (section 6).

`companion run --figure several-experts` makes the results that are not stored in
results/several_experts.jsonl yet. The experts are robots of the family around the
paper's four.
"""

from __future__ import annotations

import dataclasses
import hashlib
import re
import time
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from torch import Tensor

from companion.engine.datasets import digests_of
from companion.engine.library import Library, dataset_windows
from companion.engine.outcomes import as_lists, curve, evaluate
from companion.engine.pretrained import settings_of, weights_folder
from companion.engine.provenance import Provenance
from companion.engine.records import ProvenanceTimer, by_field, records_of
from companion.extensions.several import (
    SeveralTrainer,
    expert_as_novice,
    nearest_expert,
)
from companion.methods import FINER_TESTS, METHODS
from companion.study import Study
from companion.training import StudyTraining
from companion.trials import EXPERT_SEED, Dataset, Trial, motion_of
from sidm.config import config, replace
from sidm.learning import checkpoint
from sidm.learning.arithmetic import one_thread
from sidm.learning.dataset import Datasets, Windows
from sidm.learning.evaluation import mean_loss, validation_loss
from sidm.learning.model import DynamicsModel
from sidm.learning.training import Trained, learn, train
from sidm.learning.units import Standardisation
from sidm.shards import Collection, split_indices
from sidm.systems import System, family_robot, find_system

#: numbers of experts; together they have as many minutes as the paper's expert alone
COUNTS = (1, 2, 4, 8)
SIZES = (1.0, 5.0, 20.0)  # min of the novice's data
#: further sizes, min, with the paper's expert alone, from which savings of the others
#: are read
FURTHER_SIZES = (60.0,)

#: Ways to train the novice: which parts are trained, and where encoder and decoder
#: start. The SIDM continues to learn or is frozen.
WAYS = {
    "all": "all parts, from the nearest expert's",
    "parts": "encoder and decoder, from the nearest expert's",
    "fresh_parts": "encoder and decoder, fresh",
}


@config
class Pretraining:
    """One SIDM of several experts, and the novices that are trained with it."""

    #: gives the novice's data and the training of 'all' and 'parts'; its size is the
    #: largest one
    trial: Trial
    fresh: StudyTraining  # the training of 'fresh_parts'
    sizes: tuple[float, ...]  # min of the novice's data
    #: number of experts: family members, and the paper's expert if `paper`
    experts: int
    paper: bool  # whether the paper's expert is one of the experts
    roles: tuple[str, ...]  # roles of the members' collections

    @property
    def members(self) -> tuple[Dataset, ...]:
        """The members' datasets, all of the same number of trajectories."""
        paper = self.trial.datasets["expert"]
        count = paper.count // self.experts
        collections = (
            dataclasses.replace(paper.collection, role=role)  # type: ignore[type-var]
            for role in self.roles
        )
        return tuple(Dataset(collection=c, count=count) for c in collections)

    @property
    def datasets(self) -> dict[str, Dataset]:
        """The datasets of the trial and of the members, by kind or role."""
        return self.trial.datasets | dict(zip(self.roles, self.members, strict=True))


@config
class PretrainingResult:
    """Results of a Pretraining with E experts, W ways of WAYS and M sizes.

    Values are those of each novice's training unless said otherwise.
    """

    about: Pretraining
    nearest: tuple[str, ...]  # (M,) the expert whose parts the novice starts from
    #: (M, E) validation loss with each expert's parts before the novice is trained
    before: tuple[tuple[float, ...], ...]
    validation_loss: tuple[tuple[float, ...], ...]  # (W, M)
    component_losses: tuple[tuple[tuple[float, ...], ...], ...]  # (W, M, 13)
    #: (W, M) m, after 2.5 s, mean over the rollouts of the trial
    position_error: tuple[tuple[float, ...], ...]
    #: (W, M) rad, after 2.5 s, mean over the rollouts of the trial
    heading_error: tuple[tuple[float, ...], ...]
    samples: tuple[tuple[int, ...], ...]  # (W, M) seen in all
    #: (W, M) seen until the weights that were kept
    best_samples: tuple[tuple[int, ...], ...]
    #: (W, M) s of processor time in all, with the patience of early stopping
    seconds: tuple[tuple[float, ...], ...]
    #: (W, M, at most 40) of the tests
    curve_samples: tuple[tuple[tuple[int, ...], ...], ...]
    curve_test_loss: tuple[tuple[tuple[float, ...], ...], ...]
    experts_samples: int  # seen by the training of the SIDM on the experts
    #: (E,) test loss of each expert, the paper's first if it is one of them
    experts_loss: tuple[float, ...]
    experts_curve_samples: tuple[int, ...]  # of the tests of the experts' training
    experts_curve_test_loss: tuple[float, ...]  # mean over the experts
    provenance: Provenance


#: the stored results, under a folder of results
records = records_of(PretrainingResult, "several-experts")


def family_system(system: str, number: int) -> System:
    """A system of the paper with a member of the family as the expert."""
    paper = find_system(system)
    return replace(paper, name=system, expert=family_robot(number))


def dataset(system: str, number: int, policy: str, count: int) -> Dataset:
    """The first `count` trajectories of a family member on a system's ground.

    Another robot, ground or physics makes another dataset.
    """
    pair = family_system(system, number)
    description = repr((pair.expert, pair.terrain, pair.physics))
    mark = hashlib.sha256(description.encode()).hexdigest()[:8]
    collection = Collection(
        system=system, role=f"member{number}_{mark}", policy=policy, seed=EXPERT_SEED
    )
    return Dataset(collection=collection, count=count)


def robots(wanted: Dataset) -> System | None:
    """The system of a family member's dataset; None for another dataset."""
    found = re.fullmatch(r"member(\d+)_\w+", wanted.collection.role)
    if found is None:
        return None
    return family_system(wanted.collection.system, int(found[1]))


def jobs(
    study: Study,
    system: str,
    counts: Iterable[int] = COUNTS,
    sizes: Iterable[float] = SIZES,
) -> list[Pretraining]:
    """The pretrainings with every number of experts and every seed.

    Where several experts are asked for, there is also a single one of the family.
    `sizes`, min of the novice's data, beyond the preset's pool are left out.
    """
    preset, counts = study.preset, tuple(counts)
    sizes = preset.sizes_in_pool(system, sizes)
    if not sizes:
        return []
    further = preset.sizes_in_pool(system, FURTHER_SIZES)
    further = tuple(size for size in further if size > max(sizes))
    fresh, trained = (
        replace(preset.training_of(METHODS[method], system), **FINER_TESTS)
        for method in ("novice_only", "pretrain_finetune")
    )
    whole = preset.datasets(system)["expert"].count
    groups = [(count, True) for count in counts]
    if max(counts) > 1:
        groups.append((1, False))
    pretrainings = []
    for count, paper in groups:
        members = [
            dataset(system, number, preset.policy, whole // count)
            for number in range(count - 1 if paper else count)
        ]
        novice_sizes = sizes + (further if count == 1 and paper else ())
        for seed in range(preset.seeds):
            trial = study.trial(
                system, "pretrain_finetune", max(novice_sizes), seed, trained
            )
            pretraining = Pretraining(
                trial=trial,
                fresh=replace(fresh, frozen="sidm"),
                sizes=novice_sizes,
                experts=count,
                paper=paper,
                roles=tuple(member.collection.role for member in members),
            )
            pretrainings.append(pretraining)
    return pretrainings


def motion(about: Pretraining) -> dict[Dataset, Sequence[int]]:
    """The motion that a job needs: its trial's, and the members' whole."""
    members = {one: range(one.count) for one in about.members}
    return {**motion_of([about.trial]), **members}


def measure(about: Pretraining, data: str | Path = "data") -> PretrainingResult:
    """Train the SIDM on the experts, then all novices of a job."""
    timer = ProvenanceTimer("experts", about, data)
    trial, library = about.trial, Library(data)
    training = {
        "all": trial.training,
        "parts": replace(trial.training, frozen="sidm"),
        "fresh_parts": about.fresh,
    }
    paper, pixels = trial.datasets["expert"], trial.network.pixels
    with one_thread():
        whole = dataset_windows(paper, data, pixels)
        experts = {}
        if about.paper:
            experts["expert"] = whole.first(paper.count // about.experts)
        for number, member in enumerate(about.members):
            experts[f"member{number}"] = dataset_windows(member, data, pixels)
        units = Standardisation.fit(whole)
        weights, history = _train_experts(about, experts, units, data)
        model = DynamicsModel(trial.network, units, trial.seed, tuple(experts))
        model.load_state_dict(weights)
        model.eval()
        fresh = {n: w for n, w in weights.items() if n.startswith("sidm.")}
        novices: list[list[dict[str, Any]]] = []  # (M, W)
        chosen, before = [], []
        for minutes in about.sizes:
            sets = library.datasets(trial.replace(novice_minutes=minutes))
            role = nearest_expert(model, sets.train)  # type: ignore[arg-type]
            chosen.append(role)
            losses = (validation_loss(model, sets.validation, name) for name in experts)
            before.append(tuple(float(loss.sum()) for loss in losses))
            nearest = expert_as_novice(model, role)
            starts = {"all": nearest, "parts": nearest, "fresh_parts": fresh}
            fields = [
                _train_novice(trial, training[way], sets, starts[way], units, library)
                for way in WAYS
            ]
            novices.append(fields)
        experts_loss = []
        for role, motion in experts.items():
            # the test split, by which the training on the experts was stopped
            _, test = split_indices(len(motion), len(motion), trial.seed)
            experts_loss.append(mean_loss(model, motion.subset(test), role))
    by_way = [by_field(sizes) for sizes in zip(*novices, strict=True)]
    return PretrainingResult(
        about=about,
        nearest=tuple(chosen),
        before=tuple(before),
        **by_field(by_way),
        experts_samples=history["samples"],
        experts_loss=tuple(experts_loss),
        experts_curve_samples=history["curve_samples"],
        experts_curve_test_loss=history["curve_test_loss"],
        provenance=timer.done(),
    )


def _train_experts(
    about: Pretraining,
    experts: dict[str, Windows],
    units: Standardisation,
    data: str | Path,
) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Weights of the SIDM and of all experts' parts, and how the training went.

    They are trained once and kept under `data`.
    """
    trial = about.trial
    assert trial.pretraining is not None
    made_from = {
        "digests": digests_of(about, data),
        "experts": about.experts,
        "paper": about.paper,
        "seed": trial.seed,
    } | settings_of(trial.network, trial.pretraining)
    folder = weights_folder(data, made_from, "experts", "experts-")
    kept = checkpoint.read(folder)
    if kept is None:
        settings = trial.network, trial.pretraining, trial.seed, units
        trained = learn(SeveralTrainer(experts, *settings))
        history = {"samples": trained.samples, **_test_curve(trained)}
        checkpoint.write(folder, trained.model.state_dict(), history)
        kept = checkpoint.read(folder)
        assert kept is not None
    return kept


def _test_curve(trained: Trained) -> dict[str, tuple]:
    fields = curve(trained)
    return {name: fields[name] for name in ("curve_samples", "curve_test_loss")}


def _train_novice(
    trial: Trial,
    training: StudyTraining,
    sets: Datasets,
    start: Mapping[str, Tensor],
    units: Standardisation,
    library: Library,
) -> dict[str, Any]:
    """Train and evaluate a novice: the fields of PretrainingResult for it."""
    begun, settings = time.process_time(), (trial.network, training, trial.seed)
    trained = train(sets, *settings, standardisation=units, start=start)
    seconds = time.process_time() - begun
    evaluation = evaluate(trained.model, trial, library)
    return {
        "validation_loss": float(evaluation.losses.sum()),
        "component_losses": as_lists(evaluation.losses),
        "position_error": float(evaluation.position[-1]),
        "heading_error": float(evaluation.heading[-1]),
        "samples": trained.samples,
        "best_samples": trained.best_samples,
        "seconds": seconds,
        **_test_curve(trained),
    }
