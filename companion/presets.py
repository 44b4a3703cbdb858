"""Presets: the sizes of a study, from a test of some seconds to the paper's sizes.

The numbers of a preset stand here only; `params/NAME.yaml` gives its name to the
notebooks.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any, Literal

from companion.training import StudyTraining
from companion.trials import Dataset, datasets
from ownrobot.command_line import parse_changes
from ownrobot.methods.registry import Method
from sidm.config import (
    ConfigError,
    check_numbers,
    config,
    conform,
    replace,
    unknown_name,
)
from sidm.settings import PAPER_NETWORK, RELEASED_NETWORK, Network
from sidm.systems import FREE_STRUTS, find_system

#: The exploration policies of `sidm.simulation`. They are repeated here because results
#: can be read without that package's requirements.
POLICIES = ("ornstein_uhlenbeck", "sinusoid", "bounded_noise", "held")

MOST_SEEDS = 1000  # trials per point

PresetName = Literal["smoke", "laptop", "study", "released", "paper"]


@config
class Preset:
    """The sizes of a study; the book's page on running it again gives the reasons.

    A point is a method at a size, that is a number of minutes of novice data; there are
    several trials per point, one for each seed.

    Attributes:
        name: name of the preset
        expert_minutes: motion of the expert, min
        novice_minutes_system1: sizes of the left plot of Figure 3, min
        novice_minutes_system2: sizes of the right plot of Figure 3, min
        pool_minutes_system1: pool that the novice subsets are drawn from, min
        pool_minutes_system2: the same for system 2, min
        validation_minutes: motion of the novice for validation, min
        rollouts: trajectories of the 25-step test
        seeds: trials per point
        more_seeds: sizes, min, that have more trials per point, and how many
        figure4_minutes: sizes of Figure 4, min
        figure4_seeds: trials per point of Figure 4
        baseline_minutes: sizes of the baselines and diagnostics, min: a small and a
            middle one
        variant_minutes: sizes of the variants, min
        ablation_minutes: sizes of the ablations, min: a small and a middle one
        other_body_minutes: sizes of novices that sense or act unlike their expert, min
        ablation_seeds: trials per point of the ablations
        tuning_minutes: sizes at which the methods are tuned, min
        tuning_pool_minutes: pool that serves only to choose settings, min; 0: settings
            are chosen on the pool of the figures
        tuning_validation_minutes: validation motion that goes with such a pool, min
        motion: purpose of the novice's motion, a key of `trials.MOTION`
        figures: names of its figures; empty: those that every preset has
        p_expert_system1: p_e of system 1, whose robots are similar (section 4)
        p_expert_system2: p_e of system 2, whose robots differ greatly (section 4)
        policy: exploration policy of all motion except the 25-step test
        network: sizes of the networks
        training: settings of training
        tuned: method, setting of its training, and the value that replaces the one of
            `training`
        references: methods that are shown beside Figure 3 at every size
        free_strut_minutes: sizes of Figure 3 with free struts, min
        free_strut_seeds: trials per point of Figure 3 with free struts

    Raises:
        ConfigError: an unknown name, a wrong type, or sizes that do not fit each other.
    """

    name: str
    expert_minutes: float
    novice_minutes_system1: tuple[float, ...]
    novice_minutes_system2: tuple[float, ...]
    pool_minutes_system1: float
    pool_minutes_system2: float
    validation_minutes: float
    rollouts: int
    seeds: int
    more_seeds: tuple[tuple[float, int], ...] = ()
    figure4_minutes: tuple[float, ...] = (5.0, 120.0)
    figure4_seeds: int = 10
    baseline_minutes: tuple[float, ...] = (5.0, 20.0)
    variant_minutes: tuple[float, ...] = (1.0, 2.0, 5.0, 10.0)
    ablation_minutes: tuple[float, ...] = (5.0, 20.0)
    other_body_minutes: tuple[float, ...] = (1.0, 5.0)
    ablation_seeds: int = 10
    tuning_minutes: tuple[float, ...] = (20.0,)
    tuning_pool_minutes: float = 0.0
    tuning_validation_minutes: float = 20.0
    motion: Literal["figures", "tuning", "claim", "decisive"] = "figures"
    figures: tuple[str, ...] = ()
    p_expert_system1: float = 0.75
    p_expert_system2: float = 0.5
    policy: str = "ornstein_uhlenbeck"
    network: Network = Network()
    training: StudyTraining = StudyTraining()
    tuned: tuple[tuple[str, str, Any], ...] = ()
    references: tuple[str, ...] = ("least_squares",)
    free_strut_minutes: tuple[float, ...] = (1.0, 5.0, 20.0, 60.0)
    free_strut_seeds: int = 5

    def __post_init__(self) -> None:
        """Refuse values that no study can have."""
        check_numbers(self)
        for system in ("system1", "system2"):
            most = max(self.novice_minutes(system), default=0)
            pool = self.pool_minutes(system)
            if most > pool:
                raise ConfigError(
                    f"novice_minutes_{system} asks for {most:g}, "
                    f"but pool_minutes_{system} is {pool:g}"
                )
        for name, value in vars(self).items():
            self._check_range(name, value)
        settings = vars(self.training).keys() - {"p_expert", "regularise"}
        for _, setting, _ in self.tuned:
            if setting not in settings:
                raise unknown_name(setting, settings, kind="tuned setting")
        if self.policy not in POLICIES:
            raise unknown_name(self.policy, POLICIES, kind="exploration policy")
        if self.rollouts < 1:
            raise ConfigError(f"rollouts must be at least 1, not {self.rollouts}")

    @staticmethod
    def _check_range(name: str, value: Any) -> None:
        """Refuse minutes, probabilities and numbers of seeds outside their range."""
        if "minutes" in name and name != "tuning_pool_minutes":
            values = value if isinstance(value, tuple) else (value,)
            if not all(minutes > 0 for minutes in values):
                raise ConfigError(f"{name} must be positive, not {value}")
        if name.startswith("p_expert") and not 0 <= value <= 1:
            raise ConfigError(f"{name} must be from 0 to 1, not {value}")
        if name.endswith("seeds"):
            numbers = [n for _, n in value] if name == "more_seeds" else [value]
            if not all(1 <= number <= MOST_SEEDS for number in numbers):
                raise ConfigError(f"{name} must be from 1 to {MOST_SEEDS}, not {value}")

    def _for_system(self, system: str, field: str) -> Any:
        """The value of `field` for a system.

        Robots with free struts have the value of the paper's system that they are
        derived from; systems of your own have that of system 1.
        """
        base = find_system(system).name.removesuffix(FREE_STRUTS)
        return getattr(self, f"{field}_{base}", getattr(self, f"{field}_system1"))

    def novice_minutes(self, system: str) -> tuple[float, ...]:
        """Novice dataset sizes of a system's plot in Figure 3, min."""
        return self._for_system(system, "novice_minutes")

    def pool_minutes(self, system: str) -> float:
        """Motion in a system's novice pool, min."""
        return self._for_system(system, "pool_minutes")

    def sizes_in_pool(self, system: str, sizes: Iterable[float]) -> tuple[float, ...]:
        """The `sizes`, min, that are not larger than a system's novice pool."""
        return tuple(size for size in sizes if size <= self.pool_minutes(system))

    def p_expert(self, system: str) -> float:
        """The paper's p_e for a system."""
        return self._for_system(system, "p_expert")

    def training_of(self, method: Method, system: str) -> StudyTraining:
        """A method's training on a system, with the settings that it was tuned to."""
        base = replace(self.training, p_expert=self.p_expert(system))
        return method.training(base, self.tuned_values(method.tuned_as))

    def pretraining_of(self, method: Method) -> StudyTraining | None:
        """A method's training on the expert alone; None for fresh initial weights."""
        return method.pretraining(self.training, self.tuned_values("pretraining"))

    def tuned_values(self, method: str) -> dict[str, Any]:
        """The settings that a method, or 'pretraining', was tuned to, by name."""
        return {setting: value for name, setting, value in self.tuned if name == method}

    def datasets(self, system: str) -> dict[str, Dataset]:
        """The datasets that all trials of a system share, see `trials.datasets`."""
        return datasets(self, system, self.pool_minutes(system))

    def with_motion(
        self, motion: str, pool_minutes: float, validation_minutes: float
    ) -> Preset:
        """This preset with other motion of the novice, and no sizes for Figure 3."""
        return self.replace(
            motion=motion,
            validation_minutes=validation_minutes,
            pool_minutes_system1=pool_minutes,
            pool_minutes_system2=pool_minutes,
            novice_minutes_system1=(),
            novice_minutes_system2=(),
        )

    def for_tuning(self) -> Preset:
        """This preset with the motion on which settings are chosen."""
        if not self.tuning_pool_minutes:
            return self
        tuning = self.with_motion(
            "tuning", self.tuning_pool_minutes, self.tuning_validation_minutes
        )
        return tuning.replace(tuning_pool_minutes=0.0)

    def all_datasets(self, system: str) -> list[Dataset]:
        """All datasets of a system's trials, each once, those for tuning included."""
        parts = (self.datasets(system), self.for_tuning().datasets(system))
        return list(dict.fromkeys(dataset for p in parts for dataset in p.values()))

    def seeds_at(self, minutes: float) -> int:
        """Trials per point at a size in minutes."""
        return dict(self.more_seeds).get(minutes, self.seeds)

    def replace(self, **changes: Any) -> Preset:
        """This preset with some values changed.

        The changes are values of the preset, of its network or of its training, each by
        its field's name; `p_expert` and `regularise` are not among them, since each
        method sets them. A changed value of the training holds for every method, also
        for one that was tuned to another value.
        """
        hidden = ("name", "p_expert", "regularise", "network", "training")
        parts = [vars(part) for part in (self, self.network, self.training)]
        known = [name for part in parts for name in part if name not in hidden]
        for name in changes:
            if name not in known:
                raise unknown_name(name, known, "a preset")
        own, network, training = (
            {name: value for name, value in changes.items() if name in part}
            for part in parts
        )
        own["network"] = replace(self.network, **network)
        own["training"] = replace(self.training, **training)
        kept = tuple(row for row in self.tuned if row[1] not in changes)
        return replace(self, **{"tuned": kept} | own)


_PAPER_SIZES: dict[str, Any] = dict(
    expert_minutes=500_000 / 600,  # 500,000 control steps of 0.1 s, 13.9 h
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
    ("copies", "learning_rate", 1e-4),  # as for fine-tuning
    ("copies", "matching_iterations", 5),  # as for SIDM
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
            # the trials of "laptop" and more of them, on the same motion; the figures
            # stand in the order in which they are worth computing
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
    """The preset of a name, with some values changed.

    Args:
        name: a key of PRESETS, and after it changes as the command line's `--set` has
            them, such as 'laptop seeds=2 pixels=16'.
        **changes: values as `Preset.replace` takes them.

    Raises:
        ConfigError: no such preset, with the nearest name; no such value, or a value of
            the wrong type.
    """
    name, *parts = re.split(r"\s+(?=\w+=)", conform(name, str, "preset").strip())
    preset = PRESETS[conform(name, PresetName, "preset")]
    changes = parse_changes(parts) | changes
    return preset.replace(**changes) if changes else preset
