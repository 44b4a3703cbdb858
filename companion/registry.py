"""All that can be run and shown, by the name that `--figure` takes: grids of trials, studies of records, measurements.

A grid's results are trials (`grids.FIGURES`). A study's are records: its module has
`jobs`, `measure` and `records`. A measurement is one file: its module has `make`.
Modules are imported when they are asked for, since most bring PyTorch.
"""

from __future__ import annotations

import functools
import importlib
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Any, NamedTuple

from companion.grids import FIGURES, FORMER
from companion.numerics import versions
from companion.presets import Preset
from companion.study import Study
from sidm.config import ConfigError, unknown_name
from sidm.pool import local_pool
from sidm.storage import Damaged, read_record
from sidm.systems import SYSTEMS


class Recorded(NamedTuple):
    """A study whose results are records."""

    name: str  # of the module that makes it
    #: functions that simulate what its jobs need
    collects: tuple[str, ...] = ("collect_preset",)
    pairs: tuple[str, ...] = tuple(SYSTEMS)  # that it is about

    @property
    def module(self) -> Any:
        """With `jobs`, `measure` and `records`."""
        return importlib.import_module(self.name)

    @property
    def collect(self) -> list[Callable[[Study, str, Executor], None]]:
        """What simulates motion, each of a study, a pair and an executor."""
        return [
            collect_preset if name == "collect_preset" else getattr(self.module, name)
            for name in self.collects
        ]


class Measured(NamedTuple):
    """A measurement whose result is one file."""

    name: str  # of the module that makes it
    file: str  # below the results
    kind: str = ""  # of `numerics`; '' where no version makes it stale

    def make(self, study: Study, workers: int) -> None:
        """Measure, and write the file."""
        importlib.import_module(self.name).make(study, workers)

    def is_stale(self, results: str | Path) -> bool | None:
        """Whether today's code would come to another file; None without one.

        Raises:
            ConfigError: the file is damaged; one line.
        """
        path = Path(results) / self.file
        try:
            found = read_record(path)
        except FileNotFoundError:
            return None
        except Damaged as error:
            raise ConfigError(
                f"{path}: damaged ({error}); delete it and make it again"
            ) from None
        return bool(self.kind) and found.get("numerics") != versions(self.kind)


_MEASURE = "companion.studies.{}.measure".format

STUDIES = {
    "latent-space": Recorded(
        _MEASURE("latent_space"), ("collect_preset", "collect_held_out")
    ),
    "recorded-targets": Recorded(_MEASURE("recorded_targets"), ("collect_proxies",)),
    "driving": Recorded(_MEASURE("driving")),
    "uncertainty": Recorded(_MEASURE("uncertainty")),
    "several-experts": Recorded(
        _MEASURE("several_experts"), ("collect_preset", "collect_family")
    ),
    "real-robots": Recorded(
        _MEASURE("real_robots"),
        (),
        ("husky to warthog", "warthog to husky", "hunter to warthog"),
    ),
}

MEASUREMENTS = {
    "gap": Measured("companion.studies.gap", "gap.json", "free_struts"),
    "overlap": Measured("companion.studies.overlap", "overlap.json", "simulation"),
    "payoff": Measured("companion.studies.payoff", "payoff.json", "free_struts"),
    "throughput": Measured("companion.studies.throughput", "pace.json"),
    "coverage": Measured("companion.statistics.coverage", "coverage.json"),
    "explorer": Measured(
        "companion.explorer.grid", "explorer/rides.json", "free_struts"
    ),
}

#: Every name, in the order of the tables above.
NAMES = (*FIGURES, *STUDIES, *MEASUREMENTS)

#: What studies were called before.
_FORMER = FORMER | {"elsewhere": "recorded-targets", "experts": "several-experts"}


def is_of_trials(name: str) -> bool:
    """Whether a name is that of a grid of trials, or 'all' grids.

    Raises:
        ConfigError: no such name; it gives the nearest.
    """
    if name in _FORMER:
        raise ConfigError(f"figure '{name}' is called '{_FORMER[name]}' now")
    if name not in (*NAMES, "all"):
        raise unknown_name(name, (*NAMES, "all"), "the figures")
    return name in FIGURES or name == "all"


def collect_preset(study: Study, system: str, executor: Executor) -> None:
    """Simulate what is missing of a preset's own datasets."""
    from companion.engine.datasets import collect_datasets

    collect_datasets(study.preset, [system], study.data, executor=executor)


def run(
    name: str,
    preset: Preset,
    pair: str | None,
    workers: int,
    data: str | Path,
    results: str | Path,
) -> list[str]:
    """Simulate and make what a study or a measurement lacks.

    Args:
        name: of STUDIES or MEASUREMENTS.
        preset: how much of it.
        pair: of robots, of a study that is about several; all by default.
        workers: processes.
        data: folder of motion.
        results: folder of the results.

    Returns:
        What is still missing, a line each.

    Raises:
        ConfigError: a pair that the study is not about.
    """
    study = Study(preset, Path(data), Path(results))
    if name in MEASUREMENTS:
        if MEASUREMENTS[name].is_stale(results) is not False:
            MEASUREMENTS[name].make(study, workers)
        return []
    found, pairs = STUDIES[name], pairs_of(name, pair)
    with local_pool(workers) as pool:
        for one in pairs:
            for collect in found.collect:
                collect(study, one, pool)
        # by the digests that are known now
        study = Study(preset, Path(data), Path(results))
        # pairs share some
        jobs = list(
            dict.fromkeys(job for one in pairs for job in found.module.jobs(study, one))
        )
        work = functools.partial(found.module.measure, data=Path(data).absolute())
        records = found.module.records(results)
        records.run(jobs, work, pool, name)
    return [str(job) for job in jobs if records.get(job) is None]


def pairs_of(name: str, pair: str | None) -> Sequence[str]:
    """The pairs that a study is about, or the one asked for; ConfigError for another."""
    pairs = STUDIES[name].pairs
    if pair is not None and pair not in pairs:
        raise ConfigError(f"study '{name}' is about {', '.join(pairs)}, not {pair}")
    return pairs if pair is None else (pair,)


def overview(
    name: str, preset: Preset, pair: str | None, data: str | Path, results: str | Path
) -> tuple[list[str], int]:
    """Lines of what a study or a measurement has stored, stale included, and how many results are missing."""
    if name in MEASUREMENTS:
        stale = MEASUREMENTS[name].is_stale(results)
        words = {None: "missing", True: "stored, stale", False: "stored"}[stale]
        return [f"{Path(results) / MEASUREMENTS[name].file}: {words}"], int(
            stale is None
        )
    lines, missing, records = [], set(), STUDIES[name].module.records(results)
    for one in pairs_of(name, pair):
        jobs = list(
            dict.fromkeys(STUDIES[name].module.jobs(Study(preset, data, results), one))
        )
        stored = records.stored(jobs)
        stale = sum(record.provenance.stale for record in stored)
        lines.append(f"{one}: stored {len(stored)} of {len(jobs)}  stale {stale}")
        missing |= {job for job in jobs if records.get(job) is None}
    return lines, len(missing)
