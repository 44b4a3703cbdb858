"""What `companion run` and `companion show` know, by the name that `--figure` takes.

- A grid has trials as its results; its module has `trials`.
- A study whose results are not trials has records.
- A measurement has one file. Its module has `make`, which returns what the file stores;
  that of the explorer writes its arrays itself.

Modules are imported when they are needed, because most import PyTorch.
"""

from __future__ import annotations

import functools
import importlib
import importlib.util
import pkgutil
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from companion.numerics import versions
from sidm.config import ConfigError, unknown_name
from sidm.pool import local_pool
from sidm.systems import FAMILY_PAIRS, FREE_SYSTEMS, PAPER_SYSTEMS, SYSTEMS, find_system

if TYPE_CHECKING:
    from companion.presets import Preset
    from companion.study import Study
    from companion.trials import Dataset, Trial


class Figure(NamedTuple):
    """A grid of trials: the function that makes them, and its pairs of robots."""

    function: str  # of a study and a pair; its name inside the package
    pairs: tuple[str, ...] = tuple(SYSTEMS)
    opt_in: bool = False  # of the figure 'all' only in presets whose `figures` name it

    def trials(self, study: Study, pair: str) -> list[Trial]:
        """The trials of one pair of robots."""
        return pkgutil.resolve_name(f"companion.{self.function}")(study, pair)


class RecordStudy(NamedTuple):
    """A study whose results are records."""

    name: str  # that of its folder in `studies`, with hyphens
    pairs: tuple[str, ...] = tuple(SYSTEMS)  # pairs of robots that it is about

    @property
    def module(self) -> Any:
        """The study's module, which has `jobs`, `measure` and `records`.

        It has `motion` where a job needs other motion than that of its trial, and
        `robots` where not all robots are those of known systems.
        """
        folder = self.name.replace("-", "_")
        return importlib.import_module(f"companion.studies.{folder}.measure")

    def jobs(self, study: Study, pair: str | None) -> dict[str, list[Any]]:
        """The jobs by pair of robots; of all pairs for None."""
        if pair is not None and pair not in self.pairs:
            pairs = ", ".join(self.pairs)
            raise ConfigError(f"study '{self.name}' is about {pairs}, not {pair}")
        asked = self.pairs if pair is None else (pair,)
        return {one: list(self.module.jobs(study, one)) for one in asked}

    def run(
        self, study: Study, pair: str | None, workers: int, data: Path, results: Path
    ) -> int:
        """Measure what is missing; how many jobs are missing then."""
        jobs = sum(self.jobs(study, pair).values(), [])
        run_jobs(self.name, jobs, workers, data, results)
        # several pairs may share a job
        return len(self.module.records(results).missing(dict.fromkeys(jobs)))

    def overview(
        self, study: Study, pair: str | None, results: Path
    ) -> tuple[list[str], int]:
        """A line for each pair of robots, and the number of missing results."""
        lines, missing, records = [], set(), self.module.records(results)
        for name, listed in self.jobs(study, pair).items():
            jobs = list(dict.fromkeys(listed))
            stored = records.stored(jobs)
            stale = sum(record.provenance.stale for record in stored)
            lines.append(f"{name}: stored {len(stored)} of {len(jobs)}  stale {stale}")
            missing |= set(records.missing(jobs))
        return lines, len(missing)


class Measurement(NamedTuple):
    """A measurement whose result is one file; it is about no single pair of robots."""

    module: str
    file: str  # path below the results folder
    kind: str = ""  # key of numerics.RESULT_VERSIONS; '': the file is never stale

    def run(
        self, study: Study, pair: str | None, workers: int, data: Path, results: Path
    ) -> int:
        """Measure, and write the file, where it lacks or is stale."""
        from sidm.storage import write_record

        if self.state(results, study) != "stored":
            module = importlib.import_module(f"companion.{self.module}")
            record = module.make(study, workers, data, results)
            made = {"numerics": versions(self.kind)} if self.kind else {}
            write_record(results / self.file, record | made)
        return 0

    def overview(
        self, study: Study, pair: str | None, results: Path
    ) -> tuple[list[str], int]:
        """A line on the file, and how many files are missing."""
        state = self.state(results, study)
        return [f"{results / self.file}: {state}"], int(state != "stored")

    def state(self, results: Path, study: Study) -> str:
        """'missing', 'stored', or 'stored, ...' if it must be made again.

        Other versions of the numbers made the file, or it names another preset.
        """
        from sidm.storage import Damaged, read_record

        path = results / self.file
        try:
            record = read_record(path)
        except FileNotFoundError:
            return "missing"
        except Damaged as error:
            raise ConfigError(
                f"{path}: damaged ({error}); delete it and make it again"
            ) from None
        made, asked = record.get("preset"), study.preset.name
        if made not in (None, asked):
            return f"stored, of preset {made}, not {asked}"
        stale = self.kind and record.get("numerics") != versions(self.kind)
        return "stored, stale" if stale else "stored"


