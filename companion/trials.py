"""Trials: a trial is everything that the result of one training run depends on."""

from __future__ import annotations

import functools
import hashlib
import json
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any, Literal

from companion.training import StudyTraining
from sidm.config import (
    ConfigError,
    check_at_least,
    check_numbers,
    config,
    replace,
    to_mapping,
)
from sidm.settings import Network
from sidm.shards import Collection, novice_split, trajectories_for
from sidm.systems import find_system

if TYPE_CHECKING:
    import numpy as np

#: Seeds of the collections, so that no two datasets share a trajectory.
POOL_SEED, VALIDATION_SEED, EXPERT_SEED, ROLLOUT_SEED = 0, 1, 2, 3

#: Purpose of the novice's motion -> number added to the seeds of pool, validation and
#: rollouts. Settings are chosen on other motion than the figures show. The expert's
#: motion is the same for all purposes.
MOTION = {"figures": 0, "tuning": 10, "claim": 20, "decisive": 30}


@config
class Dataset:
    """The first `count` trajectories of a collection."""

    collection: Collection
    count: int

    @property
    def name(self) -> str:
        """The name in messages and files, as 'system1/novice/sinusoid/seed-0/1125'."""
        c = self.collection
        return f"{c.system}/{c.role}/{c.policy}/seed-{c.seed}/{self.count}"


def datasets(sizes: Any, system: str, pool_minutes: float) -> dict[str, Dataset]:
    """The four datasets of one system: 'novice' (the pool), 'expert' and two to judge.

    These are 'validation' and 'rollout'. `sizes` is a preset or a trial.
    """

    def dataset(role: str, seed: int, count: int, policy: str) -> Dataset:
        seed += MOTION[sizes.motion] if role == "novice" else 0
        collection = Collection(system=system, role=role, policy=policy, seed=seed)
        return Dataset(collection=collection, count=count)

    policy, pool = sizes.policy, trajectories_for(pool_minutes)
    expert = trajectories_for(sizes.expert_minutes)
    validation = trajectories_for(sizes.validation_minutes)
    return {
        "novice": dataset("novice", POOL_SEED, pool, policy),
        "expert": dataset("expert", EXPERT_SEED, expert, policy),
        "validation": dataset("novice", VALIDATION_SEED, validation, policy),
        "rollout": dataset("novice", ROLLOUT_SEED, sizes.rollouts, "held"),
    }


#: Fields that were added to a trial, its network or its trainings later, with their
#: defaults. Keys leave them out at these defaults, so that older keys stay valid.
LATER = (
    ("fit", "gradients"),
    ("motion", "figures"),
    ("novice_body", None),
    ("expert_body", None),
    ("pretrained", "all"),
    ("validation_trajectories", 64),
    ("units", "standardised"),
    ("zero_gradients", False),
    ("replacement", True),
    ("discriminator_draw", "both"),
    ("resolution", ()),
)


