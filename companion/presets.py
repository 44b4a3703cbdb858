"""Presets: how much of the study is run, from a test's seconds to the paper's sizes.

This table is the only place where a preset's numbers stand; `params/NAME.yaml` names
the preset to the notebooks.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from typing import Any, Literal

from companion.training import StudyTraining
from companion.trials import Dataset, datasets
from sidm.config import (
    ConfigError,
    config,
    conform,
    refuse_nonsense,
    replace,
    unknown_name,
)
from sidm.rivals.methods import Method
from sidm.settings import PAPER_NETWORK, RELEASED_NETWORK, Network
from sidm.systems import FREE_STRUTS, find_system

#: The exploration policies of `sidm.simulation`, which need not be installed to read
#: results.
POLICIES = ("ornstein_uhlenbeck", "sinusoid", "bounded_noise", "held")

MOST_SEEDS = 1000  # trials a point

PresetName = Literal["smoke", "laptop", "study", "released", "paper"]


@config
class Preset:
    """The sizes of a study; the book's page on running it again says why they are so."""

    name: str
    expert_minutes: float
    novice_minutes_system1: tuple[float, ...]  # the sizes of Figure 3's left plot
    novice_minutes_system2: tuple[float, ...]  # the sizes of Figure 3's right plot
    pool_minutes_system1: float  # of the pool that the novice subsets are drawn from
    pool_minutes_system2: float
    validation_minutes: float
    rollouts: int  # trajectories of the 25-step test
    seeds: int  # trials a point
    #: minutes of a size that has more of them, and how many
    more_seeds: tuple[tuple[float, int], ...] = ()
    figure4_minutes: tuple[float, ...] = (5.0, 120.0)
    figure4_seeds: int = 10  # trials a point of Figure 4
    #: a small and a middle size: of the baselines and the diagnostics
    baseline_minutes: tuple[float, ...] = (5.0, 20.0)
    variant_minutes: tuple[float, ...] = (1.0, 2.0, 5.0, 10.0)
    ablation_minutes: tuple[float, ...] = (5.0, 20.0)  # a small and a middle size
    #: of novices that see or act otherwise than their expert
    other_body_minutes: tuple[float, ...] = (1.0, 5.0)
    ablation_seeds: int = 10  # trials a point of the ablations
    #: the sizes at which the methods are tuned
    tuning_minutes: tuple[float, ...] = (20.0,)
    #: of a pool that only settings are chosen by; 0: it is the figures'
    tuning_pool_minutes: float = 0.0
    tuning_validation_minutes: float = 20.0  # beside such a pool
    #: what the novice's motion serves
    motion: Literal["figures", "tuning", "claim", "decisive"] = "figures"
    #: names of its grids; none: those that every preset has
    figures: tuple[str, ...] = ()
    p_expert_system1: float = 0.75  # section 4: the systems are similar
    p_expert_system2: float = 0.5  # section 4: they differ greatly
    policy: str = "ornstein_uhlenbeck"  # that explores, in all but the 25-step test
    network: Network = Network()
    training: StudyTraining = StudyTraining()
    #: method, setting of its training, value instead of `training`'s
    tuned: tuple[tuple[str, str, Any], ...] = ()
    #: methods that stand beside Figure 3 at every size
    references: tuple[str, ...] = ("least_squares",)
    #: sizes of Figure 3 with free struts
    free_strut_minutes: tuple[float, ...] = (1.0, 5.0, 20.0, 60.0)
    free_strut_seeds: int = 5  # trials a point of it

    def __post_init__(self) -> None:
        """Refuse sizes that the pools do not hold."""
        refuse_nonsense(self)
        for system in ("system1", "system2"):
            most, pool = (
                max(self.novice_minutes(system), default=0),
                self.pool_minutes(system),
            )
            if most > pool:
                raise ConfigError(
                    f"novice_minutes_{system} asks for {most:g}, but pool_minutes_{system} is {pool:g}"
                )
        for name, value in vars(self).items():
            values = value if isinstance(value, tuple) else (value,)
            if (
                "minutes" in name
                and name != "tuning_pool_minutes"
                and not all(one > 0 for one in values)
            ):
                raise ConfigError(f"{name} must be positive, not {value}")
            if name.startswith("p_expert") and not 0 <= value <= 1:
                raise ConfigError(f"{name} must be from 0 to 1, not {value}")
            if (
                name.endswith("seeds")
                and name != "more_seeds"
                and not 1 <= value <= MOST_SEEDS
            ):
                raise ConfigError(f"{name} must be from 1 to {MOST_SEEDS}, not {value}")
        names = {field.name for field in dataclasses.fields(StudyTraining)} - {
            "p_expert",
            "regularise",
        }  # type: ignore
        for _, setting, _ in self.tuned:
            if setting not in names:
                raise unknown_name(setting, names, "what a method is tuned in")
        if self.policy not in POLICIES:
            raise unknown_name(self.policy, POLICIES, "the exploration policies")
        if self.rollouts < 1:
            raise ConfigError(f"rollouts must be at least 1, not {self.rollouts}")

    def _of(self, system: str, name: str) -> Any:
        """A value that differs between the paper's systems; a system of your own has system 1's."""
        base = find_system(system).name.removesuffix(FREE_STRUTS)
        return getattr(self, f"{name}_{base}", getattr(self, f"{name}_system1"))

    def novice_minutes(self, system: str) -> tuple[float, ...]:
        """The novice dataset sizes of a system's Figure 3, in minutes of motion."""
        return self._of(system, "novice_minutes")

    def pool_minutes(self, system: str) -> float:
        """Minutes of motion in a system's novice pool."""
        return self._of(system, "pool_minutes")

    def held(self, system: str, sizes: Iterable[float]) -> tuple[float, ...]:
        """Those of some sizes, in minutes, that a system's novice pool holds."""
        return tuple(size for size in sizes if size <= self.pool_minutes(system))

    def p_expert(self, system: str) -> float:
        """The paper's p_e for a system."""
        return self._of(system, "p_expert")

    def training_of(self, method: Method, system: str) -> StudyTraining:
        """A method's training on a system's novice, with what the method was tuned to."""
        base = replace(self.training, p_expert=self.p_expert(system))
        return method.training(base, self.tuned_values(method.tuned_as))

    def pretraining_of(self, method: Method) -> StudyTraining | None:
        """A method's training on the expert alone; None for a method that begins afresh."""
        return method.pretraining(self.training, self.tuned_values("pretraining"))

    def tuned_values(self, method: str) -> dict[str, Any]:
        """The settings of its training that a method was tuned to; 'pretraining' stands for that on the expert."""
        return {setting: value for name, setting, value in self.tuned if name == method}

    def datasets(self, system: str) -> dict[str, Dataset]:
        """What all trials of a system need: 'novice' (the pool), 'expert', 'validation', 'rollout'."""
        return datasets(self, system, self.pool_minutes(system))

    def with_motion(
        self, motion: str, pool_minutes: float, validation_minutes: float
    ) -> Preset:
        """The same with motion of the novice that serves something else than figures."""
        pools = dict.fromkeys(
            ("pool_minutes_system1", "pool_minutes_system2"), pool_minutes
        )
        largest = {
            name: () for name in ("novice_minutes_system1", "novice_minutes_system2")
        }
        return self.replace(
            motion=motion, validation_minutes=validation_minutes, **pools, **largest
        )

    def for_tuning(self) -> Preset:
        """The same with the motion that settings are chosen by."""
        if not self.tuning_pool_minutes:
            return self
        chosen = self.with_motion(
            "tuning", self.tuning_pool_minutes, self.tuning_validation_minutes
        )
        return chosen.replace(tuning_pool_minutes=0.0)

    def every_dataset(self, system: str) -> list[Dataset]:
        """Those of all trials of a system, each once."""
        return list(
            dict.fromkeys(
                [
                    *self.datasets(system).values(),
                    *self.for_tuning().datasets(system).values(),
                ]
            )
        )

    def seeds_at(self, minutes: float) -> int:
        """Trials of a size."""
        return dict(self.more_seeds).get(minutes, self.seeds)

    def replace(self, **changes: Any) -> Preset:
        """This preset with some values changed: its own, its network's or its training's, all by their plain names.

        A value of the training holds for every method then, also for one that was tuned
        to another.

        Raises:
            ConfigError: an unknown name, with the nearest right one, or a value of the
                wrong type. `p_expert` and `regularise` are the method's to set and not
                known here.
        """
        own, parts = (
            dict(vars(self)),
            {
                "network": dict(vars(self.network)),
                "training": dict(vars(self.training)),
            },
        )
        own["tuned"] = tuple(one for one in self.tuned if one[1] not in changes)
        groups = [own, *parts.values()]
        hidden = {"name", "p_expert", "regularise", *parts}
        for name, value in changes.items():
            group = next(
                (group for group in groups if name in group and name not in hidden),
                None,
            )
            if group is None:
                raise unknown_name(
                    name,
                    (n for group in groups for n in group if n not in hidden),
                    "a preset",
                )
            group[name] = value
        own |= {
            "network": Network(**parts["network"]),
            "training": StudyTraining(**parts["training"]),
        }
        return Preset(**own)


