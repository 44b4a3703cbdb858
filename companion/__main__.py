"""The command line of the companion; `companion --help` lists its commands."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from companion import commands
from companion.pages import notebook_command
from companion.registry import NAMES
from companion.tasks import command as bench_command
from ownrobot.command_line import Parser, carry_out, command_adder, whole_number
from sidm import __version__
from sidm.config import first_line
from sidm.systems import FAMILY_PAIRS, FREE_SYSTEMS, SYSTEMS

DESCRIPTION = (
    "What the book measures. Exit status: 0; 1 when something failed or is still "
    "missing; 2 for arguments that cannot be used."
)
PAIRS = (*SYSTEMS, *FREE_SYSTEMS, *FAMILY_PAIRS)


def build_parser() -> argparse.ArgumentParser:
    """The parser of the whole command line."""
    parser = Parser(prog="companion", description=DESCRIPTION)
    parser.add_argument("--version", action="version", version=__version__)
    names = ("collect", "run", "show", "merge", "bench", "notebook")
    command = command_adder(parser, names)

    text = "Simulate the data that a preset lacks; what is on disk is kept."
    collect = command("collect", commands.run_collect, text)
    _add_preset(collect)
    text = "only what this one's trials need, also by size and seed; a figure of trials"
    _add_grid(collect, text, default=None)
    _add_steps(collect)
    text = "hold the data against those of the results: what differs by rounding "
    text += "alone stands for them"
    collect.add_argument("--verify", action="store_true", help=text)
    text = "processes; all cores unless given"
    collect.add_argument("--workers", type=whole_number, metavar="N", help=text)
    _add_dask(collect)

    text = (
        "Run the trials of a figure that are not stored, on motion that `collect` "
        "made; can be stopped and goes on."
    )
    run = command("run", commands.run_run, text)
    _add_preset(run)
    _add_grid(run)
    _add_steps(run)
    add = run.add_argument
    text = "processes of one thread each (%(default)s)"
    add("--workers", type=whole_number, default=2, metavar="N", help=text)
    text = "train N trials side by side on the device, instead of in processes"
    add("--bundle", type=whole_number, default=0, metavar="N", help=text)
    _add_dask(run)
    text = "stop a bundle after so long; the same command goes on"
    add("--seconds", type=whole_number, metavar="N", help=text)
    text = "where to compute, cpu or cuda (%(default)s)"
    add("--device", type=_device, default="cpu", help=text)

    text = "List what is stored, stale (made by older code) and missing."
    show = command("show", commands.run_show, text)
    _add_preset(show)
    _add_grid(show)
    text = "write the stored ones there as a table, a line a trial"
    show.add_argument("--csv", metavar="FILE", help=text)
    text = "other results: how the losses differ where both have a point"
    show.add_argument("--against", metavar="DIR", help=text)

    text = (
        "Take in the results of another store, such as one that was filled elsewhere."
    )
    merge = command("merge", commands.run_merge, text)
    merge.add_argument("other", metavar="DIR", help="its folder")
    _add_folder(merge, "results", "the store that takes it in")

    text = "Run methods, yours among them, on the benchmark's tasks; print the table."
    bench_command.add_arguments(command("bench", bench_command.run_bench, text))
    text = "Run a notebook with checked parameters."
    run_notebook = notebook_command.run_from_arguments
    notebook_command.add_arguments(command("notebook", run_notebook, text))
    return parser


def _add_preset(parser: argparse.ArgumentParser) -> None:
    text = "smoke, laptop, study, released or paper (%(default)s)"
    parser.add_argument("--preset", default="laptop", metavar="NAME", help=text)
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        dest="changes",
        help="change one value of the preset, e.g. seeds=5 or pixels=64; may be given "
        "again",
    )
    _add_folder(parser, "data", "trajectories and checkpoints")
    _add_folder(parser, "results", "the results store")


def _add_folder(parser: argparse.ArgumentParser, name: str, text: str) -> None:
    text = f"{text} (%(default)s)"
    parser.add_argument(f"--{name}", default=name, metavar="DIR", help=text)


def _add_grid(
    parser: argparse.ArgumentParser,
    text: str = f"{', '.join(NAMES)} or all (%(default)s)",
    default: str | None = "3",
) -> None:
    add = parser.add_argument
    all_pairs = "only this one; all that are asked for unless given"
    add("--system", choices=PAIRS, help=all_pairs)
    add("--figure", default=default, help=text)
    sizes = "only these novice dataset sizes, minutes of motion"
    add("--minutes", type=float, nargs="+", help=sizes)
    add("--seeds", type=int, nargs="+", help="only these seeds")
    text = "only these methods: sidm, novice_only, ..."
    add("--methods", nargs="+", metavar="NAME", help=text)


def _add_steps(parser: argparse.ArgumentParser) -> None:
    text = "only these steps of the figure decisive, such as A1"
    parser.add_argument("--steps", nargs="+", metavar="STEP", help=text)


def _add_dask(parser: argparse.ArgumentParser) -> None:
    text = "work on a Dask cluster instead: its scheduler, tcp://HOST:PORT or a "
    text += "scheduler file"
    parser.add_argument("--dask", metavar="ADDRESS", help=text)


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
    """Carry out a command line, by default that of the process; give the exit status.

    Errors are one line on stderr.
    """
    return carry_out(build_parser(), arguments)


if __name__ == "__main__":
    sys.exit(main())
