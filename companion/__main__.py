"""The command line of the companion; `companion --help` lists its commands."""

from __future__ import annotations

import argparse
import functools
import sys
from collections.abc import Sequence

from companion.commands import (
    run_collect,
    run_merge,
    run_run,
    run_show,
    run_train,
)
from companion.pages import notebook_command
from companion.tasks import command as bench_command
from ownrobot.command_line import Parser, carry_out, command_adder, whole_number
from sidm import __version__
from sidm.config import first_line
from sidm.systems import FAMILY_PAIRS, FREE_SYSTEMS, SYSTEMS

DESCRIPTION = (
    "What the book measures. Exit status: 0; 1 when something failed or is still "
    "missing; 2 for arguments that cannot be used."
)

#: The names of `grids` and `registry`, whose import would bring pandas.
_FIGURES = (
    "decisive, duration, 3, references, 4, tuning, little-data, choices, released, "
    "baselines, variants, p-expert, iterations, pixels, patience, other-bodies, "
    "free-struts, network-size, corrected-claim, most-data, latent-space, adversary, "
    "recorded-targets, driving, uncertainty, several-experts, real-robots, gap, "
    "overlap, untrained-latents, payoff, tree-search, throughput, coverage, explorer "
    "or all"
)
_PAIRS = (*SYSTEMS, *FREE_SYSTEMS, *FAMILY_PAIRS)
SEED = functools.partial(whole_number, least=0)


def build_parser() -> argparse.ArgumentParser:
    """The parser of the whole command line."""
    parser = Parser(prog="companion", description=DESCRIPTION)
    parser.add_argument("--version", action="version", version=__version__)
    command = command_adder(
        parser,
        ("collect", "train", "run", "show", "merge", "bench", "notebook"),
    )
    collect = command(
        "collect",
        run_collect,
        "Simulate the data that a preset lacks; what is on disk is kept.",
    )
    _add_preset(collect)
    text = "only what this one's trials need, also by size and seed; names as of run"
    _add_grid(collect, text, default=None)
    _add_steps(collect)
    collect.add_argument(
        "--verify",
        action="store_true",
        help="hold the data against those of the results: what differs by rounding "
        "alone stands for them",
    )
    collect.add_argument(
        "--workers",
        type=whole_number,
        metavar="N",
        help="processes; all cores unless given",
    )
    _add_dask(collect)

    train = command(
        "train",
        run_train,
        "Run one trial and store its result; goes on from its checkpoint.",
    )
    _add_preset(train)
    train.add_argument(
        "--system", required=True, choices=_PAIRS, help="the pair of robots"
    )
    train.add_argument(
        "--method", default="sidm", help="sidm, novice_only, ... (%(default)s)"
    )
    train.add_argument(
        "--minutes", type=float, required=True, help="novice data, minutes of motion"
    )
    train.add_argument(
        "--seed",
        type=SEED,
        default=0,
        help="of the novice subset, the weights and the batches (%(default)s)",
    )

    run = command(
        "run",
        run_run,
        "Run the trials of a figure that are not stored; can be stopped and goes on.",
    )
    _add_preset(run)
    _add_grid(run)
    _add_steps(run)
    _add_workers(run)
    run.add_argument(
        "--bundle",
        type=whole_number,
        default=0,
        metavar="N",
        help="train N trials side by side on the device, instead of in processes",
    )
    _add_dask(run)
    run.add_argument(
        "--here", action="store_true", help="only trials whose data lie under --data"
    )
    run.add_argument(
        "--seconds",
        type=whole_number,
        metavar="N",
        help="stop a bundle after so long; the same command goes on",
    )

    for trainer in (train, run):
        trainer.add_argument(
            "--device",
            type=_device,
            default="cpu",
            help="where to compute, cpu or cuda (%(default)s)",
        )

    show = command(
        "show", run_show, "List what is stored, stale (made by older code) and missing."
    )
    _add_preset(show)
    _add_grid(show)
    show.add_argument(
        "--csv",
        metavar="FILE",
        help="write the stored ones there as a table, a line a trial",
    )
    show.add_argument(
        "--against",
        metavar="DIR",
        help="other results: how the losses differ where both have a point",
    )

    merge = command(
        "merge",
        run_merge,
        "Take in the results of another store, such as one that was filled elsewhere.",
    )
    merge.add_argument("other", metavar="DIR", help="its folder")
    merge.add_argument(
        "--results",
        default="results",
        metavar="DIR",
        help="the store that takes it in (%(default)s)",
    )

    bench_command.add_arguments(
        command(
            "bench",
            bench_command.run_bench,
            "Run methods, yours among them, on the benchmark's tasks; print the table.",
        )
    )
    notebook_command.add_arguments(
        command(
            "notebook",
            notebook_command.run_from_arguments,
            "Run a notebook with checked parameters.",
        )
    )
    return parser


def _add_preset(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--preset",
        default="laptop",
        metavar="NAME",
        help="smoke, laptop, study, released or paper (%(default)s)",
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        dest="changes",
        help="change one value of the preset, e.g. seeds=5 or pixels=64; may be given "
        "again",
    )
    parser.add_argument(
        "--data",
        default="data",
        metavar="DIR",
        help="trajectories and checkpoints (%(default)s)",
    )
    parser.add_argument(
        "--results",
        default="results",
        metavar="DIR",
        help="the results store (%(default)s)",
    )


def _add_workers(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--workers",
        type=whole_number,
        default=2,
        metavar="N",
        help="processes of one thread each (%(default)s)",
    )


def _add_dask(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--dask",
        metavar="ADDRESS",
        help="work on a Dask cluster instead: its scheduler, tcp://HOST:PORT or a "
        "scheduler file",
    )


def _add_system(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--system",
        choices=_PAIRS,
        help="only this one; all that are asked for unless given",
    )


def _add_grid(
    parser: argparse.ArgumentParser,
    text: str = f"{_FIGURES} (%(default)s)",
    default: str | None = "3",
) -> None:
    _add_system(parser)
    parser.add_argument("--figure", default=default, help=text)
    parser.add_argument(
        "--minutes",
        type=float,
        nargs="+",
        help="only these novice dataset sizes, minutes of motion",
    )
    parser.add_argument("--seeds", type=int, nargs="+", help="only these seeds")


def _add_steps(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--steps",
        nargs="+",
        metavar="STEP",
        help="only these steps of the figure decisive, such as A1",
    )


def _device(name: str) -> str:
    """Parse the name of a device, on which PyTorch must be able to compute here."""
    import torch

    try:
        torch.zeros(1, device=name)
    except (RuntimeError, AssertionError) as error:
        raise argparse.ArgumentTypeError(
            f"'{name}' cannot be used here: {first_line(error)}"
        ) from None
    return name


def main(arguments: Sequence[str] | None = None) -> int:
    """Carry out a command line; errors are one line on stderr.

    Args:
        arguments: the command and its options; by default those of the process.

    Returns:
        The exit status.
    """
    return carry_out(build_parser(), arguments)


if __name__ == "__main__":
    sys.exit(main())
