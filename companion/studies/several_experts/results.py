"""What a novice needs when its SIDM learnt from several experts: tables and a figure from the records of `measure`."""

from __future__ import annotations

from typing import Any

import pandas as pd
from matplotlib.figure import Figure

from companion.engine.frame import of_trials
from companion.figures.style import (
    LOSS_LABEL,
    METHOD_STYLES,
    SIZE_STYLES,
    legend_below,
    mean_and_range,
)
from companion.statistics.claims import COLUMNS, judged
from companion.statistics.pairs import together
from companion.statistics.savings import with_savings
from companion.studies.several_experts.measure import WAYS
from sidm.plots import finish, side_by_side, styled

PAPER = "'may lead to a more accurate' one"
FASTER = "'may also lead to faster training'"
#: The lines of Figure 3's methods, with no SIDM that was learnt before: unlike the
#: experts'.
BESIDE: dict[str, dict[str, Any]] = {
    "novice_only": {
        "label": METHOD_STYLES["novice_only"]["label"],
        "color": "#555555",
        "linestyle": ":",
        "marker": "",
    },
    "sidm": {
        "label": "with SIDM, all at once",
        "color": "#555555",
        "linestyle": "-",
        "lw": 1,
        "marker": "",
    },
}
PAPERS, MEMBER = "the paper's expert", "1 of the family"  # the single experts


def label(number: int, paper: bool) -> str:
    """Of the experts that an SIDM learnt from, for figures and tables."""
    return f"{number} experts" if number > 1 else PAPERS if paper else MEMBER


def table(frame: pd.DataFrame) -> pd.DataFrame:
    """A line for each of the `experts` that an SIDM learnt from, way to go on, size of the novice's data and seed.

    With `number` of the experts, validation `loss`, `samples` seen by the novice's
    training with its patience, and the processor's `minutes` for it.
    """
    values = ["validation_loss", "samples", "found_seconds"]  # by way and size
    mine = of_trials(frame).assign(way=[list(WAYS)] * len(frame), number=frame.experts)
    mine["experts"] = [
        label(*one) for one in mine[["number", "paper"]].itertuples(index=False)
    ]
    long = mine.explode(["way", *values]).explode(["sizes", *values], ignore_index=True)
    names = {
        "sizes": "novice_minutes",
        "validation_loss": "loss",
        "samples": "samples",
        "found_seconds": "seconds",
    }
    found = long[["system", "experts", "number", "seed", "way", *names]].rename(
        columns=names
    )
    found = found.astype(dict.fromkeys(names.values(), float))
    order = found.experts.map({PAPERS: 0, MEMBER: 1}).fillna(found.number)
    found = found.assign(order=order, minutes=found.seconds / 60).sort_values(
        ["order", "seed"], kind="stable"
    )
    return found.drop(columns=["order", "seconds"]).reset_index(drop=True)


def needed(table: pd.DataFrame) -> pd.DataFrame:
    """A line for each experts, way and size: means, and how they stand beside the paper's expert alone.

    `seeds`, mean `loss`, `samples` and `minutes`; the `ratio` of the losses with `low`
    and `high`; and `saved`, `saved_low`, `saved_high` and `bound`: how many times the
    novice's data the paper's expert's SIDM needs.
    """
    point = ["system", "experts", "way", "novice_minutes"]
    found = table.groupby(point, sort=False)[["loss", "samples", "minutes"]].mean()
    found.insert(0, "seeds", table.groupby(point, sort=False).size())
    papers = table[table.experts == PAPERS]
    others = table[table.experts != PAPERS]
    return with_savings(
        found.reset_index(), others, papers, ["system", "way"], ["experts"]
    )


