"""The library's commands: `sidm demo`, `fit`, `evaluate`, `predict` and `replay`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from sidm.command_line import AddCommand
from sidm.config import ConfigError, first_line, parse_changes

_DRIVES = "drives: a file, a ROS bag, or a folder of files"
TEST_SHARE = 0.25  # of the sessions, held out by `sidm fit`


def add_fitting(add: AddCommand) -> None:
    """Add the commands that fit a model and use it: fit, evaluate and predict."""
    text = (
        "Learn a robot from recorded drives. It can be interrupted; the same command "
        "resumes it."
    )
    fit = add("fit", run_fit, text)
    _add_fit_options(fit)
    text = "How well a fitted model predicts other drives, with a figure."
    evaluate = add("evaluate", run_evaluate, text)
    text = "What a fitted model predicts of drives, as CSV."
    predict = add("predict", run_predict, text)
    text = "topics of ROS bags that are read, where several could be meant (all)"
    for command in (fit, evaluate, predict):
        command.add_argument(
            "--topics", metavar="NAME", nargs="+", default=[], help=text
        )
    text = "folder of a model that 'sidm fit' made"
    for command in (evaluate, predict):
        command.add_argument("model", metavar="MODEL", help=text)
        command.add_argument("drives", metavar="PATH", help=_DRIVES)
    text = "file of the figure (evaluation.png in the model's folder)"
    evaluate.add_argument("--figure", metavar="FILE", help=text)
    text = "where to write (standard output)"
    predict.add_argument("--out", metavar="FILE", help=text)


def _add_fit_options(fit: argparse.ArgumentParser) -> None:
    """Add the options of `sidm fit` alone."""
    fit.add_argument("--novice", metavar="PATH", required=True, help=_DRIVES)
    text = "drives of another robot, whose motion is cheaper"
    fit.add_argument("--expert", metavar="PATH", help=text)
    text = "what the drives are made of, YAML"
    fit.add_argument("--body", metavar="FILE", required=True, help=text)
    text = "what the expert's drives are made of, YAML (as --body)"
    fit.add_argument("--expert-body", metavar="FILE", help=text)
    text = "sidm, novice_only, ... (sidm with an expert, novice_only without)"
    fit.add_argument("--method", help=text)
    text = (
        "drives of the robot that evaluate the model and that it does not learn from "
        "(a quarter of the novice's sessions; with few sessions, folds)"
    )
    fit.add_argument("--test", metavar="PATH", help=text)
    text = (
        "seed of the choice of drives, the initial weights and the batches "
        "(%(default)s)"
    )
    fit.add_argument("--seed", type=int, default=0, help=text)
    fit.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        dest="changes",
        help="one setting of networks or training, as hidden=64 or p_expert=0.5; "
        "may be given again",
    )
    fit.add_argument("--out", metavar="DIR", required=True, help="folder of the model")


def run_fit(arguments: argparse.Namespace) -> int:
    """Run `sidm fit`: it prints the fitted model and its loss on held-out drives."""
    from sidm.fitting.fit import fit

    model = fit(
        arguments.novice,
        arguments.expert,
        arguments.method,
        body=arguments.body,
        expert_body=arguments.expert_body,
        settings=parse_changes(arguments.changes),
        test=arguments.test or TEST_SHARE,
        seed=arguments.seed,
        out=arguments.out,
        topics=arguments.topics,
        progress=True,
    )
    print(
        f"{arguments.out}: {model.method}, from {model.minutes:.2g} min "
        f"in windows of {model.steps} steps"
    )
    if model.held_out:
        print(f"held out from learning: {model.held_out}")
    else:
        print(
            "there are too few drives to hold some out: judge the model by others, "
            "with --test or 'sidm evaluate'"
        )
    return 0


def run_evaluate(arguments: argparse.Namespace) -> int:
    """Run `sidm evaluate`: it prints the table of errors and draws their figure.

    It draws nothing where Matplotlib is not installed.
    """
    from sidm.fitting.model import load
    from sidm.recordings import read_drives

    model = load(arguments.model)
    drives = read_drives(arguments.drives, model.body, arguments.topics, held=True)
    table = model.evaluate(drives)
    print(f"{arguments.model}: {model.score(drives)}")
    print(_errors_text(table))
    try:
        from sidm.fitting.report import figure
    except ImportError:
        text = "note: no figure is drawn without Matplotlib: pip install 'sidm[plots]'"
        print(text, file=sys.stderr)
        return 0
    path = Path(arguments.figure or Path(arguments.model) / "evaluation.png")
    try:
        figure(table).savefig(path)
    except ValueError as error:  # Matplotlib does not know the type of file
        raise ConfigError(f"{path}: {first_line(error)}") from None
    print(f"figure: {path}")
    return 0


def _errors_text(table: Any) -> str:
    """The table of `Model.evaluate` as text, with the first and every fifth horizon."""
    rows = table[(table.horizon == 1) | (table.horizon % 5 == 0)]
    return rows.to_string(index=False, float_format="{:.3g}".format)


def run_predict(arguments: argparse.Namespace) -> int:
    """Run `sidm predict`: it writes the predictions as CSV."""
    from sidm.fitting.model import load
    from sidm.storage import write_atomically

    table = load(arguments.model).predict(arguments.drives, arguments.topics)
    text = table.to_csv(index=False, float_format="%.6g")
    if arguments.out:
        write_atomically(Path(arguments.out), lambda file: file.write(text.encode()))
    else:
        sys.stdout.write(text)
    return 0


def add_replay(add: AddCommand) -> None:
    """Add `sidm replay`."""
    text = "Make a page that shows a ride in three dimensions, with nothing to install."
    replay = add("replay", run_replay, text)
    text = "a scene that `sidm.replay.write_scene` wrote, or recorded drives"
    replay.add_argument("ride", metavar="PATH", help=text)
    text = "where to write the page"
    replay.add_argument("--html", metavar="FILE", required=True, help=text)
    text = "what recorded drives are made of, YAML (the paper's robots')"
    replay.add_argument("--body", metavar="FILE", help=text)
    text = "which of the drives, from 0 (%(default)s)"
    replay.add_argument("--drive", type=int, default=0, metavar="N", help=text)
    text = (
        "what a recorded robot looks like: rover, warthog, husky, or "
        "WHEELBASE,TRACK,RADIUS in m (rover for the paper's, else husky)"
    )
    replay.add_argument("--shape", metavar="NAME", help=text)
    replay.add_argument("--title", help="of the page (the file's name)")


def run_replay(arguments: argparse.Namespace) -> int:
    """Run `sidm replay`: it writes the page and prints where it is."""
    from sidm.replay.viewer import View

    path = Path(arguments.ride)
    View(_scene(path, arguments), arguments.title or path.name).write(arguments.html)
    print(f"{arguments.html}: open it in a browser")
    return 0


def _scene(path: Path, arguments: argparse.Namespace) -> Any:
    """The scene in a file, or the scene of one of the recorded drives in it."""
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
            pass  # The file may hold recorded drives; reading them finds other faults.
    body = read_body(arguments.body) if arguments.body else ROVER
    shape = arguments.shape or ("husky" if arguments.body else "rover")
    robot = SYSTEMS["system1"].novice if shape == "rover" else find_box(shape)
    drives = read_drives(path, body)
    if not 0 <= arguments.drive < len(drives):
        raise ConfigError(
            f"{path}: it has drives 0 to {len(drives) - 1}, not {arguments.drive}"
        )
    return drives_scene([drives[arguments.drive]], robot)


def add_demo(add: AddCommand) -> None:
    """Add `sidm demo`."""
    demo = add(
        "demo",
        run_demo,
        "A model of a real robot in half a minute, from drives that come with sidm.",
    )
    text = "folder of what is made (%(default)s)"
    demo.add_argument("--out", metavar="DIR", default="sidm-demo", help=text)


def run_demo(arguments: argparse.Namespace) -> int:
    """Run `sidm demo`: it prints the model, its errors and what to do next."""
    from sidm.demo import run

    demo = run(arguments.out)
    print(
        f"{demo.model}, {demo.training_drives} drives of a Warthog; "
        f"its errors on {demo.held_out_drives} others:"
    )
    print(_errors_text(demo.errors))
    print(f"model: {demo.page.parent / 'model'}")
    print(
        f"replay: {demo.page}; open it in a browser: "
        "the ghost is where the model says that the robot would be"
    )
    return 0
