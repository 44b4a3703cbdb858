"""The commands that fit models and use them: fit, compare, evaluate and predict."""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ownrobot.command_line import AddCommand, parse_changes, whole_number
from ownrobot.commands.options import (
    DRIVES,
    add_model_options,
    add_robot_options,
    add_settings,
    methods_text,
    refuse_inputs,
    seconds,
)
from ownrobot.commands.tables import csv_text, errors_text, worst_text, write_csv
from sidm.config import ConfigError, first_line, hint

if TYPE_CHECKING:
    from ownrobot.fitting.model import Model
    from sidm.drives import Drive

TEST_SHARE = 0.25  # of the sessions, held out by `ownrobot fit`
MOST_WORKERS = 8
FIT_EXAMPLES = """\
  ownrobot fit --novice drives/ --body robot.yaml --out model
  ownrobot fit --novice mine.bag --expert others/ --body robot.yaml --method sidm \\
      --set p_expert=0.5 --out model"""
COMPARE_EXAMPLES = """\
  ownrobot compare drives/ --body robot.yaml
  ownrobot compare mine.bag --expert others/ --body robot.yaml \\
      --methods least_squares trees sidm --out comparison"""
EVALUATE_EXAMPLES = """\
  ownrobot evaluate model other_drives/
  ownrobot evaluate model drive.csv --csv errors.csv --figure errors.svg"""
PREDICT_EXAMPLES = """\
  ownrobot predict model drive.csv --out predicted.csv
  ownrobot predict model drive.csv --horizon 3s --every 10"""


def add_fit(add: AddCommand) -> None:
    """Add `ownrobot fit`."""
    text = (
        "Learn a robot from recorded drives. It can be interrupted; the same command "
        "resumes it."
    )
    fit = add("fit", run_fit, text, f"{FIT_EXAMPLES}\n\nmethods:\n{methods_text()}")
    fit.add_argument("--novice", metavar="PATH", nargs="+", required=True, help=DRIVES)
    add_robot_options(fit)
    text = "one of those below (%(default)s)"
    fit.add_argument("--method", default="least_squares", help=text)
    text = (
        "drives of the robot that evaluate the model and that it does not learn from "
        "(a quarter of the novice's sessions; with few sessions, folds)"
    )
    fit.add_argument("--test", metavar="PATH", nargs="+", help=text)
    text = (
        "seed of the choice of drives, the initial weights and the batches "
        "(%(default)s)"
    )
    fit.add_argument("--seed", type=int, default=0, help=text)
    text = (
        "one setting of networks or training, as hidden=64 or p_expert=0.5; may be "
        "given again"
    )
    add_settings(fit, text)
    text = "where networks are trained, as cpu or cuda (%(default)s)"
    fit.add_argument("--device", metavar="NAME", default="cpu", help=text)
    fit.add_argument("--out", metavar="DIR", required=True, help="folder of the model")
    text = "replace the model of a robot with another body in the folder"
    fit.add_argument("--force", action="store_true", help=text)


def add_compare(add: AddCommand) -> None:
    """Add `ownrobot compare`."""
    text = (
        "Which method suits a robot: each learns from a part of the sessions and is "
        "evaluated on the others. It can be interrupted; the same command resumes it."
    )
    examples = f"{COMPARE_EXAMPLES}\n\nmethods:\n{methods_text()}"
    compare = add("compare", run_compare, text, examples)
    compare.add_argument("drives", metavar="PATH", nargs="+", help=DRIVES)
    add_robot_options(compare)
    text = "methods that are compared (the usual ones that can learn these robots)"
    compare.add_argument("--methods", metavar="NAME", nargs="+", default=[], help=text)
    text = "parts of the sessions, each held out once (%(default)s)"
    number: dict[str, Any] = {"type": whole_number, "metavar": "N"}
    compare.add_argument("--folds", default=4, help=text, **number)
    text = "how often the sessions are divided anew, with another seed (%(default)s)"
    compare.add_argument("--repeats", default=3, help=text, **number)
    text = "seed of the first repeat (%(default)s)"
    compare.add_argument("--seed", type=int, default=0, help=text)
    text = "one setting of networks or training, as hidden=64; may be given again"
    add_settings(compare, text)
    workers = min(MOST_WORKERS, os.cpu_count() or 1)
    text = "processes that fit at the same time (%(default)s)"
    compare.add_argument("--workers", default=workers, help=text, **number)
    text = "folder of the tables, the report and unfinished work (%(default)s)"
    compare.add_argument("--out", metavar="DIR", default="comparison", help=text)


def add_evaluate(add: AddCommand) -> None:
    """Add `ownrobot evaluate`."""
    text = "How well a fitted model predicts other drives, with a figure."
    evaluate = add("evaluate", run_evaluate, text, EVALUATE_EXAMPLES)
    add_model_options(evaluate)
    text = "file of the figure (%(default)s)"
    evaluate.add_argument(
        "--figure", metavar="FILE", default="evaluation.png", help=text
    )
    text = "where to write all errors as CSV"
    evaluate.add_argument("--csv", metavar="FILE", help=text)
    text = "where to write the loss of each drive as CSV"
    evaluate.add_argument("--drives-csv", metavar="FILE", help=text)