@config
class Trial:
    """One training run: its method, its data, its network and its seed.

    Attributes:
        system: the pair of robots
        method: a name of `methods.METHODS`; the other fields have what it means
        novice_minutes: motion of the novice, train and test together, min
        seed: seed of the novice subset, the initial weights and the batches; methods
            are compared at equal seeds
        pool_minutes: novice pool that the subset is drawn from, min
        expert_minutes: motion of the expert, min
        validation_minutes: motion of the novice from which nothing is learnt, min
        rollouts: trajectories of the 25-step test
        policy: exploration policy of pool, expert and validation data
        network: sizes of all networks
        training: settings of the method's training
        pretraining: settings of training on the expert alone, whose weights the novice
            starts from; none: fresh weights
        pretrained: weights that are taken from the pretraining; 'sidm': the shared part
            alone
        residual: whether the pretrained model stays as it is, and a model with fresh
            weights learns to correct it
        fit: how weights are found: by the training loop, or in closed form
        motion: purpose of the novice's motion, a key of `trials.MOTION`
    """

    system: str
    method: str
    novice_minutes: float
    seed: int
    pool_minutes: float
    expert_minutes: float
    validation_minutes: float
    rollouts: int
    policy: str = "ornstein_uhlenbeck"
    network: Network = Network()
    training: StudyTraining = StudyTraining()
    pretraining: StudyTraining | None = None
    pretrained: Literal["all", "sidm"] = "all"
    residual: bool = False
    fit: Literal["gradients", "least_squares"] = "gradients"
    motion: Literal["figures", "tuning", "claim", "decisive"] = "figures"

    def __post_init__(self) -> None:
        """Refuse a trial that cannot be run."""
        check_numbers(self)
        find_system(self.system)
        if not 0 < self.novice_minutes <= self.pool_minutes:
            raise ConfigError(
                "Trial.novice_minutes must be above 0 and at most pool_minutes "
                f"({self.pool_minutes:g}), not {self.novice_minutes:g}"
            )
        check_at_least(self, 1, "rollouts")
        pretrains = self.pretraining is not None
        if self.pretraining is not None and self.pretraining.needs_expert:
            raise ConfigError(
                "Trial.pretraining has the expert in the novice's place: p_expert=0 "
                "and regularise=False"
            )
        if pretrains and self.pretrained == "all" and not self.network.same_body:
            novice, expert = self.network.body("novice"), self.network.body("expert")
            raise ConfigError(
                f"{self.method} copies the expert's encoder and decoder, which needs "
                f"robots of one body; '{novice.name}' is not '{expert.name}'"
            )
        if self.pretrained == "sidm" and (self.residual or not pretrains):
            raise ConfigError(
                "Trial.pretrained='sidm' goes with a pretraining, and not with residual"
            )
        if self.residual and (self.training.needs_expert or not pretrains):
            raise ConfigError(
                "Trial.residual goes with a pretraining, and with p_expert=0 and "
                "regularise=False"
            )
        if self.solved and (self.training.needs_expert or self.residual != pretrains):
            raise ConfigError(
                "Trial.fit='least_squares' stands alone, or is the residual of a "
                "pretraining"
            )

    @property
    def datasets(self) -> dict[str, Dataset]:
        """Datasets of training and evaluation, by the names that `datasets` gives."""
        return datasets(self, self.system, self.pool_minutes)

    @property
    def drawn(self) -> tuple[np.ndarray, np.ndarray]:
        """Indices (n,) and (m,) in the novice's pool, to train on and to test on."""
        pool = self.datasets["novice"].count
        return novice_split(pool, self.novice_minutes, self.seed)

    @property
    def solved(self) -> bool:
        """Whether the weights are computed in closed form."""
        return self.fit == "least_squares"

    @functools.cached_property
    def key(self) -> str:
        """The key of the trial's stored result."""
        return key_of(self)

    def __str__(self) -> str:
        """The name in messages and progress bars."""
        size = f"{self.novice_minutes:g} min"
        return f"{self.system} {self.method} {size} seed {self.seed}"

    def replace(self, **changes: Any) -> Trial:
        """A trial with some values changed, which is checked like any trial."""
        return replace(self, **changes)


def motion_of(trials: Iterable[Trial]) -> dict[Dataset, list[int]]:
    """The motion that trials need: indices of the trajectories of each dataset.

    Of the novice's pools these are the trajectories that the trials draw.
    """
    needed: dict[Dataset, set[int]] = {}
    for trial in trials:
        for kind, dataset in trial.datasets.items():
            indices = needed.setdefault(dataset, set())
            if kind == "novice":
                indices.update(*(part.tolist() for part in trial.drawn))
            elif not indices:
                indices.update(range(dataset.count))
    return {dataset: sorted(indices) for dataset, indices in needed.items()}


def key_of(about: Any) -> str:
    """20 hexadecimal digits that change when any value of a `config` object does."""
    values = without_later(to_mapping(about))
    text = json.dumps(values, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:20]


def without_later(values: Mapping[str, Any]) -> dict[str, Any]:
    """Nested values without the fields of LATER that have their defaults."""
    return {
        name: without_later(value) if isinstance(value, Mapping) else value
        for name, value in values.items()
        if (name, value) not in LATER
    }
