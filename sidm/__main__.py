"""The command line, whose commands `sidm --help` lists.

Exit status: 0; 1 when something failed or is still missing; 2 for arguments that cannot be used.
"""

from __future__ import annotations

import argparse
import contextlib
import functools
import math
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import BrokenExecutor, Executor
from pathlib import Path
from typing import Any

from sidm import __version__, notebook
from sidm.config import ConfigError, Fault, changes, first_line
from sidm.explorer.command import add_replay
from sidm.fitting.command import add_commands
from sidm.systems import FAMILY_PAIRS, FREE_SYSTEMS, SYSTEMS

#: As the catalogue has them, which would bring PyTorch.
_STUDIES = "latent-space, recorded-targets, driving, uncertainty, several-experts, real-robots"
_PAIRS = (*SYSTEMS, *FREE_SYSTEMS, *FAMILY_PAIRS)


def build_parser() -> argparse.ArgumentParser:
    """The parser of the whole command line."""
    parser = notebook.Parser(prog="sidm", description=(__doc__ or "").split("\n\n")[1])
    parser.add_argument("--version", action="version", version=__version__)
    names = "collect | train | run | pack | study | show | merge | fit | evaluate | predict | replay | notebook"
    commands = parser.add_subparsers(metavar=names, required=True)

    def command(name: str, work: Callable[[argparse.Namespace], int], help: str) -> argparse.ArgumentParser:
        made = commands.add_parser(name, help=help, description=help)
        made.set_defaults(work=work)
        return made

    collect = command("collect", run_collect, "Simulate the data that a preset lacks; what is on disk is kept.")
    _add_preset(collect)
    _add_system(collect)
    collect.add_argument("--figure", help="what this one needs alone; names as of run")
    collect.add_argument(
        "--verify", action="store_true",
        help="hold the data against those of the results: what differs by rounding alone stands for them",
    )  # fmt: skip
    collect.add_argument("--workers", type=_positive, metavar="N", help="processes; all cores unless given")
    _add_dask(collect)

    train = command("train", run_train, "Run one trial and store its result; goes on from its checkpoint.")
    _add_preset(train)
    train.add_argument("--system", required=True, choices=_PAIRS, help="the pair of robots")
    train.add_argument("--method", default="sidm", help="sidm, novice_only, ... (%(default)s)")
    train.add_argument("--minutes", type=float, required=True, help="novice data, minutes of motion")
    train.add_argument(
        "--seed", type=_seed, default=0,
        help="of the novice subset, the weights and the batches (%(default)s)",
    )  # fmt: skip

    run = command("run", run_run, "Run the trials of a figure that are not stored; can be stopped and goes on.")
    _add_preset(run)
    _add_grid(run)
    _add_workers(run)
    run.add_argument(
        "--bundle", type=_positive, default=0, metavar="N",
        help="train N trials side by side on the device, instead of in processes",
    )  # fmt: skip
    _add_dask(run)
    run.add_argument("--pack", type=Path, metavar="FILE", help="the trials of a file of 'pack', its data under --data")
    run.add_argument("--here", action="store_true", help="only trials whose data lie under --data")
    words = "stop a bundle after so long; the same command goes on"
    run.add_argument("--seconds", type=_positive, metavar="N", help=words)

    pack = command("pack", run_pack, "Write a figure's missing trials and their data into one file for 'run --pack'.")
    pack.add_argument("file", type=Path, metavar="FILE", help="a .tar file")
    _add_preset(pack)
    _add_grid(pack)
    pack.add_argument("--limit", type=_positive, default=60, metavar="MIB", help="of the file's size (%(default)s)")

    for trainer in (train, run):
        words = "where to compute, cpu or cuda (%(default)s)"
        trainer.add_argument("--device", type=_device, default="cpu", help=words)
        trainer.add_argument("--log", metavar="DIR", help="write TensorBoard event files there, to watch it learn")

    study = command("study", run_study, "Simulate, train and measure what a study beyond the trials lacks.")
    study.add_argument("name", metavar="NAME", help=f"one of {_STUDIES}")
    _add_preset(study)
    _add_system(study)
    _add_workers(study)

    show = command("show", run_show, "List what is stored, stale (made by older code) and missing.")
    _add_preset(show)
    _add_grid(show)
    show.add_argument("--csv", metavar="FILE", help="write the stored ones there as a table, a line a trial")
    show.add_argument("--against", metavar="DIR", help="other results: how the losses differ where both have a point")

    merge = command("merge", run_merge, "Take in the results of another store, such as one that was filled elsewhere.")
    merge.add_argument("other", metavar="DIR", help="its folder")
    merge.add_argument("--results", default="results", metavar="DIR", help="the store that takes it in (%(default)s)")

    add_commands(command)
    add_replay(command)
    runner = commands.add_parser("notebook", help="Run a notebook with checked parameters.")
    notebook.add_arguments(runner)
    runner.set_defaults(work=notebook.run_from_arguments)
    return parser


