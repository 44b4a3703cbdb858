"""Tables and figures of how certain models are, and whether rightly so."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from companion.extensions.particles import LEVELS, QUANTILES
from companion.figures.style import (
    LOSS_BY_SIZE,
    METHOD_LABELS,
    METHOD_STYLES,
    legend_below,
    system_panels,
)
from companion.statistics.claims import claim_rows
from companion.statistics.pairs import interval_texts, paired_comparison
from ownrobot.plots import finish, styled
from sidm.drives import CONTROL_STEP, QUATERNION
from sidm.systems import PAPER_SYSTEMS

#: Whether a model is trained by likelihood -> how figures and tables say so.
WORDS = {True: "by likelihood", False: "deterministic"}
DATA = ["system", "novice_minutes", "method"]
#: Columns that identify a model, but for its seed.
POINT = [*DATA, "likelihood"]
#: Columns that identify a model -> their headings on a page.
HEADINGS = {
    "system": "system",
    "method": "method",
    "likelihood": "trained",
    "novice_minutes": "novice (min)",
}
#: Columns of the table of `coverage` after POINT.
COVERAGE = "level one_step least most rollout rollout_least rollout_most".split()
COVERAGE += ["width", "position"]


def table(frame: pd.DataFrame) -> pd.DataFrame:
    """Models by likelihood and their deterministic twins.

    A row per system, size, method and way of training: POINT, `seeds`; means of the
    `loss` of equation (1), the negative log-likelihood (NLL) `nll`, nats a step, and
    `constant`, the NLL about the same means with the best constant spread. For models
    by likelihood, also the mean `difference` between the NLL and the twin's, with the
    ends `low` and `high` of its interval, over seeds that are `pairs`.
    """
    constant = frame.component_losses.map(constant_spread)
    rows = frame.assign(loss=frame.validation_loss, constant=constant)
    groups = rows.groupby(POINT, sort=False)
    means = groups[["loss", "nll", "constant"]].mean()
    means.insert(0, "seeds", groups.size())
    likelihood = rows.likelihood.astype(bool)
    compared = paired_comparison(
        rows[likelihood],
        rows[~likelihood],
        on=DATA,
        by=["likelihood"],
        value="nll",
        difference=True,
    )
    compared = compared.rename(columns={"seeds": "pairs"})
    differences = compared[[*POINT, "difference", "low", "high", "pairs"]]
    return means.reset_index().merge(differences, how="left", on=POINT)


def constant_spread(component_losses: Sequence[float]) -> float:
    """The NLL about a model's means with the constant spread of the least NLL."""
    return float(0.5 * np.log(2 * math.pi * math.e * np.array(component_losses)).sum())


def coverage(frame: pd.DataFrame) -> pd.DataFrame:
    """Shares of actual values within the central intervals, means over seeds.

    A row per model and level: POINT, `level`; the share in `one_step`, mean over the 13
    components, with the `least` and the `most` of a component; the share after the
    `rollout`, mean over forward, sideways and heading, with `rollout_least` and
    `rollout_most`; the intervals' `width` (3,) after the rollout, m, m, rad; and the
    `position` error after the rollout, m.
    """
    rows = []
    for point, group in frame.groupby(POINT, sort=False):
        one_step = np.mean(group.coverage.tolist(), axis=0)  # (L, 13)
        rollout, width = (  # (L, 3) each, after the last step
            np.mean(steps.tolist(), axis=0)[:, -1]
            for steps in (group.steps_coverage, group.steps_width)
        )
        position = float(group.position_error.str[-1].mean())
        for number, level in enumerate(LEVELS):
            shares = []
            for inside in (one_step[number], rollout[number]):
                shares += [inside.mean(), inside.min(), inside.max()]
            rows.append((*point, level, *shares, width[number], position))
    return pd.DataFrame(rows, columns=[*POINT, *COVERAGE])


def quantiles(frame: pd.DataFrame) -> pd.DataFrame:
    """Quantiles of single steps' NLL, its `mean`, and the `mean` NLL of one component.

    The component `w` is that of the quaternion, which the others determine. A row per
    POINT has means over seeds.
    """
    values = {
        f"{level:.0%}": frame.nll_quantiles.str[number].astype(float)
        for number, level in enumerate(QUANTILES)
    }
    last = range(13)[QUATERNION][-1]
    values |= {"mean": frame.nll, "w": frame.component_nll.str[last].astype(float)}
    groups = frame.assign(**values).groupby(POINT, sort=False)
    return groups[[*values]].mean().reset_index()


def claims(table: pd.DataFrame) -> pd.DataFrame:
    """Claims that a transition is likelier under distributions than under the twin.

    There is a claim for each size with SIDM that has a pair of models.
    """
    sidm = table[(table.method == "sidm") & table.difference.notna()]
    sidm = sidm.assign(seeds=sidm.pairs.astype(int))
    claims = [
        f"NLL with distributions less the twin's, SIDM, {minutes:g} min"
        for minutes in sidm.novice_minutes
    ]
    return claim_rows(sidm, claims, "an alternative (section 3.2)", unit="nats")


