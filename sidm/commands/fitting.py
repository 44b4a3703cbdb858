"""The commands that fit models and use them: fit, evaluate and predict."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from sidm.command_line import AddCommand
from sidm.commands.tables import errors_text
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
    from sidm.fitting.files import load
    from sidm.recordings import read_drives

    model = load(arguments.model)
    drives = read_drives(arguments.drives, model.body, arguments.topics, held=True)
    table = model.evaluate(drives)
    print(f"{arguments.model}: {model.score(drives)}")
    print(errors_text(table))
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


def run_predict(arguments: argparse.Namespace) -> int:
    """Run `sidm predict`: it writes the predictions as CSV."""
    from sidm.fitting.files import load
    from sidm.storage import write_atomically

    table = load(arguments.model).predict(arguments.drives, arguments.topics)
    text = table.to_csv(index=False, float_format="%.6g")
    if arguments.out:
        write_atomically(Path(arguments.out), lambda file: file.write(text.encode()))
    else:
        sys.stdout.write(text)
    return 0
