"""A trial: everything that the result of one training run depends on."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import json
from collections.abc import Mapping
from typing import Any, Literal

from companion.training import StudyTraining
from sidm.config import ConfigError, config, refuse_nonsense, to_mapping
from sidm.settings import Network
from sidm.shards import Collection, trajectories_for
from sidm.systems import find_system

#: Stands for the digest of a dataset that was never collected here nor belongs to a
#: stored result.
UNKNOWN = "unknown"

#: Seeds of the collections; each dataset's trajectories are disjoint from the others'.
POOL_SEED, VALIDATION_SEED, EXPERT_SEED, ROLLOUT_SEED = 0, 1, 2, 3

#: Novice motion by what it serves -> what is added to the seeds of pool, validation and
#: rollouts. What settings are chosen by is never what a figure is drawn from. The
#: expert's motion serves all.
MOTION = {"figures": 0, "tuning": 10, "claim": 20, "decisive": 30}


@config
class Dataset:
    """The first `count` trajectories of a collection."""

    collection: Collection
    count: int

    @property
    def name(self) -> str:
        """For people and files, as 'system1/novice/ornstein_uhlenbeck/seed-0/1125'."""
        c = self.collection
        return f"{c.system}/{c.role}/{c.policy}/seed-{c.seed}/{self.count}"


def datasets(sizes: Any, system: str, pool_minutes: float) -> dict[str, Dataset]:
    """The four datasets of a study of one system: 'novice' (the pool), 'expert', 'validation' and 'rollout'.

    Their `sizes`, policy and motion are a Trial's or a Preset's.
    """

    def dataset(
        role: str, seed: int, count: int, policy: str = sizes.policy
    ) -> Dataset:
        seed += MOTION[sizes.motion] if role == "novice" else 0
        return Dataset(
            collection=Collection(system=system, role=role, policy=policy, seed=seed),
            count=count,
        )

    return {
        "novice": dataset("novice", POOL_SEED, trajectories_for(pool_minutes)),
        "expert": dataset(
            "expert", EXPERT_SEED, trajectories_for(sizes.expert_minutes)
        ),
        "validation": dataset(
            "novice", VALIDATION_SEED, trajectories_for(sizes.validation_minutes)
        ),
        "rollout": dataset("novice", ROLLOUT_SEED, sizes.rollouts, policy="held"),
    }


#: Values that a trial, its network or trainings did not have from the first, and what
#: they are where it does not say.
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
)


@config
class Trial:
    """One training run: its method, its data (by digest), its network and its seed.

    Attributes:
        system: the pair of robots
        method: a name of `methods.METHODS`; what it means stands in `training`
        novice_minutes: of motion of the novice, min, train and test together
        seed: of the novice subset, the initial weights and the batches; pairs the
            methods
        pool_minutes: of the novice pool that the subset is drawn from, min
        expert_minutes: of motion of the expert, min
        validation_minutes: of motion of the novice that nothing is learnt from, min
        rollouts: trajectories of the 25-step test
        policy: that made pool, expert and validation data
        novice_data: digest of the pool
        expert_data: of the expert's motion
        validation_data: of the validation motion
        rollout_data: of the rollouts
        network: sizes of all networks
        training: of the method
        pretraining: on the expert alone, whose weights the novice starts from; none:
            fresh
        pretrained: what of those weights it starts from; 'sidm': the shared part alone
        residual: the pretrained model stays as it is; what is learnt, from fresh
            weights, corrects it
        fit: the training loop, or weights in closed form
        motion: what the novice's motion serves, of MOTION
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
    novice_data: str = UNKNOWN
    expert_data: str = UNKNOWN
    validation_data: str = UNKNOWN
    rollout_data: str = UNKNOWN
    network: Network = Network()
    training: StudyTraining = StudyTraining()
    pretraining: StudyTraining | None = None
    pretrained: Literal["all", "sidm"] = "all"
    residual: bool = False
    fit: Literal["gradients", "least_squares"] = "gradients"
    motion: Literal["figures", "tuning", "claim", "decisive"] = "figures"

    def __post_init__(self) -> None:
        """Refuse a trial that cannot be run."""
        refuse_nonsense(self)
        find_system(self.system)
        if not 0 < self.novice_minutes <= self.pool_minutes:
            raise ConfigError(
                f"Trial.novice_minutes must be above 0 and at most pool_minutes ({self.pool_minutes:g}), "
                f"not {self.novice_minutes:g}"
            )
        if self.rollouts < 1:
            raise ConfigError(f"Trial.rollouts must be at least 1, not {self.rollouts}")
        if self.pretraining is not None and self.pretraining.needs_expert:
            raise ConfigError(
                "Trial.pretraining has the expert in the novice's place: p_expert=0 and regularise=False"
            )
        if (
            self.pretraining is not None
            and self.pretrained == "all"
            and not self.network.alike
        ):
            novice, expert = self.network.body("novice"), self.network.body("expert")
            raise ConfigError(
                f"{self.method} copies the expert's encoder and decoder, which needs robots of one body; "
                f"'{novice.name}' is not '{expert.name}'"
            )
        if self.pretrained == "sidm" and (self.pretraining is None or self.residual):
            raise ConfigError(
                "Trial.pretrained='sidm' goes with a pretraining, and not with residual"
            )
        if self.residual and (self.pretraining is None or self.training.needs_expert):
            raise ConfigError(
                "Trial.residual goes with a pretraining, and with p_expert=0 and regularise=False"
            )
        if self.solved and (
            self.training.needs_expert
            or self.residual != (self.pretraining is not None)
        ):
            raise ConfigError(
                "Trial.fit='least_squares' stands alone, or is the residual of a pretraining"
            )

    @property
    def datasets(self) -> dict[str, Dataset]:
        """What it learns from and is judged on, 'novice' (the pool), 'expert', 'validation', 'rollout'."""
        return datasets(self, self.system, self.pool_minutes)

    @property
    def digests(self) -> dict[str, str]:
        """The digests of `datasets`, by the same names."""
        return {name: getattr(self, f"{name}_data") for name in self.datasets}

    @property
    def solved(self) -> bool:
        """Whether its weights have a closed form."""
        return self.fit == "least_squares"

    @functools.cached_property
    def key(self) -> str:
        """20 hexadecimal digits that change when any value of the trial does."""
        return key_of_values(self.to_json())

    def __str__(self) -> str:
        """For messages and progress bars."""
        return (
            f"{self.system} {self.method} {self.novice_minutes:g} min seed {self.seed}"
        )

    def replace(self, **changes: Any) -> Trial:
        """The same trial with some values changed, checked like a new one."""
        return dataclasses.replace(self, **changes)  # type: ignore[type-var]

    def to_json(self) -> dict[str, Any]:
        """All its values as plain nested mappings, without those of LATER by default, so that older keys still hold."""
        return without_later(to_mapping(self))


def key_of_values(values: Mapping[str, Any]) -> str:
    """20 hexadecimal digits that change when any of some plain nested values does."""
    text = json.dumps(values, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:20]


def without_later(values: Mapping[str, Any]) -> dict[str, Any]:
    """Values without those of LATER, at any depth."""
    return {
        name: without_later(value) if isinstance(value, Mapping) else value
        for name, value in values.items()
        if (name, value) not in LATER
    }
