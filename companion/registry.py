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

    def jobs(self, study: Study, pair: str | None) -> dict[str, list[Any]]:
        """The jobs by pair of robots; of all pairs for None."""
        if pair is not None and pair not in self.pairs:
            name, pairs = self.name.replace("_", "-"), ", ".join(self.pairs)
            raise ConfigError(f"study '{name}' is about {pairs}, not {pair}")
        asked = self.pairs if pair is None else (pair,)
        return {one: list(self.module.jobs(study, one)) for one in asked}

    def run(self, study: Study, pair: str | None, workers: int) -> list[str]:
        """Measure what is missing; what is missing then, a line for each job."""
        # several pairs may share a job
        jobs = list(dict.fromkeys(sum(self.jobs(study, pair).values(), [])))
        self.run_jobs(jobs, workers, study.data, study.results)
        return list(map(str, self.module.records(study.results).missing(jobs)))

    def run_jobs(
        self, jobs: Iterable[Any], workers: int, data: str | Path, results: str | Path
    ) -> None:
        """Simulate the motion that missing jobs need, and measure them."""
        from companion.engine.datasets import collect_motion

        store = self.module.records(results)
        missing = store.missing(list(dict.fromkeys(jobs)))
        needed: dict[Dataset, set[int]] = {}
        for job in missing:
            for dataset, which in self.motion(job).items():
                needed.setdefault(dataset, set()).update(which)
        motion = {dataset: sorted(which) for dataset, which in needed.items()}
        folder, robots = Path(data).absolute(), getattr(self.module, "robots", None)
        work = functools.partial(self.module.measure, data=folder)
        with local_pool(workers) as pool:
            collect_motion(motion, data, executor=pool, robots=robots)
            store.run(missing, work, pool, self.name.replace("_", "-"))

    def overview(self, study: Study, pair: str | None) -> tuple[list[str], int]:
        """A line for each pair of robots, and the number of missing results."""
        lines, missing, records = [], set(), self.module.records(study.results)
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
    kind: str = ""  # key of numerics.NUMERICS; '': the file is never stale

    def run(self, study: Study, pair: str | None, workers: int) -> list[str]:
        """Measure, and write the file, where it lacks or is stale."""
        if self.is_stale(study.results) is not False:
            importlib.import_module(self.module).make(study, workers)
        return []

    def overview(self, study: Study, pair: str | None) -> tuple[list[str], int]:
        """A line on the file, and how many files are missing."""
        stale = self.is_stale(study.results)
        state = {None: "missing", True: "stored, stale", False: "stored"}[stale]
        return [f"{study.results / self.file}: {state}"], int(stale is not False)

    def is_stale(self, results: Path) -> bool | None:
        """Whether other versions than today's made the file; None without a file."""
        path = results / self.file
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


def find(name: str) -> RecordStudy | Measurement:
    """The study or measurement of a name."""
    return STUDIES[name] if name in STUDIES else MEASUREMENTS[name]


def run_jobs(
    name: str,
    jobs: Iterable[Any],
    workers: int = 2,
    data: str | Path = "data",
    results: str | Path = "results",
) -> None:
    """Run jobs of a study of STUDIES, see `RecordStudy.run_jobs`."""
    STUDIES[name].run_jobs(jobs, workers, data, results)
