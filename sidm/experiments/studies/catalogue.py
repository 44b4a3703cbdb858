"""The studies beyond the trials, by name: what they are of, what does their work, where their records are."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable
from concurrent.futures import Executor
from pathlib import Path
from typing import Any, NamedTuple

from sidm.config import unknown_name
from sidm.experiments.engine.confirm import Confirmed, confirm_records
from sidm.experiments.engine.datasets import collect_datasets
from sidm.experiments.engine.records import Records
from sidm.experiments.presets import Preset
from sidm.experiments.studies.driving import drive as driving
from sidm.experiments.studies.recorded_targets import transfer as elsewhere
from sidm.experiments.studies.several_experts import pretrain as experts
from sidm.experiments.studies.several_experts.family import collect_members
from sidm.experiments.studies.uncertainty import fit as uncertainty
from sidm.experiments.study import Study


def collect_preset(study: Study, system: str, executor: Executor) -> None:
    """Simulate what is missing of a preset's own datasets."""
    collect_datasets(study.preset, [system], study.data, executor=executor)


def collect_family(study: Study, system: str, executor: Executor) -> None:
    """And of the experts of the family."""
    collect_preset(study, system, executor)
    needed = experts.members_needed(experts.pretrainings(study, system))
    collect_members(system, study.preset.policy, needed, study.data, study.results, executor)


class Beyond(NamedTuple):
    """A study whose results are records."""

    jobs: Callable[[Study, str], list[Any]]  # of a system
    work: Callable[..., Any]  # on one of them, with the folder of the data
    stored: Callable[[Path], Records]
    collect: Callable[[Study, str, Executor], None] = collect_preset  # simulate what the jobs of a system need


STUDIES = {
    "elsewhere": Beyond(
        elsewhere.transfers, elsewhere.transfer, elsewhere.stored, elsewhere.collect_proxies
    ),
    "driving": Beyond(driving.drives, driving.drive, driving.stored),
    "uncertainty": Beyond(uncertainty.fits, uncertainty.fit, uncertainty.stored),
    "experts": Beyond(experts.pretrainings, experts.pretrain, experts.stored, collect_family),
}  # fmt: skip


def find_study(name: str) -> Beyond:
    """The study of that name; ConfigError naming the nearest otherwise."""
    if name not in STUDIES:
        raise unknown_name(name, STUDIES, "the studies")
    return STUDIES[name]


def _jobs(found: Beyond, preset: Preset, systems: Iterable[str], data: Path, results: Path) -> list[Any]:
    """All of a study, by the digests that are known now."""
    study = Study(preset, data, results)
    return [job for system in systems for job in found.jobs(study, system)]


def run_study(
    name: str, preset: Preset, systems: Iterable[str], executor: Executor, data: Path, results: Path
) -> tuple[int, int]:
    """Simulate and make what a study lacks; how many results it has, and how many it should have."""
    found, systems = find_study(name), tuple(systems)
    for system in systems:
        found.collect(Study(preset, data, results), system, executor)
    jobs, records = _jobs(found, preset, systems, data, results), found.stored(results)
    records.run(jobs, functools.partial(found.work, data=data.absolute()), executor, name)
    return len(records.stored(jobs)), len(jobs)


def confirm_study(
    name: str, preset: Preset, systems: Iterable[str], executor: Executor, data: Path, results: Path
) -> Confirmed:
    """Make one of each kind of a study's stale records again, and mark the kinds that come out the same.

    Returns:
        How many are marked, and the files of those that came out otherwise.
    """
    found, count, differing = find_study(name), 0, []
    records, work = found.stored(results), functools.partial(found.work, data=data.absolute())
    for system in systems:
        jobs = _jobs(found, preset, [system], data, results)
        if any(one.provenance.stale for one in records.stored(jobs)):
            found.collect(Study(preset, data, results), system, executor)
            confirmed = confirm_records(jobs, records, work, executor)
            count += confirmed.confirmed
            differing += [records.path(about) for about in confirmed.differing]
    return Confirmed(count, differing)
