"""The functions behind `companion collect`, `run`, `show` and `merge`.

Each function imports what it needs when it runs, so that `--help` is quick. Each
returns the command's exit status.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Any

from companion import registry
from companion.cluster import executor_at
from ownrobot.command_line import parse_changes
from sidm.config import ConfigError
from sidm.systems import SYSTEMS


def _preset(arguments: argparse.Namespace):
    """The preset of --preset, with the changes of --set."""
    from companion import load_preset

    return load_preset(arguments.preset, **parse_changes(arguments.changes))


def _trials(arguments: argparse.Namespace, preset: Any) -> list:
    """The trials that --figure and the options that choose among them name."""
    return registry.grid(
        preset,
        figure=arguments.figure,
        system=arguments.system,
        minutes=arguments.minutes,
        seeds=arguments.seeds,
        methods=arguments.methods,
        steps=getattr(arguments, "steps", None),  # which `show` does not have
    )


def _refuse_choices(arguments: argparse.Namespace) -> None:
    """Refuse options of a grid of trials for what has no trials."""
    names = ["minutes", "seeds", "methods", "steps", "dask", "bundle", "seconds", "csv"]
    if isinstance(registry.find(arguments.figure), registry.Measurement):
        names.append("system")
    for name in [*names, "device"]:
        if getattr(arguments, name, None) not in (None, [], 0, "cpu"):
            raise ConfigError(
                f"--{name} is for figures of trials; {arguments.figure} is measured "
                "as a whole"
            )


def run_collect(arguments: argparse.Namespace) -> int:
    """Simulate datasets; print each dataset's name and digest.

    With --verify, print whether whole datasets are those of the results; the exit
    status is 1 if one is not.
    """
    from companion.engine.datasets import all_datasets, collect_motion
    from companion.engine.known_motion import compare, read
    from companion.trials import motion_of

    preset, data, results = _preset(arguments), arguments.data, arguments.results
    if arguments.figure:
        needed: dict = motion_of(_trials(arguments, preset))
    elif any(
        getattr(arguments, name) for name in ("minutes", "seeds", "methods", "steps")
    ):
        choices = "--minutes, --seeds, --methods and --steps"
        raise ConfigError(f"{choices} are of a figure: name one, --figure 3")
    else:
        systems = [arguments.system] if arguments.system else SYSTEMS
        needed = all_datasets(preset, systems)
    with executor_at(arguments.dask) as executor:
        digests = collect_motion(needed, data, arguments.workers, executor)
    whole = {dataset: len(which) == dataset.count for dataset, which in needed.items()}
    for dataset, which in needed.items():
        part = f", {len(which)} of {dataset.count} trajectories"
        name = f"{dataset.name}{'' if whole[dataset] else part}"
        print(f"{name}: {digests[dataset.name]}")
    if not arguments.verify:
        return 0
    different = False
    for dataset in needed:
        if not whole[dataset]:
            verdict = "not compared, since part of it is here"
        elif dataset.name not in read(results):
            verdict = "not compared, since no results are made with it"
        else:
            differences = compare(dataset, data, results)
            different |= bool(differences)
            verdict = "; ".join(differences) or "stands for the data of the results"
        print(f"{dataset.name}: {verdict}")
    return int(different)


def run_run(arguments: argparse.Namespace) -> int:
    """Run what is missing of a figure; print how much is stored.

    The exit status is 1 if something is still missing at the end.
    """
    from companion import Results, Study, run

    entry = registry.find(arguments.figure)
    study = Study(_preset(arguments))
    if entry is not None:
        _refuse_choices(arguments)
        folders = Path(arguments.data), Path(arguments.results)
        missing = entry.run(study, arguments.system, arguments.workers, *folders)
        print(f"missing: {missing}")
        return int(missing > 0)
    trials = _trials(arguments, study.preset)
    store = Results(arguments.results)
    with executor_at(arguments.dask) as executor:
        run(
            trials,
            executor,
            workers=arguments.workers,
            data=arguments.data,
            results=store,
            device=arguments.device,
            bundle=arguments.bundle,
            seconds=arguments.seconds or math.inf,
        )
    missing = len(store.missing(trials))
    print(f"{len(trials) - missing} of {len(trials)} trials stored")
    return int(missing > 0)


def run_show(arguments: argparse.Namespace) -> int:
    """Print what is stored of a figure, a line per point; last line 'missing: N'.

    With --against, print how the losses of two stores differ instead.
    """
    from companion import Results, Study
    from companion.engine.frame import numbers_and_words
    from companion.statistics.tables import overview
    from companion.studies.decisive.design import overview_by_step

    folder = Path(arguments.results)
    for given in (arguments.results, arguments.against):
        if given not in (None, "results") and not Path(given).is_dir():
            raise ConfigError(f"{given}: there is no such folder of results")
    store = Results(folder)
    if arguments.against:
        return _show_against(Results(arguments.against), store)
    study = Study(_preset(arguments))
    entry = registry.find(arguments.figure)
    if entry is not None:
        _refuse_choices(arguments)
        lines, missing = entry.overview(study, arguments.system, folder)
        print("\n".join([*lines, f"missing: {missing}"]))
        return 0
    trials = _trials(arguments, study.preset)
    words = " ".join([arguments.preset, *arguments.changes])
    print(f"preset {words}, figure {arguments.figure}: {len(trials)} trials")
    if arguments.figure == "decisive":
        lines, unknown = overview_by_step(study, store, trials)
    else:
        lines, unknown = overview(store, trials, study), 0
    print("\n".join(lines))
    for failure in store.failures(trials):
        print(f"note: {failure}")
    if arguments.csv:
        numbers_and_words(store.frame(trials)).to_csv(arguments.csv)
        print(f"table: {arguments.csv}")
    print(f"missing: {len(store.missing(trials)) + unknown}")
    return 0


def _show_against(other: Any, store: Any) -> int:
    """Print how the losses of two stores differ, a line per point that both have.

    Then why other trials of `store` have no counterpart.
    """
    from companion.studies.reproduction import table, unmatched
    from ownrobot.comparison.statistics import Interval

    points = table(other, store)
    for row in points.itertuples():
        ratio = Interval(row.ratio, row.low, row.high).text(3)
        print(
            f"{row.system}  {row.method:<18}{row.novice_minutes:>6g} min  "
            f"seeds {row.seeds}  stored {row.reference:.4g}  here {row.mean:.4g}  "
            f"ratio {ratio}"
        )
    for reason, count in unmatched(other, store).items():
        print(f"{count} trials here alone: {reason}")
    print(f"points in both: {len(points)}")
    return 0


def run_merge(arguments: argparse.Namespace) -> int:
    """Copy the rows of another store into this one; print how many came."""
    from companion import Results
    from companion.tasks.run import records

    if not Path(arguments.other).is_dir():
        raise ConfigError(f"there is no folder '{arguments.other}'")
    of_studies = (study.module.records for study in registry.STUDIES.values())
    count = sum(
        make(arguments.results).take_in(make(arguments.other))
        for make in (Results, records, *of_studies)
    )
    print(f"{count} results taken in")
    return 0