def _add_preset(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--preset", default="laptop", metavar="NAME",
        help="smoke, laptop, study, released or paper (%(default)s)",
    )  # fmt: skip
    parser.add_argument(
        "--set", action="append", default=[], metavar="NAME=VALUE", dest="changes",
        help="change one value of the preset, e.g. seeds=5 or pixels=64; may be given again",
    )  # fmt: skip
    parser.add_argument("--data", default="data", metavar="DIR", help="trajectories and checkpoints (%(default)s)")
    parser.add_argument("--results", default="results", metavar="DIR", help="the results store (%(default)s)")


def _add_workers(parser: argparse.ArgumentParser) -> None:
    words = "processes of one thread each (%(default)s)"
    parser.add_argument("--workers", type=_positive, default=2, metavar="N", help=words)


def _add_dask(parser: argparse.ArgumentParser) -> None:
    words = "work on a Dask cluster instead: its scheduler, tcp://HOST:PORT or a scheduler file"
    parser.add_argument("--dask", metavar="ADDRESS", help=words)


def _executor(arguments: argparse.Namespace) -> contextlib.AbstractContextManager[Executor | None]:
    """The cluster of --dask, or None without."""
    if arguments.dask is None:
        return contextlib.nullcontext()
    from sidm.cluster import dask_executor

    return dask_executor(arguments.dask)