def cost(table: pd.DataFrame) -> pd.Series:
    """Loss of each model's means by likelihood divided by its twin's."""
    likelihood = table.likelihood.astype(bool)
    pairs = table[likelihood].merge(table[~likelihood], on=DATA, suffixes=("", "_twin"))
    return pairs.loss / pairs.loss_twin


def likelihood_page(table: pd.DataFrame) -> pd.DataFrame:
    """A table made by `table` with the columns and headings of a page."""
    page = _in_words(table)[[*HEADINGS.values(), "seeds"]]
    columns = {
        "loss, eq. (1)": table.loss.map("{:.3f}".format),
        "NLL (nats)": table.nll.map("{:.2f}".format),
        "constant": table.constant.map("{:.2f}".format),
        "less the twin's NLL (95 % interval)": interval_texts(
            table[["difference", "low", "high"]], 2
        ),
    }
    return page.assign(**columns)


def coverage_page(table: pd.DataFrame) -> pd.DataFrame:
    """A table of `coverage` with the headings of a page, a row for each model."""
    widest = table[table.level == max(LEVELS)].reset_index(drop=True)
    page = _in_words(widest)[[*HEADINGS.values()]]
    for when, names in {"": COVERAGE[1:4], ", 2.5 s": COVERAGE[4:7]}.items():
        for level, group in table.groupby("level"):
            page[f"in {level:.0%}{when}"] = [
                f"{mean:.0%} ({least:.0%} to {most:.0%})"
                for mean, least, most in group[names].itertuples(index=False)
            ]
    page["90 % wide (m, m, rad)"] = [
        ", ".join(f"{width:.2g}" for width in widths) for widths in widest.width
    ]
    return page.assign(**{"position off (m)": widest.position})


def quantiles_page(table: pd.DataFrame) -> pd.DataFrame:
    """A table made by `quantiles` with the columns and headings of a page."""
    values = table.drop(columns=POINT).map("{:.1f}".format)
    words = _in_words(table)[[*HEADINGS.values()]]
    return words.join(values.rename(columns={"w": "of $w$ alone"}))


def latents_page(frame: pd.DataFrame) -> pd.DataFrame:
    """Spreads of the latents of each model by likelihood, as a table of a page."""
    rows = frame[frame.likelihood.astype(bool)]
    page = _in_words(rows)[["system", "method", "novice (min)", "seed"]]
    columns = {
        "encoder's spread": rows.latent_spread.str[0],
        "SIDM's spread": rows.latent_spread.str[1],
        "at the bound": [
            ", ".join(f"{share:.0%}" for share in shares) for shares in rows.quietest
        ],
    }
    return page.assign(**columns)


def _in_words(table: pd.DataFrame) -> pd.DataFrame:
    """A table with methods and ways of training in words, and HEADINGS."""
    words = table.likelihood.map(WORDS)
    shown = table.assign(method=table.method.map(METHOD_LABELS), likelihood=words)
    return shown.rename(columns=HEADINGS)


def _style(method: str, likelihood: bool) -> dict[str, Any]:
    """The style of a curve; the markers of a twin are hollow."""
    label = f"{METHOD_LABELS[method]}, {WORDS[likelihood]}"
    style = METHOD_STYLES[method] | {"label": label}
    return style if likelihood else style | {"mfc": "white", "linewidth": 1}


@styled
def figure(table: pd.DataFrame, systems: Sequence[str] = PAPER_SYSTEMS) -> Figure:
    """The loss of equation (1) of models by likelihood and of their twins, by size."""
    figure, plots = system_panels(table, systems, **LOSS_BY_SIZE)
    for axes, shown in plots:
        groups = shown.groupby(["method", "likelihood"], sort=False)
        for (method, likelihood), group in groups:
            style = _style(method, bool(likelihood))
            axes.plot(group.novice_minutes, group.loss, **style)
        finish(axes, shown.novice_minutes, legend=False)
    legend_below(figure, figure.axes)
    return figure


@styled
def coverage_figure(
    frame: pd.DataFrame, minutes: float, systems: Sequence[str] = PAPER_SYSTEMS
) -> Figure:
    """Shares of actual values within the particles' widest intervals along rollouts.

    The models have one size of novice data, in minutes.
    """
    axis: dict[str, Any] = dict(
        xlabel="time (s)", ylabel="share within the interval (-)", ylim=(0, 1)
    )
    rows = frame[frame.novice_minutes == minutes]
    level = max(LEVELS)
    figure, plots = system_panels(rows, systems, f"{{}}, {minutes:g} min", **axis)
    for axes, shown in plots:
        groups = shown.groupby(["method", "likelihood"], sort=False)
        for (method, likelihood), group in groups:
            # (K,), mean over seeds and directions
            shares = np.mean(group.steps_coverage.tolist(), axis=(0, -1))
            time = CONTROL_STEP * (1 + np.arange(shares.shape[1]))
            style = _style(method, bool(likelihood)) | {"ms": 4}
            axes.plot(time, shares[LEVELS.index(level)], **style)
        if len(shown):
            axes.axhline(level, color="0.5", lw=1, linestyle="-", marker="")
            text = f"{level:.0%} of cases should lie within"
            axes.text(2.5, level + 0.01, text, ha="right", va="bottom", fontsize=10)
        finish(axes, legend=False)
    legend_below(figure, figure.axes)
    return figure
