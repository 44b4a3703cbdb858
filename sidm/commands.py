"""The library's commands: `sidm fit`, `sidm evaluate`, `sidm predict` and `sidm replay`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from sidm.command_line import Adds
from sidm.config import ConfigError, changes, first_line

_DRIVES = "drives: a file, a ROS bag, or a folder of files"


def add_fitting(command: Adds) -> None:
    """Add what makes and asks a model of your own robot."""
    fit = command(
        "fit",
        run_fit,
        "Learn a robot from recorded drives; can be stopped and goes on.",
    )
    fit.add_argument("--novice", metavar="PATH", required=True, help=_DRIVES)
    fit.add_argument(
        "--expert",
        metavar="PATH",
        help="drives of another robot, whose motion is cheaper",
    )
    fit.add_argument(
        "--body",
        metavar="FILE",
        required=True,
        help="what the drives are made of, YAML",
    )
    fit.add_argument(
        "--expert-body",
        metavar="FILE",
        help="the same of the expert's (the novice's unless given)",
    )
    fit.add_argument(
        "--method",
        help="sidm, novice_only, ... (sidm with an expert, novice_only without)",
    )
    fit.add_argument(
        "--seed",
        type=int,
        default=0,
        help="of choice, weights and batches (%(default)s)",
    )
    fit.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        dest="changes",
        help="one setting of networks or training, as hidden=64 or p_expert=0.5; may be given again",
    )
    fit.add_argument("--out", metavar="DIR", required=True, help="folder of the model")
    evaluate = command(
        "evaluate",
        run_evaluate,
        "How well a fitted model predicts other drives, with a figure.",
    )
    predict = command(
        "predict", run_predict, "What a fitted model predicts of drives, as CSV."
    )
    for one in (fit, evaluate, predict):
        words = "topics of ROS bags that are read, where several could be meant (all)"
        one.add_argument("--topics", metavar="NAME", nargs="+", default=[], help=words)
    for one in (evaluate, predict):
        one.add_argument(
            "model", metavar="MODEL", help="folder of a model that 'sidm fit' made"
        )
        one.add_argument("drives", metavar="PATH", help=_DRIVES)
    evaluate.add_argument(
        "--figure",
        metavar="FILE",
        help="of the report (evaluation.png in the model's folder)",
    )
    predict.add_argument(
        "--out", metavar="FILE", help="where to write (standard output)"
    )


def run_fit(arguments: argparse.Namespace) -> int:
    """`fit`: a line of what was learnt."""
    from sidm.fitting.fit import fit

    model = fit(
        arguments.novice,
        arguments.expert,
        arguments.method,
        body=arguments.body,
        expert_body=arguments.expert_body,
        settings=changes(arguments.changes),
        seed=arguments.seed,
        out=arguments.out,
        topics=arguments.topics,
        progress=True,
    )
    print(
        f"{arguments.out}: {model.method}, from {model.minutes:.2g} min in windows of {model.steps} steps; "
        f"test loss {model.test_loss:.3g}, where predicting the mean costs {model.mean_loss:.3g}"
    )
    return 0


def run_evaluate(arguments: argparse.Namespace) -> int:
    """`evaluate`: the table, and its figure where Matplotlib is installed."""
    from sidm.fitting.model import load

    table = load(arguments.model).evaluate(arguments.drives, arguments.topics)
    print(shown(table))
    try:
        from sidm.fitting.report import figure
    except ImportError:
        print(
            "note: no figure is drawn without Matplotlib: pip install 'sidm[plots]'",
            file=sys.stderr,
        )
        return 0
    path = Path(arguments.figure or Path(arguments.model) / "evaluation.png")
    try:
        figure(table).savefig(path)
    except ValueError as error:  # another kind of file than there are
        raise ConfigError(f"{path}: {first_line(error)}") from None
    print(f"figure: {path}")
    return 0


def shown(table: Any) -> str:
    """The table of `evaluate` for people: of horizons every fifth."""
    some = table[(table.horizon == 1) | (table.horizon % 5 == 0)]
    return some.to_string(index=False, float_format="{:.3g}".format)


def run_predict(arguments: argparse.Namespace) -> int:
    """`predict`: CSV."""
    from sidm.fitting.model import load
    from sidm.storage import write_atomically

    table = load(arguments.model).predict(arguments.drives, arguments.topics)
    text = table.to_csv(index=False, float_format="%.6g")
    if arguments.out:
        write_atomically(Path(arguments.out), lambda file: file.write(text.encode()))
    else:
        sys.stdout.write(text)
    return 0


def add_replay(command: Adds) -> None:
    """Add it to a command line."""
    made = command(
        "replay",
        run_replay,
        "Make a page that shows a ride in three dimensions, with nothing to install.",
    )
    made.add_argument(
        "ride",
        metavar="PATH",
        help="a scene that `sidm.replay.write_scene` wrote, or recorded drives",
    )
    made.add_argument(
        "--html", metavar="FILE", required=True, help="where to write the page"
    )
    made.add_argument(
        "--body",
        metavar="FILE",
        help="what recorded drives are made of, YAML (the paper's robots')",
    )
    made.add_argument(
        "--drive",
        type=int,
        default=0,
        metavar="N",
        help="which of the drives, from 0 (%(default)s)",
    )
    words = "what a recorded robot looks like: rover, warthog, husky, or WHEELBASE,TRACK,RADIUS in m"
    made.add_argument(
        "--shape", metavar="NAME", help=f"{words} (rover for the paper's, else husky)"
    )
    made.add_argument("--title", help="of the page (the file's name)")


def add_demo(command: Adds) -> None:
    """Add it to a command line."""
    made = command(
        "demo",
        run_demo,
        "A model of a real robot in half a minute, from drives that come with sidm.",
    )
    made.add_argument(
        "--out",
        metavar="DIR",
        default="sidm-demo",
        help="folder of what is made (%(default)s)",
    )


def run_demo(arguments: argparse.Namespace) -> int:
    """`demo`: what was learnt, how well, and what to do next."""
    from sidm.demo import run

    made = run(arguments.out)
    print(
        f"{made.model}, {made.learnt} drives of a Warthog; its errors on {made.judged} others:"
    )
    print(shown(made.errors))
    print(f"model: {made.page.parent / 'model'}")
    print(
        f"replay: {made.page}; open it in a browser: the ghost is where the model says that the robot would be"
    )
    return 0


def run_replay(arguments: argparse.Namespace) -> int:
    """`replay`: prints where the page is."""
    from sidm.replay.viewer import View

    path = Path(arguments.ride)
    View(_scene(path, arguments), arguments.title or path.name).write(arguments.html)
    print(f"{arguments.html}: open it in a browser")
    return 0


def _scene(path: Path, arguments: argparse.Namespace) -> Any:
    from sidm.body import ROVER, read_body
    from sidm.recordings import read_drives
    from sidm.replay.scene import drives_scene
    from sidm.replay.scene_file import read_scene
    from sidm.replay.skeleton import find_box
    from sidm.storage import Damaged
    from sidm.systems import SYSTEMS

    if path.suffix == ".npz" and not arguments.body:
        try:
            return read_scene(path)
        except Damaged:
            pass  # recorded drives, then, which says what else is wrong
    body = read_body(arguments.body) if arguments.body else ROVER
    shape = arguments.shape or ("husky" if arguments.body else "rover")
    like = SYSTEMS["system1"].novice if shape == "rover" else find_box(shape)
    drives = read_drives(path, body)
    if not 0 <= arguments.drive < len(drives):
        raise ConfigError(
            f"{path}: it has drives 0 to {len(drives) - 1}, not {arguments.drive}"
        )
    return drives_scene([drives[arguments.drive]], like)
