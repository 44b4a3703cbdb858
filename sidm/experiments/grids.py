"""The grids of trials: Figure 3, Figure 4, the ablations of the paper's advice, and the tuning of the methods."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from sidm.config import ConfigError, unknown_name
from sidm.experiments.datasets import find_digest
from sidm.experiments.methods import CHOICES, COMPARED, FIGURE3, METHODS, PRETRAINED, change
from sidm.experiments.presets import Preset, load_preset
from sidm.experiments.trials import Trial
from sidm.experiments.tuning import TRIES, TUNING_SEED, tried
from sidm.learning.settings import Training
from sidm.systems import SYSTEMS, find_system
from sidm.trajectory import trajectories_for

#: Values of p_e in its ablation; None stands for 'proportional to the data'.
P_EXPERT = (0.0, 0.25, 0.5, 0.75, 0.9, None)

#: Iterations a phase in their ablations, by the name of the phase.
ITERATIONS = {
    "prediction_iterations": (20, 100, 500),
    "discriminator_iterations": (5, 20, 100),
    "matching_iterations": (0, 5, 20, 100),
}


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
        preset = self.preset
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
            network=preset.network,
            training=training or METHODS[method](preset, system),
            pretraining=PRETRAINED[method](preset) if method in PRETRAINED else None,
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
        """Trials of every size, seed (the preset's number unless given) and method, those of a seed side by side."""
        return [
            self.trial(system, method, minutes, seed, training)
            for minutes in sizes
            for seed in range(seeds or self.preset.seeds)
            for method in methods
        ]

    def figure3(self, system: str) -> list[Trial]:
        """Figure 3: the paper's two methods and fine-tuning at every novice dataset size."""
        return self.points(system, FIGURE3, self.preset.novice_minutes(system))

    def figure4(self, system: str = "system1") -> list[Trial]:
        """Figure 4: the paper's methods with little and with much novice data; the paper's is of system 1."""
        return self.points(system, COMPARED, self.preset.figure4_minutes, seeds=self.preset.figure4_seeds)

    def p_expert(self, system: str) -> list[Trial]:
        """Ablation of p_e, all else as for SIDM; at 0 the expert is never seen, in the regularisation neither."""
        trials = []
        for value in P_EXPERT:
            for minutes in self.preset.ablation_minutes:
                p = self.proportional(minutes) if value is None else value
                training = change(METHODS["sidm"](self.preset, system), p_expert=p, regularise=p > 0)
                trials += self.points(system, ["sidm" if p > 0 else "novice_only"], [minutes], training)
        return trials

    def iterations(self, system: str, phase: str | None = None) -> list[Trial]:
        """Ablation of the iterations of one phase, or of each in turn; 0 of matching leave out the regularisation."""
        trials: dict[str, Trial] = {}
        for name in [phase] if phase else ITERATIONS:
            for value in ITERATIONS[name]:
                method = "sidm" if value > 0 else "no_regularisation"
                training = METHODS[method](self.preset, system)
                if value > 0:
                    training = change(training, **{name: value})
                for trial in self.points(system, [method], self.preset.ablation_minutes, training):
                    trials.setdefault(trial.key, trial)
        return list(trials.values())

    def tuning(self, system: str) -> list[Trial]:
        """Every try of every method at one middle size, with a seed that no figure has."""
        trials = []
        for method, tries in TRIES.items():
            for words in tries:
                study = self.of(tried(self.preset, method, words))
                trials.append(study.trial(system, method, self.preset.tuning_minutes, TUNING_SEED))
        return trials

    def choices(self, system: str) -> list[Trial]:
        """Figure 3's methods on a small dataset with one of our choices changed at a time."""
        sizes = self.preset.ablation_minutes[:1]
        return [
            trial
            for changes, methods in CHOICES.values()
            for trial in self.changed(**changes).points(system, methods, sizes)
        ]

    def proportional(self, minutes: float) -> float:
        """The p_e that is proportional to the sizes of the data, which the paper advises against."""
        expert, novice = trajectories_for(self.preset.expert_minutes), trajectories_for(minutes)
        return round(expert / (expert + novice), 6)


#: Figure -> the method of Study that makes its trials of one system, and the systems that it has.
FIGURES: dict[str, tuple[str, tuple[str, ...]]] = {
    "3": ("figure3", tuple(SYSTEMS)),
    "4": ("figure4", ("system1",)),
    "p-expert": ("p_expert", tuple(SYSTEMS)),
    "iterations": ("iterations", tuple(SYSTEMS)),
    "tuning": ("tuning", tuple(SYSTEMS)),
    "choices": ("choices", tuple(SYSTEMS)),
}


def grid(
    preset: Preset | str,
    figure: str = "3",
    system: str | None = None,
    minutes: Sequence[float] | None = None,
    seeds: Sequence[int] | None = None,
    data: str | Path = "data",
    results: str | Path = "results",
) -> list[Trial]:
    """The trials behind a figure, each once.

    Args:
        preset: a Preset or the name of one.
        figure: '3', '4', 'p-expert', 'iterations', 'tuning', 'choices', or 'all' of them.
        system: only this system's.
        minutes: only these novice dataset sizes.
        seeds: only these seeds.
        data: where the shards lie, whose digests make part of a trial.
        results: where the digests of the stored study lie.

    Raises:
        ConfigError: a name that does not exist, or sizes or seeds that the figure does not have.
    """
    if figure not in (*FIGURES, "all"):
        raise unknown_name(figure, (*FIGURES, "all"), "the figures")
    if system is not None:
        find_system(system)
    study = Study(preset, data, results)
    found: dict[str, Trial] = {}
    for name, (maker, systems) in FIGURES.items():
        for one in systems:
            if figure in (name, "all") and system in (None, one):
                found |= {trial.key: trial for trial in getattr(study, maker)(one)}
    trials = list(found.values())
    if not trials:
        raise ConfigError(f"figure {figure} has no trials of {system}")
    for name, wanted, of in (("minutes", minutes, "novice_minutes"), ("seeds", seeds, "seed")):
        if wanted is not None:
            known = sorted({getattr(trial, of) for trial in trials})
            strange = [value for value in wanted if value not in known]
            if strange:
                raise ConfigError(f"{name} {strange[0]:g} is not in this grid; it has {_listed(known)}")
            trials = [trial for trial in trials if getattr(trial, of) in wanted]
    return trials


def _listed(values: Iterable[float]) -> str:
    return ", ".join(f"{value:g}" for value in values)