#: The grids by name.
FIGURES = {
    "decisive": Figure(
        "studies.decisive.design.trials", (*PAPER_SYSTEMS, *FREE_SYSTEMS), True
    ),
    "duration": Figure("studies.duration.trials", ("system1",), True),
    "3": Figure("study.Study.figure3"),
    "references": Figure("study.Study.references"),
    "4": Figure("study.Study.figure4", ("system1",)),
    "tuning": Figure("studies.tuning.trials"),
    "little-data": Figure("studies.tuning.little_data", opt_in=True),
    "choices": Figure("studies.choices.trials"),
    "released": Figure("studies.choices.released"),
    "baselines": Figure("studies.baselines.trials"),
    "variants": Figure("studies.variants.trials"),
    "p-expert": Figure("studies.ablations.p_expert"),
    "iterations": Figure("studies.ablations.phases"),
    "pixels": Figure("studies.ablations.pixels"),
    "patience": Figure("studies.ablations.patience"),
    "other-bodies": Figure("studies.other_bodies.trials", ("system1",)),
    "free-struts": Figure("study.Study.free_struts", tuple(FREE_SYSTEMS), True),
    "network-size": Figure("studies.network_size.trials", ("system1",), True),
    "corrected-claim": Figure(
        "studies.corrected_claim.trials", (*FREE_SYSTEMS, *FAMILY_PAIRS), True
    ),
    "most-data": Figure("studies.ablations.most_data_trials"),
}

_REAL_PAIRS = "husky to warthog", "warthog to husky", "hunter to warthog"
STUDIES = {
    study.name: study
    for study in (
        RecordStudy("latent-space"),
        RecordStudy("adversary"),
        RecordStudy("recorded-targets"),
        RecordStudy("driving"),
        RecordStudy("uncertainty"),
        RecordStudy("several-experts"),
        RecordStudy("real-robots", _REAL_PAIRS),
    )
}

MEASUREMENTS = {
    "gap": Measurement("studies.simulated_gap", "gap.json", "free_struts"),
    "overlap": Measurement("studies.nearest_neighbours", "overlap.json", "simulation"),
    "untrained-latents": Measurement(
        "studies.latent_space.untrained", "untrained_latents.json", "diagnosis"
    ),
    "payoff": Measurement("studies.when_it_pays", "payoff.json", "free_struts"),
    "tree-search": Measurement("studies.tree_search", "tree_search.json", "fitting"),
    "throughput": Measurement("studies.throughput", "pace.json"),
    "coverage": Measurement("statistics.coverage", "coverage.json"),
    "explorer": Measurement("explorer.grid", "explorer/rides.json", "free_struts"),
}

#: All names, in the order of the tables above.
NAMES = (*FIGURES, *STUDIES, *MEASUREMENTS)


def find(name: str) -> RecordStudy | Measurement | None:
    """The study or measurement of a name; None for a grid of trials, or 'all'."""
    entry = STUDIES.get(name) or MEASUREMENTS.get(name)
    if entry is None and name != "all" and find_figure(name) is None:
        raise unknown_name(name, (*NAMES, "all"), kind="figure")
    return entry