def as_they_are(frame: pd.DataFrame) -> pd.DataFrame:
    """A line a record and size: the `nearest` expert, and the validation `loss` with its parts as they are."""
    lines = []
    for one in of_trials(frame).itertuples():
        names = [
            *(["expert"] if one.paper else []),
            *(f"member{number}" for number in range(len(one.roles))),
        ]
        for minutes, role, losses in zip(
            one.sizes, one.nearest, one.before, strict=True
        ):
            lines.append(
                (
                    label(one.experts, one.paper),
                    one.seed,
                    minutes,
                    role,
                    losses[names.index(role)],
                )
            )
    return pd.DataFrame(
        lines, columns=["experts", "seed", "novice_minutes", "nearest", "loss"]
    )


def costs(joint: pd.DataFrame) -> pd.DataFrame:
    """The same means of Figure 3's methods, of which `joint` are results: a line a method and size."""
    found = (
        joint.assign(minutes=joint.seconds / 60)
        .groupby(["method", "novice_minutes"], sort=False)
        .agg(
            seeds=("seed", "size"),
            loss=("validation_loss", "mean"),
            samples=("samples", "mean"),
            minutes=("minutes", "mean"),
        )
        .reset_index()
    )
    return found[found.method.isin(list(BESIDE))]


def claims(table: pd.DataFrame, joint: pd.DataFrame) -> pd.DataFrame:
    """Whether the SIDM of most experts gives a smaller loss than that of one, and the novice a shorter training.

    The loss beside the paper's expert, and beside one of the family, which is as near
    to the novice as the others are, by way, the sizes together; the training of encoder
    and decoder alone beside that of all together with an SIDM that is not learnt
    before, of which `joint` are results.
    """
    most = table[(table.number == table.number.max()) & (table.number > 1)]
    if not len(most):
        return pd.DataFrame(columns=list(COLUMNS))
    name, parts = most.experts.iloc[0], []
    for way, words in WAYS.items():
        own = most[most.way == way]
        for single in (PAPERS, MEMBER):
            found = together(
                own,
                table[(table.experts == single) & (table.way == way)],
                by=["way"],
                value="loss",
            )
            parts.append(
                judged(found, f"loss after {name} / after {single}; {words}", PAPER)
            )
    alone = joint[joint.method == "sidm"]
    for way, words in WAYS.items():
        if way != "all":
            found = together(most[most.way == way], alone, by=["way"], value="samples")
            parts.append(
                judged(
                    found,
                    f"samples after {name} / with SIDM as in Figure 3; {words}",
                    FASTER,
                )
            )
    return pd.concat(parts, ignore_index=True)


@styled
def figure(table: pd.DataFrame, joint: pd.DataFrame) -> Figure:
    """Validation loss against the novice's data, a plot for each way to go on, a line for each number of experts.

    `joint`, results of Figure 3's methods on the same sizes, make lines for comparison.
    """
    figure, panels = side_by_side(len(WAYS))
    figure.set_size_inches(11.5, 4.2)
    for axes, (way, words) in zip(panels, WAYS.items(), strict=True):
        mine = table[table.way == way]
        if len(mine) and axes is not panels[0]:
            axes.sharey(panels[0])
        axes.set(
            xscale="log",
            yscale="log",
            xlabel="novice data (min)",
            title=words.replace(", ", ",\n"),
        )
        for experts, own in mine.groupby("experts", sort=False):
            losses = own.groupby("novice_minutes").loss.agg(["mean", "min", "max"])
            mean_and_range(axes, losses, label=experts, **_style(str(experts), own))
        for method, look in BESIDE.items() if len(mine) else ():
            means = (
                joint[joint.method == method]
                .groupby("novice_minutes")
                .validation_loss.mean()
            )
            axes.plot(means.index, means, **look)
        finish(axes, mine.novice_minutes, legend=False)
    panels[0].set_ylabel(LOSS_LABEL)
    legend_below(figure, panels)
    return figure


def _style(experts: str, own: pd.DataFrame) -> dict[str, Any]:
    """A line's look, the same whatever else is stored."""
    # 1, 2, 4, 8: one after the other
    number = 0 if experts == PAPERS else int(own.number.iloc[0]).bit_length()
    return SIZE_STYLES[number % len(SIZE_STYLES)]
