"""Every study that stores records measures at tiny sizes, and comes to its figures."""

import dataclasses
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import pytest

from companion import Study
from companion.extensions.planning import Planning
from companion.registry import STUDIES
from companion.studies.driving.measure import DriverTest
from companion.studies.latent_space.measure import held_out_expert
from companion.studies.recorded_targets.measure import proxies
from tests.companion.conftest import kept, write_motion


class Case(NamedTuple):
    """What a study is held to."""

    kind: str  # work, a key of RESULT_VERSIONS
    figures: Sequence[str]  # fields of its records
    rel: float = 0.05
    abs: float = 0.02


CASES = {
    "latent-space": Case(
        "diagnosis", ("linear_accuracy", "network_accuracy", "raw_accuracy", "mmd")
    ),
    "recorded-targets": Case(
        "elsewhere", ("validation_loss", "samples", "best_test_loss"), abs=0.0
    ),
    "driving": Case(
        "driving", ("validation_loss", "position_error", "left", "throttle")
    ),
    "uncertainty": Case(
        "uncertainty", ("validation_loss", "nll", "nll_at_means", "coverage", "spread")
    ),
    "several-experts": Case(
        "experts", ("validation_loss", "before", "experts_loss", "samples"), abs=0.0
    ),
    "real-robots": Case("fitting", ("loss",), rel=0.1),
}


@pytest.fixture
def jobs(study, data, recordings):
    """Function that gives the jobs of a study by name, with their data written."""
    module = {name: STUDIES[name].module for name in CASES}

    def latent_space() -> Iterator[tuple[str, Any]]:
        job = module["latent-space"].jobs(study, "system1")[0]
        write_motion(data, held_out_expert(job))
        yield "diagnosis", job

    def recorded_targets() -> Iterator[tuple[str, Any]]:
        for dataset in proxies(study.preset, "system1").values():
            write_motion(data, dataset)
        found = module["recorded-targets"].jobs(study, "system1", recordings, [0.25])
        for job in found:
            if job.method in ("sidm", "corrected_averaged", "least_squares"):
                name = f"recorded, {job.method}, {job.proxy}"
                yield name, dataclasses.replace(job, held_out=2)

    def driving() -> Iterator[tuple[str, Any]]:
        plain = dict(system="system1", episodes=(0,), longest=0.5)
        small = Planning(samples=3, elites=2, horizon=4, hold=2)
        for driver, trial, planning in (
            ("model", study.trial("system1", "sidm", 0.75), small),
            ("corrected", study.trial("system1", "corrected", 0.75), small),
            ("simulator", None, dataclasses.replace(small, replan=2)),
            ("straight", None, None),
        ):
            name = "model" if trial is not None else driver
            job = DriverTest(driver=name, trial=trial, planning=planning, **plain)
            yield f"driving, {driver}", job

    def uncertainty() -> Iterator[tuple[str, Any]]:
        found = module["uncertainty"].jobs(study, "system1", [0.75], particles=8)
        yield "a fit by likelihood", found[0]
        yield "its twin", found[3]

    def several_experts() -> Iterator[tuple[str, Any]]:
        sizes = [1, 2], [0.25, 0.75]
        for job in module["several-experts"].jobs(study, "system1", *sizes):
            for member in job.members:
                write_motion(data, member)
        yield (
            "2 experts, the paper's",
            module["several-experts"].jobs(study, "system1", *sizes)[1],
        )

    def real_robots() -> Iterator[tuple[str, Any]]:
        for pair in STUDIES["real-robots"].pairs:
            for job in module["real-robots"].jobs(Study("smoke"), pair, (4, 8), 1):
                if (job.expert, job.method) in (
                    ("hunter", "sidm"),
                    ("", "rotation_centres"),
                ):
                    words = "real robots", job.expert, job.method
                    yield " ".join(filter(None, words)), job

    made = {
        "latent-space": latent_space,
        "recorded-targets": recorded_targets,
        "driving": driving,
        "uncertainty": uncertainty,
        "several-experts": several_experts,
        "real-robots": real_robots,
    }
    return lambda name: dict(made[name]())


@pytest.mark.parametrize("name", CASES)
def test_a_study_measures_stores_and_comes_to_its_figures(
    jobs, data, recordings, tmp_path, golden, name
):
    module, case, found = STUDIES[name].module, CASES[name], jobs(name)
    assert found
    more = {"recorded-targets": (data, recordings), "real-robots": ()}
    for of_golden, job in found.items():
        result = module.measure(job, *more.get(name, (data,)))
        figures = {field: getattr(result, field) for field in case.figures}
        golden.hold(of_golden, case.kind, figures, rel=case.rel, abs=case.abs)
        assert kept(module.records(tmp_path), result)


def test_no_study_is_left_out():
    """The study of the adversary measures what that of the latents measures."""
    assert {*STUDIES} == {*CASES, "adversary"}
