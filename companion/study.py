"""A study: a preset's trials. Figures 3 and 4, what stands beside them, and the points of every other grid."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from companion.digests import find_digest
from companion.methods import (
    FIGURE3,
    METHODS,
)
from companion.presets import Preset, load_preset
from companion.training import StudyTraining
from companion.trials import Trial
from sidm.config import unknown_name
from sidm.systems import find_system


class Study:
    """Makes the trials of a preset, looking up the digests of its datasets once.

    Args:
        preset: a Preset or the name of one.
        data: the folder of the shards.
        results: the folder of the results.
    """

    def __init__(
        self,
        preset: Preset | str,
        data: str | Path = "data",
        results: str | Path = "results",
    ) -> None:
        """Look the preset up and keep the folders."""
        self.preset = load_preset(preset) if isinstance(preset, str) else preset
        self.data, self.results = Path(data), Path(results)
        self._digests: dict[str, dict[str, str]] = {}

    def of(self, preset: Preset) -> Study:
        """The same of another preset."""
        return Study(preset, self.data, self.results)

    def changed(self, **changes: Any) -> Study:
        """The same of the preset with some values changed."""
        return self.of(self.preset.replace(**changes))

    def digests(self, system: str) -> dict[str, str]:
        """The digests of a system's datasets as Trial names them, UNKNOWN where none is known."""
        if system not in self._digests:
            needed = self.preset.datasets(system)
            self._digests[system] = {
                f"{k}_data": find_digest(d, self.data, self.results)
                for k, d in needed.items()
            }
        return self._digests[system]

    def trial(
        self,
        system: str,
        method: str,
        minutes: float,
        seed: int = 0,
        training: StudyTraining | None = None,
    ) -> Trial:
        """One trial of the preset's sizes; `training` replaces the method's own.

        Raises:
            ConfigError: an unknown system or method, or more minutes than the pool
                holds.
        """
        find_system(system)
        if method not in METHODS:
            raise unknown_name(method, METHODS, "the methods")
        preset, one = self.preset, METHODS[method]
        return Trial(
            system=system,
            method=method,
            novice_minutes=minutes,
            seed=seed,
            pool_minutes=preset.pool_minutes(system),
            expert_minutes=preset.expert_minutes,
            validation_minutes=preset.validation_minutes,
            rollouts=preset.rollouts,
            policy=preset.policy,
            network=dataclasses.replace(preset.network, own=one.own),  # type: ignore
            training=training or preset.training_of(one, system),
            pretraining=preset.pretraining_of(one),
            pretrained=one.carried,
            residual=one.residual,
            fit=one.fit,
            motion=preset.motion,
            **self.digests(system),
        )

    def points(
        self,
        system: str,
        methods: Sequence[str],
        sizes: Iterable[float],
        training: StudyTraining | None = None,
        seeds: int | None = None,
    ) -> list[Trial]:
        """Trials of every size, seed (the preset's numbers unless given) and method, those of a seed side by side."""
        trials = []
        for minutes in sizes:
            firsts = [
                self.trial(system, method, minutes, 0, training) for method in methods
            ]
            count = seeds or self.preset.seeds_at(minutes)
            trials += [
                first.replace(seed=seed) for seed in range(count) for first in firsts
            ]
        return trials

    def figure3(self, system: str) -> list[Trial]:
        """Figure 3: the paper's two methods and fine-tuning at every novice dataset size."""
        return self.points(system, FIGURE3, self.preset.novice_minutes(system))

    def references(self, system: str) -> list[Trial]:
        """What stands beside Figure 3: the preset's at every size, and the expert's model, which has no size."""
        return [
            *self.points(
                system, self.preset.references, self.preset.novice_minutes(system)
            ),
            *self.points(system, ["expert_only"], self.preset.baseline_minutes[:1]),
        ]

    def free_struts(self, system: str) -> list[Trial]:
        """Figure 3's methods and least squares on robots whose struts no motor brakes, as the paper describes them."""
        preset, methods = self.preset, (*FIGURE3, "least_squares")
        pool = self.of(
            preset.with_motion(
                "figures", max(preset.free_strut_minutes), preset.validation_minutes
            )
        )
        return pool.points(
            system, methods, preset.free_strut_minutes, seeds=preset.free_strut_seeds
        )

    def figure4(self, system: str = "system1") -> list[Trial]:
        """Figure 4: Figure 3's methods with little and with much novice data; the paper's is of system 1."""
        return self.points(
            system,
            FIGURE3,
            self.preset.figure4_minutes,
            seeds=self.preset.figure4_seeds,
        )