_PAPER_SIZES: dict[str, Any] = dict(
    expert_minutes=500_000 / 600,  # 500,000 control steps of 0.1 s: 13.9 h
    novice_minutes_system1=(1, 2, 5, 20, 60, 120, 300, 600),
    novice_minutes_system2=(1, 2, 5, 10, 20, 60, 120, 300),
    pool_minutes_system1=600,
    pool_minutes_system2=300,
    validation_minutes=120,
    rollouts=100,
    seeds=10,
)

_LAPTOP_TUNED = (  # the best of `tuning.TRIES`
    ("novice_only", "weight_decay", 0.1),
    ("sidm", "matching_iterations", 5),
    ("pretrain_finetune", "learning_rate", 1e-4),
    ("copies", "learning_rate", 1e-4),  # as that of fine-tuning, which it goes on like
    ("copies", "matching_iterations", 5),  # as SIDM's
)

_LAPTOP: dict[str, Any] = dict(
    expert_minutes=120,
    novice_minutes_system1=(1, 2, 5, 20, 60, 120),
    novice_minutes_system2=(1, 2, 5, 20, 60, 120),
    pool_minutes_system1=120,
    pool_minutes_system2=120,
    validation_minutes=20,
    rollouts=32,
    seeds=3,
    network=Network(pixels=32, layers=3, hidden=256),
    training=StudyTraining(max_samples=1_000_000, patience=150_000),
    tuned=_LAPTOP_TUNED,
)

