"""What can be run and shown, by the name that the option `--figure` takes.

- A grid (`grids.FIGURES`) has trials as its results.
- A study has records. Its module has `jobs`, `measure` and `records`.
- A measurement has one file. Its module has `make`.

Modules are imported when they are needed, because most import PyTorch.
"""

from __future__ import annotations

import functools
import importlib
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from companion.grids import FIGURES, FORMER, find_figure
from companion.numerics import versions
from companion.presets import Preset
from companion.study import Study
from companion.trials import Dataset, Trial, motion_of
from sidm.config import ConfigError, unknown_name
from sidm.pool import local_pool
from sidm.storage import Damaged, read_record
from sidm.systems import SYSTEMS


class RecordStudy(NamedTuple):
    """A study whose results are records."""

    name: str  # of its folder in `studies`
    pairs: tuple[str, ...] = tuple(SYSTEMS)  # pairs of robots that it is about

    @property
    def module(self) -> Any:
        """The study's module, which has `jobs`, `measure` and `records`.

        It has `motion` where a job needs other motion than that of its trial, and
        `robots` where not all robots are those of known systems.
        """
        return importlib.import_module(f"companion.studies.{self.name}.measure")

    def motion(self, job: Any) -> dict[Dataset, Sequence[int]]:
        """The motion that a job needs: indices of trajectories of each dataset."""
        if hasattr(self.module, "motion"):
            return self.module.motion(job)
        trial = job if isinstance(job, Trial) else getattr(job, "trial", None)
        return {**motion_of([trial] if trial else [])}


class Measurement(NamedTuple):
    """A measurement whose result is one file."""

    module_name: str
    file: str  # path below the results folder
    kind: str = ""  # key of numerics.NUMERICS; '': the file is never stale

    def make(self, study: Study, workers: int) -> None:
        """Measure, and write the file."""
        importlib.import_module(self.module_name).make(study, workers)

    def is_stale(self, results: str | Path) -> bool | None:
        """Whether other versions than today's made the file; None without a file."""
        path = Path(results) / self.file
        try:
            record = read_record(path)
        except FileNotFoundError:
            return None
        except Damaged as error:
            raise ConfigError(
                f"{path}: damaged ({error}); delete it and make it again"
            ) from None
        return bool(self.kind) and record.get("numerics") != versions(self.kind)


STUDIES = {
    "latent-space": RecordStudy("latent_space"),
    "adversary": RecordStudy("adversary"),
    "recorded-targets": RecordStudy("recorded_targets"),
    "driving": RecordStudy("driving"),
    "uncertainty": RecordStudy("uncertainty"),
    "several-experts": RecordStudy("several_experts"),
    "real-robots": RecordStudy(
        "real_robots", ("husky to warthog", "warthog to husky", "hunter to warthog")
    ),
}

MEASUREMENTS = {
    "gap": Measurement("companion.studies.gap", "gap.json", "free_struts"),
    "overlap": Measurement("companion.studies.overlap", "overlap.json", "simulation"),
    "untrained-latents": Measurement(
        "companion.studies.latent_space.untrained",
        "untrained_latents.json",
        "diagnosis",
    ),
    "payoff": Measurement("companion.studies.payoff", "payoff.json", "free_struts"),
    "tree-search": Measurement(
        "companion.studies.tree_search", "tree_search.json", "fitting"
    ),
    "throughput": Measurement("companion.studies.throughput", "pace.json"),
    "coverage": Measurement("companion.statistics.coverage", "coverage.json"),
    "explorer": Measurement(
        "companion.explorer.grid", "explorer/rides.json", "free_struts"
    ),
}

#: All names, in the order of the tables above.
NAMES = (*FIGURES, *STUDIES, *MEASUREMENTS)

#: Former names -> today's names.
_FORMER = FORMER | {"elsewhere": "recorded-targets", "experts": "several-experts"}


def is_grid(name: str) -> bool:
    """Whether a name is that of a grid of trials, or 'all' for all grids."""
    if name in _FORMER:
        raise ConfigError(f"figure '{name}' is called '{_FORMER[name]}' now")
    if name in (*STUDIES, *MEASUREMENTS):
        return False
    if name != "all" and find_figure(name) is None:
        raise unknown_name(name, (*NAMES, "all"), kind="figure")
    return True


def run(
    name: str,
    preset: Preset,
    pair: str | None,
    workers: int,
    data: str | Path,
    results: str | Path,
) -> list[str]:
    """Simulate and measure what is missing of a study or a measurement.

    Returns:
        What is still missing, a line for each job.
    """
    study = Study(preset, Path(data), Path(results))
    if name in MEASUREMENTS:
        if MEASUREMENTS[name].is_stale(results) is not False:
            MEASUREMENTS[name].make(study, workers)
        return []
    jobs = _jobs(STUDIES[name], study, pairs_of(name, pair))
    run_jobs(name, jobs, workers, data, results)
    return list(map(str, STUDIES[name].module.records(results).missing(jobs)))


def run_jobs(
    name: str,
    jobs: Iterable[Any],
    workers: int = 2,
    data: str | Path = "data",
    results: str | Path = "results",
    **options: Any,
) -> None:
    """Simulate the motion that missing jobs of a study need, and measure them."""
    from companion.engine.datasets import collect_motion

    entry = STUDIES[name]
    store = entry.module.records(results)
    missing = store.missing(list(dict.fromkeys(jobs)))
    needed: dict[Dataset, set[int]] = {}
    for job in missing:
        for dataset, which in entry.motion(job).items():
            needed.setdefault(dataset, set()).update(which)
    work = functools.partial(
        entry.module.measure, data=Path(data).absolute(), **options
    )
    with local_pool(workers) as pool:
        collect_motion(
            {dataset: sorted(which) for dataset, which in needed.items()},
            data,
            executor=pool,
            robots=getattr(entry.module, "robots", None),
        )
        store.run(missing, work, pool, name)


def pairs_of(name: str, pair: str | None) -> Sequence[str]:
    """The pairs of robots that a study is about, or the one that is asked for."""
    pairs = STUDIES[name].pairs
    if pair is not None and pair not in pairs:
        raise ConfigError(f"study '{name}' is about {', '.join(pairs)}, not {pair}")
    return pairs if pair is None else (pair,)


def _jobs(entry: RecordStudy, study: Study, pairs: Sequence[str]) -> list[Any]:
    """The jobs of a study for some pairs, each once, as several pairs may share one."""
    jobs = (job for pair in pairs for job in entry.module.jobs(study, pair))
    return list(dict.fromkeys(jobs))


def overview(
    name: str, preset: Preset, pair: str | None, data: str | Path, results: str | Path
) -> tuple[list[str], int]:
    """What is stored of a study or a measurement.

    Returns:
        Lines of text, a line for each pair or file, and the number of missing results.
    """
    if name in MEASUREMENTS:
        stale = MEASUREMENTS[name].is_stale(results)
        state = {None: "missing", True: "stored, stale", False: "stored"}[stale]
        path = Path(results) / MEASUREMENTS[name].file
        return [f"{path}: {state}"], int(stale is not False)
    entry = STUDIES[name]
    lines, missing, records = [], set(), entry.module.records(results)
    for pair_name in pairs_of(name, pair):
        jobs = _jobs(entry, Study(preset, data, results), [pair_name])
        stored = records.stored(jobs)
        stale = sum(record.provenance.stale for record in stored)
        lines.append(f"{pair_name}: stored {len(stored)} of {len(jobs)}  stale {stale}")
        missing |= set(records.missing(jobs))
    return lines, len(missing)
