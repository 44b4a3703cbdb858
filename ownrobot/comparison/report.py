"""The report of a comparison: one HTML page that needs no other file."""

from __future__ import annotations

import html
import io
import string
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from ownrobot.fitting.errors import ONE_STEP, OPEN_LOOP
from ownrobot.fitting.splits import sessions_of
from ownrobot.replay.scene import drive_scene
from ownrobot.replay.viewer import View
from sidm import __version__
from sidm.config import counted
from sidm.drives import minutes_of
from sidm.storage import write_atomically

if TYPE_CHECKING:
    from ownrobot.comparison.result import Comparison

WORST = 10  # drives in the table of the largest losses


def write_report(comparison: Comparison, path: Path) -> None:
    """Write the report of a comparison, as `Comparison.report` does."""
    method = comparison.verdict.method
    seconds = {"seconds of a fit": comparison.table.seconds}
    template = resources.files(__package__).joinpath("report.html").read_text("utf-8")
    page = string.Template(template).substitute(
        sentence=html.escape(comparison.verdict.sentence),
        about=html.escape(_about(comparison)),
        methods=_table(comparison.intervals().assign(**seconds)),
        losses=_svg("losses_figure", comparison, "losses and learning curves"),
        components=_components_table(comparison),
        horizons=_horizons(comparison),
        method=html.escape(method),
        drives=_svg("drives_figure", comparison, "losses of single drives"),
        worst=_table(comparison.drive_losses(method).head(WORST)),
        repeats=_repeats_table(comparison),
        notes=_notes(comparison),
        replay=_replay(comparison),
        version=__version__,
    )
    write_atomically(path, lambda file: file.write(page.encode()))


def _about(comparison: Comparison) -> str:
    """What was compared, in one line."""
    plan, drives = comparison.plan, comparison.drives
    sessions = len(set(sessions_of(drives)))
    return (
        f"{counted(len(drives), 'drive')} of {counted(sessions, 'session')}, "
        f"{minutes_of(drives):.3g} min of body '{drives[0].body.name}'; "
        f"{plan.folds} folds over sessions, {plan.repeats} repeats"
    )


def _components_table(comparison: Comparison) -> str:
    """Errors of the components one step ahead, a row for each method."""
    rows = []
    for method in comparison.methods:
        errors = comparison.errors(method)
        steps = errors[errors.prediction == ONE_STEP]
        titles = [f"{n} [{u}]" for n, u in zip(steps.quantity, steps.unit, strict=True)]
        rows.append({"method": method} | dict(zip(titles, steps.rmse, strict=True)))
    return _table(pd.DataFrame(rows))


def _horizons(comparison: Comparison) -> str:
    """Figure of the open-loop errors; '' where drives are too short for them."""
    errors = comparison.errors(comparison.methods[0])
    if not (errors.prediction == OPEN_LOOP).any():
        return ""
    return _svg("horizons_figure", comparison, "open-loop errors")


def _repeats_table(comparison: Comparison) -> str:
    """Loss of each method in each repeat."""
    rows = [
        comparison.losses(method).reshape(comparison.plan.repeats, -1).mean(1)
        for method in comparison.methods
    ]
    titles = [f"repeat {number + 1}" for number in range(comparison.plan.repeats)]
    frame = pd.DataFrame(rows, columns=titles)
    frame.insert(0, "method", comparison.methods)
    return _table(frame)


def _notes(comparison: Comparison) -> str:
    """What was noted, as a list; '' where nothing was."""
    if not comparison.notes:
        return ""
    items = "".join(f"<li>{html.escape(note)}</li>" for note in comparison.notes)
    return f"<h2>Notes</h2><ul>{items}</ul>"


def _replay(comparison: Comparison) -> str:
    """The drive with the largest loss of the method to take, and its prediction."""
    if comparison.drives[0].body.pose == "none":
        return ""
    method = comparison.verdict.method
    worst = max(comparison.of(method), key=lambda result: result.worst.loss)
    drive = next(d for d in comparison.drives if d.name == worst.worst.drive)
    title = f"{drive.name}, and what {method} predicts from its start"
    scene = drive_scene(drive, path=worst.path, names=("the robot", method))
    view = View(scene, title)._repr_html_()
    return f"<h2>The worst drive</h2><p>{html.escape(title)}</p>{view}"


def _table(frame: pd.DataFrame) -> str:
    return frame.to_html(index=False, border=0, float_format="{:.3g}".format)


def _svg(name: str, comparison: Comparison, title: str) -> str:
    """A figure of `figures` as an image of the page; a line without Matplotlib."""
    try:
        from ownrobot.comparison import figures
    except ImportError:
        return f"<p>No figure of {title}: pip install 'sidm[plots]'.</p>"
    file = io.StringIO()
    getattr(figures, name)(comparison).savefig(
        file, format="svg", metadata={"Date": None}
    )
    image = file.getvalue()
    image = image[image.index("<svg") :]
    return f'<figure role="img" aria-label="{html.escape(title)}">{image}</figure>'
