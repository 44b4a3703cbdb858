"""The studies beyond the trials, by name: what they are of, what does their work, where their records are."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Any, NamedTuple

from companion.engine.datasets import collect_datasets
from companion.presets import Preset
from companion.studies.driving import measure as driving
from companion.studies.latent_space import measure as latent_space
from companion.studies.real_robots import measure as real_robots
from companion.studies.recorded_targets import measure as recorded_targets
from companion.studies.several_experts import measure as several_experts
from companion.studies.uncertainty import measure as uncertainty
from companion.study import Study
from sidm.config import ConfigError, unknown_name
from sidm.pool import local_pool
from sidm.systems import SYSTEMS


def collect_preset(study: Study, system: str, executor: Executor) -> None:
    """Simulate what is missing of a preset's own datasets."""
    collect_datasets(study.preset, [system], study.data, executor=executor)


class Beyond(NamedTuple):
    """A study whose results are records."""

    doors: Any  # the module with `jobs`, `measure` and `records`
    collect: tuple[Callable[[Study, str, Executor], None], ...] = (collect_preset,)  # simulate what the jobs need
    systems: tuple[str, ...] = tuple(SYSTEMS)  # or pairs, that it is about


STUDIES = {
    "latent-space": Beyond(latent_space, (collect_preset, latent_space.collect_held_out)),
    "recorded-targets": Beyond(recorded_targets, (recorded_targets.collect_proxies,)),
    "driving": Beyond(driving),
    "uncertainty": Beyond(uncertainty),
    "several-experts": Beyond(several_experts, (collect_preset, several_experts.collect_family)),
    "real-robots": Beyond(real_robots, (), tuple(real_robots.PAIRS)),
}

#: What studies were called before.
FORMER = {"elsewhere": "recorded-targets", "experts": "several-experts"}


def find_study(name: str) -> Beyond:
    """The study of that name; ConfigError naming the nearest otherwise."""
    if name in FORMER:
        raise ConfigError(f"study '{name}' is called '{FORMER[name]}' now")
    if name not in STUDIES:
        raise unknown_name(name, STUDIES, "the studies")
    return STUDIES[name]


def run_study(
    name: str, preset: Preset, systems: Sequence[str] | None, workers: int, data: str | Path, results: str | Path
) -> tuple[int, int]:
    """Simulate and make what a study lacks, of some systems or of all that it is about, on so many processes.

    Returns:
        How many results it has, and should have.

    Raises:
        ConfigError: no such study, or none of such a system.
    """
    found, data, results = find_study(name), Path(data), Path(results)
    systems = found.systems if systems is None else systems
    for system in systems:
        if system not in found.systems:
            raise ConfigError(f"study '{name}' is about {', '.join(found.systems)}, not {system}")
    with local_pool(workers) as pool:
        for system in systems:
            for collect in found.collect:
                collect(Study(preset, data, results), system, pool)
        study = Study(preset, data, results)  # by the digests that are known now
        jobs = [job for system in systems for job in found.doors.jobs(study, system)]
        records = found.doors.records(results)
        records.run(jobs, functools.partial(found.doors.measure, data=data.absolute()), pool, name)
    return len(records.stored(jobs)), len(jobs)