def _add_system(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--system", choices=_PAIRS, help="only this one; all that are asked for unless given")


def _add_grid(parser: argparse.ArgumentParser) -> None:
    _add_system(parser)
    figures = "decisive, duration, 3, references, 4, tuning, little-data, choices, released, baselines, variants, "
    figures += "p-expert, iterations, pixels, patience, other-bodies, free-struts, network-size, corrected-claim, "
    figures += "most-data or all"
    parser.add_argument("--figure", default="3", help=f"{figures} (%(default)s)")
    parser.add_argument("--minutes", type=float, nargs="+", help="only these novice dataset sizes, minutes of motion")
    parser.add_argument("--seeds", type=int, nargs="+", help="only these seeds")


def _positive(text: str, least: int = 1) -> int:
    """A whole number above 0; argparse reports any other."""
    number = int(text)
    if number < least:
        raise argparse.ArgumentTypeError(f"must be at least {least}, not {number}")
    return number


_seed = functools.partial(_positive, least=0)


def _preset(arguments: argparse.Namespace):
    """The preset that was asked for, with the changes of --set."""
    from sidm.experiments import load_preset

    return load_preset(arguments.preset, **changes(arguments.changes))


def _device(name: str) -> str:
    """An argument that names a device PyTorch can compute on here."""
    import torch

    try:
        torch.zeros(1, device=name)
    except (RuntimeError, AssertionError) as error:
        raise argparse.ArgumentTypeError(f"'{name}' cannot be used here: {first_line(error)}") from None
    return name


def _trials(arguments: argparse.Namespace, preset: Any) -> list:
    """The trials that --figure, --system, --minutes and --seeds ask for."""
    from sidm.experiments import grid

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
    from sidm.experiments import collect_datasets, grid
    from sidm.experiments.engine.datasets import differing, verify_datasets

    preset = _preset(arguments)
    if arguments.figure:
        trials = grid(preset, arguments.figure, arguments.system, data=arguments.data, results=arguments.results)
        needed = list(dict.fromkeys(dataset for trial in trials for dataset in trial.datasets.values()))
    else:
        systems = [arguments.system] if arguments.system else list(SYSTEMS)
        needed = [dataset for system in systems for dataset in preset.every_dataset(system)]
    with _executor(arguments) as executor:
        found = collect_datasets(
            preset, data=arguments.data, workers=arguments.workers, executor=executor, needed=needed
        )
    for name, digest in found.items():
        print(f"{name}: {digest}")
    if not arguments.verify:
        for name in differing(preset, arguments.data, arguments.results):
            print(f"note: {name} has other bits than the results' data; collect --verify: is it rounding alone?")
        return 0
    verified = verify_datasets(needed, arguments.data, arguments.results)
    for name, differences in verified.items():
        print(f"{name}: {'; '.join(differences) or 'stands for the data of the results'}")
    return int(any(verified.values()))


def run_train(arguments: argparse.Namespace) -> int:
    """`train`: prints where the result lies and what it is."""
    from sidm.experiments import Results, Study
    from sidm.experiments.engine.run import run_here

    trial = Study(_preset(arguments), arguments.data, arguments.results).trial(
        arguments.system, arguments.method, arguments.minutes, arguments.seed
    )
    store = Results(arguments.results)
    row = run_here(trial, arguments.data, store, device=arguments.device, log=arguments.log)
    print(f"{store.path(trial)}: validation loss {row.outcome.validation_loss:.6g}")
    return 0


def run_run(arguments: argparse.Namespace) -> int:
    """`run`: 1 when trials are missing at the end."""
    from sidm.experiments import Results, run
    from sidm.experiments.engine.datasets import is_here

    if arguments.pack is None:
        trials = _trials(arguments, _preset(arguments))
        if arguments.here:
            trials = [trial for trial in trials if is_here(trial, arguments.data)]
    else:
        from sidm.experiments.engine.pack import unpack

        trials = unpack(arguments.pack, Path(arguments.data))
    store = Results(arguments.results)
    with _executor(arguments) as executor:
        run(
            trials, executor, workers=arguments.workers, data=arguments.data, results=store, device=arguments.device,
            bundle=arguments.bundle, log=arguments.log, seconds=arguments.seconds or math.inf,
        )  # fmt: skip
    missing = len(store.missing(trials))
    print(f"{len(trials) - missing} of {len(trials)} trials stored")
    return 1 if missing else 0


def run_pack(arguments: argparse.Namespace) -> int:
    """`pack`: prints how many trials went into the file, and its size."""
    from sidm.experiments import Results
    from sidm.experiments.engine.pack import MEBIBYTE, pack
    from sidm.experiments.trials import UNKNOWN

    missing = Results(arguments.results).missing(_trials(arguments, _preset(arguments)))
    known = [trial for trial in missing if UNKNOWN not in trial.digests.values() and not trial.solved]
    taken = pack(known, arguments.file, Path(arguments.data), arguments.limit)
    size = arguments.file.stat().st_size / MEBIBYTE
    print(f"{arguments.file}: {len(taken)} of {len(missing)} missing trials, {size:.1f} MiB")
    return 0


def run_study(arguments: argparse.Namespace) -> int:
    """`study`: 1 when results are missing at the end."""
    from sidm.experiments.catalogue import run_study

    systems = [arguments.system] if arguments.system else None
    have, wanted = run_study(
        arguments.name, _preset(arguments), systems, arguments.workers, arguments.data, arguments.results
    )
    print(f"{have} of {wanted} results stored")
    return 0 if have == wanted else 1


def run_show(arguments: argparse.Namespace) -> int:
    """`show`: a line a point, then 'missing: N'."""
    from sidm.experiments import Results, Study
    from sidm.experiments.engine.datasets import differing
    from sidm.experiments.statistics.tables import overview
    from sidm.experiments.studies.decisive.design import listed

    store = Results(arguments.results)
    if arguments.against:
        return _show_against(Results(arguments.against), store)
    preset = _preset(arguments)
    trials = _trials(arguments, preset)
    print(f"preset {arguments.preset}, figure {arguments.figure}: {len(trials)} trials")
    study = Study(preset, arguments.data, arguments.results)
    lines, unknown = listed(study, store, trials) if arguments.figure == "decisive" else (
        overview(store, trials, study), 0)  # fmt: skip
    print("\n".join(lines))
    for failure in store.failures(trials):
        print(f"note: {failure}")
    for name in differing(preset, arguments.data, arguments.results):
        print(f"note: the data on this disk are not those of the stored results: {name}; see collect --verify")
    if arguments.csv:
        from sidm.experiments.engine.frame import numbers_and_words

        numbers_and_words(store.frame(trials)).to_csv(arguments.csv)
        print(f"table: {arguments.csv}")
    print(f"missing: {len(store.missing(trials)) + unknown}")
    return 0


def _show_against(stored: Any, made: Any) -> int:
    """`show --against`: a line a point that both stores have."""
    from sidm.experiments.statistics.intervals import Interval
    from sidm.experiments.studies.reproduction import table

    points = table(stored, made)
    for one in points.itertuples():
        words = f"{one.system}  {one.method:<18}{one.novice_minutes:>6g} min  seeds {one.seeds}"
        ratio = Interval(one.ratio, one.low, one.high).words(3)
        print(f"{words}  stored {one.reference:.4g}  here {one.mean:.4g}  ratio {ratio}")
    print(f"points in both: {len(points)}")
    return 0


def run_merge(arguments: argparse.Namespace) -> int:
    """`merge`: prints how many rows came."""
    from sidm.experiments import Results

    if not Path(arguments.other).is_dir():
        raise ConfigError(f"there is no folder '{arguments.other}'")
    print(f"{Results(arguments.results).take_in(Results(arguments.other))} results taken in")
    return 0


def main(words: Sequence[str] | None = None) -> int:
    """Carry out a command line and return its exit status; errors are one line on stderr."""
    arguments = build_parser().parse_args(words)
    try:
        return arguments.work(arguments)
    except ConfigError as error:
        return _fail(error, 2)
    except BrokenExecutor:
        return _fail("a worker was killed (out of memory?); the same command goes on where this one was", 1)
    except KeyboardInterrupt:
        return _fail("stopped; the same command goes on where this one was", 1)
    except (Fault, OSError, ImportError, RuntimeError) as error:
        return _fail(error, 1)


def _fail(error: object, status: int) -> int:
    print(f"sidm: {first_line(error)}", file=sys.stderr)
    return status


if __name__ == "__main__":
    sys.exit(main())
