"""The trials of a preset: Figures 3 and 4, and the points of every other grid."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from companion.methods import FIGURE3, METHODS
from companion.presets import Preset, load_preset
from companion.training import StudyTraining
from companion.trials import Trial
from sidm.config import replace, unknown_name
from sidm.systems import find_system


class Study:
    """Makes the trials of a preset, which may be given by its name."""

    def __init__(self, preset: Preset | str) -> None:
        self.preset = load_preset(preset) if isinstance(preset, str) else preset

    def changed(self, **changes: Any) -> Study:
        """A study of this preset with some values changed, see `Preset.replace`."""
        return Study(self.preset.replace(**changes))

    def trial(
        self,
        system: str,
        method: str,
        minutes: float,
        seed: int = 0,
        training: StudyTraining | None = None,
    ) -> Trial:
        """One trial with the sizes of the preset, and `minutes` of novice data.

        `method` is a name of `methods.METHODS`, which gives the `training` unless it is
        given here. ConfigError names what is not known, or too many minutes.
        """
        find_system(system)
        if method not in METHODS:
            raise unknown_name(method, METHODS, kind="method")
        preset, config = self.preset, METHODS[method]
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
            network=replace(preset.network, own=config.own),
            training=training or preset.training_of(config, system),
            pretraining=preset.pretraining_of(config),
            pretrained=config.carried,
            residual=config.residual,
            fit=config.fit,  # type: ignore[arg-type]
            motion=preset.motion,
        )

    def points(
        self,
        system: str,
        methods: Sequence[str],
        sizes: Iterable[float],
        training: StudyTraining | None = None,
        seeds: int | None = None,
    ) -> list[Trial]:
        """Trials of every size, seed and method; those of one seed follow each other.

        `sizes` are minutes of novice data. The preset says how many `seeds` a size has
        unless it is given, and the method what its `training` is.
        """
        trials = []
        for minutes in sizes:
            first = [self.trial(system, name, minutes, 0, training) for name in methods]
            for seed in range(seeds or self.preset.seeds_at(minutes)):
                trials += [trial.replace(seed=seed) for trial in first]
        return trials

    def figure3(self, system: str) -> list[Trial]:
        """Figure 3: the paper's methods and fine-tuning at all novice dataset sizes."""
        return self.points(system, FIGURE3, self.preset.novice_minutes(system))

    def figure4(self, system: str = "system1") -> list[Trial]:
        """Figure 4: Figure 3's methods with little and with much novice data.

        The paper's figure is of system 1.
        """
        preset = self.preset
        sizes, seeds = preset.figure4_minutes, preset.figure4_seeds
        return self.points(system, FIGURE3, sizes, seeds=seeds)

    def references(self, system: str) -> list[Trial]:
        """Methods that are shown beside Figure 3.

        The preset's `references` have every novice dataset size. The expert's model
        learns from no novice data, so it has one size only.
        """
        preset = self.preset
        sizes, first_size = preset.novice_minutes(system), preset.baseline_minutes[:1]
        trials = self.points(system, preset.references, sizes)
        return trials + self.points(system, ["expert_only"], first_size)

    def free_struts(self, system: str) -> list[Trial]:
        """Figure 3's methods and least squares on robots with free struts.

        No motor brakes these struts, as the paper describes them.
        """
        preset, methods = self.preset, (*FIGURE3, "least_squares")
        sizes, seeds = preset.free_strut_minutes, preset.free_strut_seeds
        motion = preset.with_motion("figures", max(sizes), preset.validation_minutes)
        return Study(motion).points(system, methods, sizes, seeds=seeds)
