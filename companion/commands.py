"""What the companion's commands do; each imports what it needs when it is carried out, so that `--help` is quick."""

from __future__ import annotations

import argparse
import contextlib
import math
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

from sidm.config import ConfigError, changes
from sidm.systems import SYSTEMS


def _executor(
    arguments: argparse.Namespace,
) -> contextlib.AbstractContextManager[Executor | None]:
    """The cluster of --dask, or None without."""
    if arguments.dask is None:
        return contextlib.nullcontext()
    from companion.cluster import dask_executor

    return dask_executor(arguments.dask)


def _preset(arguments: argparse.Namespace):
    """The preset that was asked for, with the changes of --set."""
    from companion import load_preset

    return load_preset(arguments.preset, **changes(arguments.changes))


def _trials(arguments: argparse.Namespace, preset: Any) -> list:
    """The trials that --figure, --system, --minutes and --seeds ask for."""
    from companion import grid

    return grid(
        preset,
        figure=arguments.figure,
        system=arguments.system,
        minutes=arguments.minutes,
        seeds=arguments.seeds,
        data=arguments.data,
        results=arguments.results,
    )


def run_collect(arguments: argparse.Namespace) -> int:
    """`collect`: prints each dataset and its digest; with --verify 1 when one is not that of the results."""
    from companion import collect_datasets, grid
    from companion.engine.datasets import differing, verify_datasets

    preset = _preset(arguments)
    if arguments.figure:
        trials = grid(
            preset,
            arguments.figure,
            arguments.system,
            data=arguments.data,
            results=arguments.results,
        )
        needed = list(
            dict.fromkeys(
                dataset for trial in trials for dataset in trial.datasets.values()
            )
        )
    else:
        systems = [arguments.system] if arguments.system else list(SYSTEMS)
        needed = [
            dataset for system in systems for dataset in preset.every_dataset(system)
        ]
    with _executor(arguments) as executor:
        found = collect_datasets(
            preset,
            data=arguments.data,
            workers=arguments.workers,
            executor=executor,
            needed=needed,
        )
    for name, digest in found.items():
        print(f"{name}: {digest}")
    if not arguments.verify:
        for name in differing(preset, arguments.data, arguments.results):
            print(
                f"note: {name} has other bits than the results' data; collect --verify: is it rounding alone?"
            )
        return 0
    verified = verify_datasets(needed, arguments.data, arguments.results)
    for name, differences in verified.items():
        print(
            f"{name}: {'; '.join(differences) or 'stands for the data of the results'}"
        )
    return int(any(verified.values()))


def run_train(arguments: argparse.Namespace) -> int:
    """`train`: prints where the result lies and what it is."""
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
    """`run`: 1 when trials are missing at the end."""
    from companion import Results, registry, run
    from companion.engine.datasets import is_here

    if arguments.pack is None and not registry.is_of_trials(arguments.figure):
        return _run_other(arguments)
    if arguments.pack is None:
        trials = _trials(arguments, _preset(arguments))
        if arguments.here:
            trials = [trial for trial in trials if is_here(trial, arguments.data)]
    else:
        from companion.engine.pack import unpack

        trials = unpack(arguments.pack, Path(arguments.data))
    store = Results(arguments.results)
    with _executor(arguments) as executor:
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


def _run_other(arguments: argparse.Namespace) -> int:
    """`run` of what is not trials."""
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
    """`pack`: prints how many trials went into the file, and its size."""
    from companion import Results
    from companion.engine.pack import MEBIBYTE, pack
    from companion.trials import UNKNOWN

    missing = Results(arguments.results).missing(_trials(arguments, _preset(arguments)))
    known = [
        trial
        for trial in missing
        if UNKNOWN not in trial.digests.values() and not trial.solved
    ]
    taken = pack(known, arguments.file, Path(arguments.data), arguments.limit)
    size = arguments.file.stat().st_size / MEBIBYTE
    print(
        f"{arguments.file}: {len(taken)} of {len(missing)} missing trials, {size:.1f} MiB"
    )
    return 0


def run_show(arguments: argparse.Namespace) -> int:
    """`show`: a line a point, then 'missing: N'."""
    from companion import Results, Study, registry
    from companion.engine.datasets import differing
    from companion.statistics.tables import overview
    from companion.studies.decisive.design import listed

    store = Results(arguments.results)
    if arguments.against:
        return _show_against(Results(arguments.against), store)
    preset = _preset(arguments)
    if not registry.is_of_trials(arguments.figure):
        lines, missing = registry.overview(
            arguments.figure,
            preset,
            arguments.system,
            arguments.data,
            arguments.results,
        )
        print("\n".join([*lines, f"missing: {missing}"]))
        return 0
    trials = _trials(arguments, preset)
    print(f"preset {arguments.preset}, figure {arguments.figure}: {len(trials)} trials")
    study = Study(preset, arguments.data, arguments.results)
    lines, unknown = (
        listed(study, store, trials)
        if arguments.figure == "decisive"
        else (overview(store, trials, study), 0)
    )
    print("\n".join(lines))
    for failure in store.failures(trials):
        print(f"note: {failure}")
    for name in differing(preset, arguments.data, arguments.results):
        print(
            f"note: the data on this disk are not those of the stored results: {name}; see collect --verify"
        )
    if arguments.csv:
        from companion.engine.frame import numbers_and_words

        numbers_and_words(store.frame(trials)).to_csv(arguments.csv)
        print(f"table: {arguments.csv}")
    print(f"missing: {len(store.missing(trials)) + unknown}")
    return 0


def _show_against(stored: Any, made: Any) -> int:
    """`show --against`: a line a point that both stores have."""
    from companion.statistics.intervals import Interval
    from companion.studies.reproduction import table

    points = table(stored, made)
    for one in points.itertuples():
        words = f"{one.system}  {one.method:<18}{one.novice_minutes:>6g} min  seeds {one.seeds}"
        ratio = Interval(one.ratio, one.low, one.high).words(3)
        print(
            f"{words}  stored {one.reference:.4g}  here {one.mean:.4g}  ratio {ratio}"
        )
    print(f"points in both: {len(points)}")
    return 0


def run_merge(arguments: argparse.Namespace) -> int:
    """`merge`: prints how many rows came."""
    from companion import Results

    if not Path(arguments.other).is_dir():
        raise ConfigError(f"there is no folder '{arguments.other}'")
    print(
        f"{Results(arguments.results).take_in(Results(arguments.other))} results taken in"
    )
    return 0