def add_predict(add: AddCommand) -> None:
    """Add `ownrobot predict`."""
    text = "What a fitted model predicts of drives, as CSV."
    predict = add("predict", run_predict, text, PREDICT_EXAMPLES)
    add_model_options(predict)
    text = (
        "predict this long open loop, as 3s, each state from the predicted state "
        "before it (one step ahead, from each recorded state)"
    )
    predict.add_argument("--horizon", metavar="TIME", type=seconds, help=text)
    text = (
        "start an open-loop prediction at every Nth step, after the model has seen the "
        "steps before (at each drive's start alone, where there are none)"
    )
    predict.add_argument("--every", metavar="N", type=whole_number, help=text)
    text = "where to write (standard output)"
    predict.add_argument("--out", metavar="FILE", help=text)


def run_fit(arguments: argparse.Namespace) -> int:
    """Run `ownrobot fit`: print the fitted model and its loss on held-out drives."""
    from ownrobot.fitting.fit import fit

    names = (
        "novice expert method body expert_body seed out force topics skip_bad device"
    )
    model = fit(
        settings=parse_changes(arguments.changes),
        test=arguments.test or TEST_SHARE,
        **{name: getattr(arguments, name) for name in names.split()},
    )
    print(
        f"{arguments.out}: {model.method}, from {model.minutes:.3g} min "
        f"in windows of {model.steps} steps"
    )
    if model.held_out:
        print(f"held out from learning: {model.held_out}")
    else:
        print(
            "there are too few drives to hold some out: judge the model by others, "
            "with --test or 'ownrobot evaluate'"
        )
    return 0


def run_compare(arguments: argparse.Namespace) -> int:
    """Run `ownrobot compare`: print the table and the answer, and write the report."""
    from ownrobot.comparison.run import compare

    out = Path(arguments.out)
    if out.resolve() in {Path(path).resolve() for path in arguments.drives}:
        raise ConfigError(f"{out} is read, too; name another folder")
    if not arguments.out.strip() or (out.exists() and not out.is_dir()):
        raise ConfigError(f"'{out}' is no folder; name one for the comparison")
    if (out / "model.json").exists():
        raise ConfigError(f"{out} has a model; name another folder for the comparison")
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryFile(dir=out):
        pass  # before long work: the tables can be written
    names = "expert methods body expert_body folds repeats seed workers topics skip_bad"
    comparison = compare(
        arguments.drives,
        settings=parse_changes(arguments.changes),
        folder=out,
        **{name: getattr(arguments, name) for name in names.split()},
    )
    print(comparison.text())
    print(comparison.verdict.sentence)
    write_csv(str(out / "comparison.csv"), comparison.table)
    write_csv(str(out / "learning-curve.csv"), comparison.curve)
    comparison.report(out / "report.html")
    print(f"report: {out / 'report.html'}")
    return 0


def _model_and_drives(arguments: argparse.Namespace) -> tuple[Model, list[Drive]]:
    """The model that a command names, and the drives of its robot."""
    from ownrobot.fitting.model import load
    from ownrobot.recordings import read_drives

    reading = {"topics": arguments.topics, "skip_bad": arguments.skip_bad}
    model = load(arguments.model)
    return model, read_drives(
        arguments.drives, model.body, allow_constant=True, **reading
    )


def run_evaluate(arguments: argparse.Namespace) -> int:
    """Run `ownrobot evaluate`: print errors, and draw them if Matplotlib is there."""
    from sidm.storage import write_atomically

    outputs = arguments.figure, arguments.csv, arguments.drives_csv
    refuse_inputs(outputs, [*arguments.drives, arguments.model])
    kind = _figure_kind(Path(arguments.figure))
    model, drives = _model_and_drives(arguments)
    table, by_drive = model.evaluate(drives), model.evaluate_drives(drives)
    if arguments.csv:
        write_csv(arguments.csv, table)
    if arguments.drives_csv:
        write_csv(arguments.drives_csv, by_drive)
    if kind:
        from ownrobot.comparison.figures import errors_figure

        drawn = errors_figure(table)
        path = Path(arguments.figure).resolve()
        write_atomically(path, lambda file: drawn.savefig(file, format=kind))
    print(f"{arguments.model}: {model.score(drives)}")
    print(errors_text(table))
    print(worst_text(by_drive))
    if kind:
        print(f"figure: {arguments.figure}")
    return 0


def _figure_kind(path: Path) -> str:
    """The kind of a figure's file; '' where Matplotlib is missing."""
    try:
        from matplotlib.figure import Figure
    except ValueError as error:  # of the variable MPLBACKEND
        raise ConfigError(f"Matplotlib cannot draw: {first_line(error)}") from None
    except ImportError:
        text = "note: no figure is drawn without Matplotlib: pip install 'sidm[plots]'"
        print(text, file=sys.stderr)
        return ""
    kind = path.suffix.lstrip(".").lower() or "png"
    known = Figure().canvas.get_supported_filetypes()
    if kind not in known:
        raise ConfigError(f"{path}: no kind of figure; {hint(kind, known)}")
    return kind


def run_predict(arguments: argparse.Namespace) -> int:
    """Run `ownrobot predict`: it writes the predictions as CSV."""
    if arguments.every and arguments.horizon is None:
        raise ConfigError("--every is of open-loop predictions: give --horizon, too")
    refuse_inputs([arguments.out], [*arguments.drives, arguments.model])
    model, drives = _model_and_drives(arguments)
    table = model.predict(drives, horizon=arguments.horizon, every=arguments.every)
    if arguments.out:
        write_csv(arguments.out, table)
    else:
        print(csv_text(table), end="")
    return 0