def find_figure(name: str) -> Figure | None:
    """The grid of a name: of FIGURES, or of a module of `studies` with `trials`.

    The module of a grid 'my-study' is `studies/my_study.py`; it is about all pairs.
    """
    if name in FIGURES:
        return FIGURES[name]
    module = f"companion.studies.{name.replace('-', '_')}"
    plain = name.replace("-", "").isalnum()
    if not plain or importlib.util.find_spec(module) is None:
        return None
    has_trials = hasattr(importlib.import_module(module), "trials")
    return Figure(f"studies.{name.replace('-', '_')}.trials") if has_trials else None


def grid(
    preset: Preset | str,
    figure: str = "3",
    system: str | None = None,
    minutes: Sequence[float] | None = None,
    seeds: Sequence[int] | None = None,
    methods: Sequence[str] | None = None,
    steps: Sequence[str] | None = None,
) -> list[Trial]:
    """The trials of a figure, each once.

    `figure` is a name that `find_figure` knows, or 'all' for all figures of the preset.
    `system`, `minutes` (novice dataset sizes), `seeds` and `methods` choose among its
    trials, as `steps` does among those of the figure 'decisive'.

    Raises:
        ConfigError: a name does not exist, or the figure does not have a system, a
            size, a seed, a method or steps.
    """
    from companion.study import Study

    if figure != "all" and find_figure(figure) is None:
        raise unknown_name(figure, (*FIGURES, "all"), kind="figure")
    if system is not None:
        find_system(system)
    study = Study(preset)
    names: Sequence[str] = (figure,)
    if figure == "all":
        usual = [name for name, one in FIGURES.items() if not one.opt_in]
        names = study.preset.figures or usual
    found = [one for one in map(find_figure, names) if one is not None]
    by_key: dict[str, Trial] = {}
    for one in found:
        for pair in one.pairs:
            if system in (None, pair):
                by_key |= {trial.key: trial for trial in one.trials(study, pair)}
    trials = list(by_key.values())
    if figure == "decisive":  # its steps go across systems
        in_order = pkgutil.resolve_name("companion.studies.decisive.design.in_order")
        trials = in_order(trials, study, steps)
    elif steps is not None:
        raise ConfigError(f"the figure decisive alone has steps, not {figure}")
    if not trials:
        known = dict.fromkeys(pair for one in found for pair in one.pairs)
        raise ConfigError(
            f"figure {figure} has no trials of {system}, only of {', '.join(known)}"
        )
    trials = _with_values(trials, "minutes", "novice_minutes", minutes)
    trials = _with_values(trials, "seeds", "seed", seeds)
    return _with_values(trials, "methods", "method", methods)


def _with_values(
    trials: list[Trial], name: str, field: str, values: Sequence[Any] | None
) -> list[Trial]:
    """The trials whose `field` has one of the `values`; all trials for None."""
    if values is None:
        return trials
    known = sorted({getattr(trial, field) for trial in trials})
    for value in values:
        if value not in known:
            value, *listed = (
                one if isinstance(one, str) else f"{one:g}" for one in (value, *known)
            )
            raise ConfigError(
                f"{name} {value} is not in this grid; it has {', '.join(listed)}"
            )
    return [trial for trial in trials if getattr(trial, field) in values]


def run_jobs(
    name: str,
    jobs: Iterable[Any],
    workers: int = 2,
    data: str | Path = "data",
    results: str | Path = "results",
    **options: Any,
) -> None:
    """Simulate the motion that missing jobs of a study need, and measure them.

    `options` are further arguments of the study's `measure`.
    """
    from companion.engine.datasets import collect_motion
    from companion.trials import Trial, motion_of

    module = STUDIES[name].module
    store = module.records(results)
    missing = store.missing(dict.fromkeys(jobs))
    needed: dict[Dataset, set[int]] = {}
    for job in missing:
        if hasattr(module, "motion"):
            motion = module.motion(job)
        else:
            trial = job if isinstance(job, Trial) else getattr(job, "trial", None)
            motion = motion_of([trial] if trial else [])
        for dataset, which in motion.items():
            needed.setdefault(dataset, set()).update(which)
    work = functools.partial(module.measure, data=Path(data).absolute(), **options)
    with local_pool(workers) as pool:
        collect_motion(
            {dataset: sorted(which) for dataset, which in needed.items()},
            data,
            executor=pool,
            robots=getattr(module, "robots", None),
        )
        store.run(missing, work, pool, name)
