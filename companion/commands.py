"""The functions behind the companion's commands.

Each function imports what it needs when it runs, so that `--help` is quick. Each
returns the command's exit status.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Any

from companion.cluster import executor_at
from sidm.config import ConfigError, parse_changes
from sidm.systems import SYSTEMS


def _preset(arguments: argparse.Namespace):
    """The preset of --preset, with the changes of --set."""
    from companion import load_preset

    return load_preset(arguments.preset, **parse_changes(arguments.changes))


def _trials(arguments: argparse.Namespace, preset: Any) -> list:
    """The trials that --figure, --system, --minutes, --seeds and --steps name."""
    from companion import grid

    return grid(
        preset,
        figure=arguments.figure,
        system=arguments.system,
        minutes=arguments.minutes,
        seeds=arguments.seeds,
        data=arguments.data,
        results=arguments.results,
        steps=getattr(arguments, "steps", None),  # which `show` does not have
    )


def _datasets(arguments: argparse.Namespace, preset: Any) -> list:
    """The datasets that `collect` is to make, each once."""
    if not arguments.figure:
        systems = [arguments.system] if arguments.system else list(SYSTEMS)
        return [dataset for name in systems for dataset in preset.all_datasets(name)]
    from companion import grid

    trials = grid(
        preset,
        arguments.figure,
        arguments.system,
        data=arguments.data,
        results=arguments.results,
        steps=arguments.steps,
    )
    datasets = (dataset for trial in trials for dataset in trial.datasets.values())
    return list(dict.fromkeys(datasets))


def run_collect(arguments: argparse.Namespace) -> int:
    """Simulate datasets; print each dataset's name and digest.

    Returns:
        1 if --verify is given and a dataset is not the one of the results; else 0.
    """
    from companion import collect_datasets
    from companion.engine.datasets import differing_names, verify_datasets

    preset = _preset(arguments)
    needed = _datasets(arguments, preset)
    with executor_at(arguments.dask) as executor:
        digests = collect_datasets(
            preset,
            data=arguments.data,
            workers=arguments.workers,
            executor=executor,
            needed=needed,
        )
    for name, digest in digests.items():
        print(f"{name}: {digest}")
    if not arguments.verify:
        for name in differing_names(preset, arguments.data, arguments.results):
            print(
                f"note: {name} has other bits than the results' data; "
                "collect --verify: is it rounding alone?"
            )
        return 0
    verified = verify_datasets(needed, arguments.data, arguments.results)
    for name, differences in verified.items():
        verdict = "; ".join(differences) or "stands for the data of the results"
        print(f"{name}: {verdict}")
    return int(any(verified.values()))


def run_train(arguments: argparse.Namespace) -> int:
    """Run one trial; print the file of its result and its validation loss."""
    from companion import Results, Study
    from companion.engine.run import run_here

    trial = Study(_preset(arguments), arguments.data, arguments.results).trial(
        arguments.system, arguments.method, arguments.minutes, arguments.seed
    )
    store = Results(arguments.results)
    row = run_here(
        trial, arguments.data, store, device=arguments.device, log=arguments.log
    )
    print(f"{store.path(trial)}: validation loss {row.outcome.validation_loss:.6g}")
    return 0


def run_run(arguments: argparse.Namespace) -> int:
    """Run what is missing of a figure or a pack; print how much is stored.

    Returns:
        1 if something is still missing at the end; else 0.
    """
    from companion import Results, registry, run
    from companion.engine.datasets import is_here

    if arguments.pack is not None:
        from companion.engine.pack import unpack

        trials = unpack(arguments.pack, Path(arguments.data))
    elif registry.is_grid(arguments.figure):
        trials = _trials(arguments, _preset(arguments))
        if arguments.here:
            trials = [trial for trial in trials if is_here(trial, arguments.data)]
    else:
        return _run_study(arguments)
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
            log=arguments.log,
            seconds=arguments.seconds or math.inf,
        )
    missing = len(store.missing(trials))
    print(f"{len(trials) - missing} of {len(trials)} trials stored")
    return 1 if missing else 0


def _run_study(arguments: argparse.Namespace) -> int:
    """Run a study or a measurement, whose results are not trials."""
    from companion import registry

    missing = registry.run(
        arguments.figure,
        _preset(arguments),
        arguments.system,
        arguments.workers,
        arguments.data,
        arguments.results,
    )
    print(f"missing: {len(missing)}")
    return 1 if missing else 0


def run_pack(arguments: argparse.Namespace) -> int:
    """Write missing trials and their data into a file; print their number and size."""
    from companion import Results
    from companion.engine.pack import MEBIBYTE, pack
    from companion.trials import UNKNOWN

    missing = Results(arguments.results).missing(_trials(arguments, _preset(arguments)))
    trainable = [
        trial
        for trial in missing
        if UNKNOWN not in trial.digests.values() and not trial.solved
    ]
    packed = pack(trainable, arguments.file, Path(arguments.data), arguments.limit)
    size = arguments.file.stat().st_size / MEBIBYTE
    count = f"{len(packed)} of {len(missing)} missing trials"
    print(f"{arguments.file}: {count}, {size:.1f} MiB")
    return 0


def run_show(arguments: argparse.Namespace) -> int:
    """Print what is stored of a figure, a line per point; last line 'missing: N'."""
    from companion import Results, Study, registry
    from companion.engine.datasets import differing_names
    from companion.statistics.tables import overview
    from companion.studies.decisive.design import overview_by_step

    folder = Path(arguments.results)
    if arguments.results != "results" and not folder.is_dir():
        raise ConfigError(f"{folder}: there is no such folder of results")
    store = Results(folder)
    if arguments.against:
        return _show_against(Results(arguments.against), store)
    preset = _preset(arguments)
    folders = arguments.data, arguments.results
    if not registry.is_grid(arguments.figure):
        lines, missing = registry.overview(
            arguments.figure, preset, arguments.system, *folders
        )
        print("\n".join([*lines, f"missing: {missing}"]))
        return 0
    trials = _trials(arguments, preset)
    words = " ".join([arguments.preset, *arguments.changes])
    print(f"preset {words}, figure {arguments.figure}: {len(trials)} trials")
    study = Study(preset, *folders)
    if arguments.figure == "decisive":
        lines, unknown = overview_by_step(study, store, trials)
    else:
        lines, unknown = overview(store, trials, study), 0
    print("\n".join(lines))
    for failure in store.failures(trials):
        print(f"note: {failure}")
    for name in differing_names(preset, *folders):
        print(
            "note: the data on this disk are not those of the stored results: "
            f"{name}; see collect --verify"
        )
    if arguments.csv:
        from companion.engine.frame import numbers_and_words

        numbers_and_words(store.frame(trials)).to_csv(arguments.csv)
        print(f"table: {arguments.csv}")
    print(f"missing: {len(store.missing(trials)) + unknown}")
    return 0


def _show_against(other: Any, store: Any) -> int:
    """Print how the losses of two stores differ, a line per point that both have.

    Then why other trials of `store` have no counterpart.
    """
    from companion.statistics.intervals import Interval
    from companion.studies.reproduction import table, unmatched

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
    """Copy the results of another store into this one; print how many rows came."""
    from companion import Results

    if not Path(arguments.other).is_dir():
        raise ConfigError(f"there is no folder '{arguments.other}'")
    count = Results(arguments.results).take_in(Results(arguments.other))
    print(f"{count} results taken in")
    return 0
