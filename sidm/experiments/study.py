"""A study: a preset's trials. Figures 3 and 4, the tuning of the methods, their neighbours, what choices are worth."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from sidm.config import unknown_name
from sidm.experiments.digests import find_digest
from sidm.experiments.methods import (
    ALL_RELEASED,
    BASELINES,
    CHOICES,
    COMPARED,
    FIGURE3,
    METHODS,
    MIRRORED,
    RELEASED,
    VARIANTS,
    change,
)
from sidm.experiments.presets import Preset, load_preset
from sidm.experiments.trials import Trial
from sidm.experiments.tries import TRIES, TUNING_SEED, tried
from sidm.learning.settings import Training
from sidm.systems import find_system

#: How long is enough: trained until so many samples bring no lower test loss.
LONG: dict[str, Any] = {"patience": 2_500_000, "max_samples": 6_000_000}
DURATION_MINUTES, DURATION_SEEDS = (5.0,), 3
MANY_EXPERTS = 0.9  # p_e

#: Batches and rate of the authors' code, with a test as often in samples as ours.
RELEASED_PACE = dict(
    batch=2, discriminator_batch=2, matching_batch=2, learning_rate=1e-4, test_interval=100
)  # fmt: skip


class Study:
    """Makes the trials of a preset, looking up the digests of its datasets once.

    Args:
        preset: a Preset or the name of one.
        data: the folder of the shards.
        results: the folder of the results.
    """

    def __init__(self, preset: Preset | str, data: str | Path = "data", results: str | Path = "results") -> None:
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
            self._digests[system] = {f"{k}_data": find_digest(d, self.data, self.results) for k, d in needed.items()}
        return self._digests[system]

    def trial(self, system: str, method: str, minutes: float, seed: int = 0, training: Training | None = None) -> Trial:
        """One trial of the preset's sizes; `training` replaces the method's own.

        Raises:
            ConfigError: an unknown system or method, or more minutes than the pool holds.
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
            training=training or one.training(preset, system),
            pretraining=one.pretraining(preset),
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
        training: Training | None = None,
        seeds: int | None = None,
    ) -> list[Trial]:
        """Trials of every size, seed (the preset's numbers unless given) and method, those of a seed side by side."""
        trials = []
        for minutes in sizes:
            firsts = [self.trial(system, method, minutes, 0, training) for method in methods]
            count = seeds or self.preset.seeds_at(minutes)
            trials += [first.replace(seed=seed) for seed in range(count) for first in firsts]
        return trials

    def figure3(self, system: str) -> list[Trial]:
        """Figure 3: the paper's two methods and fine-tuning at every novice dataset size."""
        return self.points(system, FIGURE3, self.preset.novice_minutes(system))

    def yardsticks(self, system: str) -> list[Trial]:
        """What stands beside Figure 3: no network at all, at every size, and the expert's model, which has no size."""
        return [
            *self.points(system, ["least_squares"], self.preset.novice_minutes(system)),
            *self.points(system, ["expert_only"], self.preset.baseline_minutes[:1]),
        ]

    def figure4(self, system: str = "system1") -> list[Trial]:
        """Figure 4: Figure 3's methods with little and with much novice data; the paper's is of system 1."""
        return self.points(system, FIGURE3, self.preset.figure4_minutes, seeds=self.preset.figure4_seeds)

    def tuning(self, system: str) -> list[Trial]:
        """Every try of every method at each of the tuning's sizes, with a seed that no figure has."""
        base = self.preset.for_tuning()
        every = [(method, words) for method, tries in TRIES.items() for words in tries]
        return [
            self.of(tried(base, method, words)).trial(system, method, minutes, TUNING_SEED)
            for minutes in base.tuning_minutes
            for method, words in every
        ]

    def duration(self, system: str) -> list[Trial]:
        """How long to train: far past the preset's patience, on a small dataset that settings are chosen by.

        With SIDM also at a p_e of MANY_EXPERTS; and, of system 1, the paper's methods as the authors train them.
        """
        study = self.of(self.preset.for_tuning().replace(**LONG))
        more = change(METHODS["sidm"].training(study.preset, system), p_expert=MANY_EXPERTS)
        trials = []
        for seed in range(DURATION_SEEDS):
            firsts = study.points(system, COMPARED, DURATION_MINUTES, seeds=1)
            firsts += study.points(system, ["sidm"], DURATION_MINUTES, more, seeds=1)
            trials += [first.replace(seed=seed) for first in firsts]
        if system == "system1":
            changes = RELEASED[ALL_RELEASED][0] | RELEASED_PACE
            trials += study.changed(tuned=(), **changes).points(system, COMPARED, DURATION_MINUTES, seeds=1)
        return trials

    def baselines(self, system: str) -> list[Trial]:
        """Figure 3's methods and their neighbours on a small and a middle dataset; the expert alone has no size."""
        sizes = self.preset.baseline_minutes
        named = [one for one in (*FIGURE3, *BASELINES) if one != "expert_only"]
        largest = max(self.preset.novice_minutes(system))  # 'all_data'
        return [
            *self.points(system, named, sizes),
            *self.points(system, ["expert_only"], sizes[:1]),
            *self.points(system, ["novice_only"], [largest]),
        ]

    def variants(self, system: str) -> list[Trial]:
        """What might do better, on small datasets, beside the methods that it is to beat; those on Figure 3's too."""
        beaten = ("sidm", "pretrain_finetune")
        trials = self.points(system, (*beaten, *VARIANTS, "least_squares", *MIRRORED), self.preset.variant_minutes)
        trials += self.points(system, beaten, self.preset.novice_minutes(system))
        return list({trial.key: trial for trial in trials}.values())

    def correction(self, system: str) -> list[Trial]:
        """Least squares on the expert's model, and what it is made of, beside what it is to beat; of the variants."""
        parts = ("mirrored", "corrected", "corrected_mirrored", "corrected_averaged")
        kept = ("sidm", "pretrain_finetune", "least_squares", "least_squares_mirrored", *parts)
        return [trial for trial in self.variants(system) if trial.method in kept]

    def released(self, system: str, together: Iterable[str] = tuple(RELEASED)) -> list[Trial]:
        """Figure 3 with choices of the released code, `together` as RELEASED names them."""
        trials = []
        for words in together:
            changes, methods = RELEASED[words]
            trials += self.changed(**changes).points(system, methods, self.preset.novice_minutes(system))
        return trials

    def choices(self, system: str) -> list[Trial]:
        """Figure 3's methods on a small dataset with one of our choices changed at a time."""
        sizes = self.preset.ablation_minutes[:1]
        return [
            trial
            for changes, methods in CHOICES.values()
            for trial in self.changed(**changes).points(system, methods, sizes)
        ]