#: The presets by name.
PRESETS: dict[str, Preset] = {
    preset.name: preset
    for preset in (
        Preset(
            name="smoke",
            expert_minutes=1,
            novice_minutes_system1=(0.5, 2),
            novice_minutes_system2=(0.5, 2),
            pool_minutes_system1=2,
            pool_minutes_system2=2,
            validation_minutes=1,
            rollouts=2,
            seeds=1,
            figure4_minutes=(0.5, 2),
            figure4_seeds=1,
            tuning_minutes=(0.5,),
            baseline_minutes=(0.5,),
            variant_minutes=(0.5,),
            ablation_minutes=(0.5,),
            other_body_minutes=(0.5,),
            ablation_seeds=1,
            free_strut_minutes=(0.5, 2),
            free_strut_seeds=1,
            network=Network(pixels=16, layers=1, hidden=32),
            training=StudyTraining(
                prediction_iterations=5,
                discriminator_iterations=2,
                matching_iterations=2,
                test_interval=5,
                max_samples=5_000,
            ),
        ),
        Preset(name="laptop", **_LAPTOP, ablation_minutes=(5.0,), ablation_seeds=3),
        Preset(
            # the laptop's trials and more of them, on its motion; its grids in the
            # order of worth
            name="study",
            **(_LAPTOP | {"seeds": 5}),
            more_seeds=((1, 10), (5, 10)),
            figures=(
                "duration",
                "free-struts",
                "3",
                "references",
                "4",
                "network-size",
                "tuning",
                "little-data",
                "corrected-claim",
            ),
            references=("least_squares", "corrected_averaged"),
            tuning_minutes=(5,),
            tuning_pool_minutes=60,
        ),
        Preset(
            name="released",
            **_PAPER_SIZES,
            network=RELEASED_NETWORK,
            training=StudyTraining(max_samples=20_000_000),
        ),
        Preset(
            name="paper",
            **_PAPER_SIZES,
            network=PAPER_NETWORK,
            training=StudyTraining(max_samples=20_000_000),
        ),
    )
}


def load_preset(name: str, /, **changes: Any) -> Preset:
    """The preset of that name with some values changed, as `Preset.replace` does it.

    Raises:
        ConfigError: no such preset (naming the nearest), no such value, or one of the
            wrong type.
    """
    preset = PRESETS[conform(name, PresetName, "preset")]
    return preset.replace(**changes) if changes else preset
