"""How long to train: far past the preset's patience, on a small dataset that settings are chosen by."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from companion.figures.style import LOSS_BY_SIZE, METHOD_STYLES, mean_and_range
from companion.methods import ALL_RELEASED, COMPARED, METHODS, RELEASED
from companion.study import Study
from companion.trials import Trial
from sidm.config import replace
from sidm.plots import finish, side_by_side, styled

#: The paper's motion of the expert, and motion of the novice that settings are chosen
#: by.
MOTION: dict[str, Any] = {
    "expert_minutes": 500_000 / 600,
    "rollouts": 100,
    "tuning_pool_minutes": 60.0,
}
#: Until so many samples bring no lower test loss.
LONG: dict[str, Any] = {"patience": 2_500_000, "max_samples": 6_000_000}
MINUTES, SEEDS = (5.0,), 3
MANY_EXPERTS = 0.9  # p_e
#: Method -> minutes of novice data -> trials as the authors train. An SIDM at 5 min
#: stands beside training alone at 20.
RELEASED_SEEDS: dict[str, dict[float, int]] = {
    "sidm": {1.0: 1, 5.0: SEEDS, 20.0: 1, 60.0: 1},
    "novice_only": {1.0: 1, 5.0: SEEDS, 20.0: SEEDS, 60.0: 1},
}

#: Batches and rate of the authors' code, with a test as often in samples as ours.
RELEASED_PACE = dict(
    batch=2,
    discriminator_batch=2,
    matching_batch=2,
    learning_rate=1e-4,
    test_interval=100,
)


def trials(study: Study, system: str) -> list[Trial]:
    """The paper's methods, with SIDM also at a p_e of MANY_EXPERTS, and as the authors train them."""
    long = study.of(study.preset.replace(**MOTION).for_tuning().replace(**LONG))
    more = replace(
        long.preset.training_of(METHODS["sidm"], system), p_expert=MANY_EXPERTS
    )
    found = []
    for seed in range(SEEDS):
        firsts = long.points(system, COMPARED, MINUTES, seeds=1)
        firsts += long.points(system, ["sidm"], MINUTES, more, seeds=1)
        found += [first.replace(seed=seed) for first in firsts]
    theirs = long.changed(tuned=(), **RELEASED[ALL_RELEASED][0] | RELEASED_PACE)
    for method, sizes in RELEASED_SEEDS.items():
        for minutes, seeds in sizes.items():
            found += theirs.points(system, [method], [minutes], seeds=seeds)
    return found


OURS, THEIRS = "as this book trains, to the end", "as the authors train"


def table(frame: pd.DataFrame) -> pd.DataFrame:
    """A line a trial: `trained`, OURS or THEIRS, and where it ended: losses, samples and iterations."""
    names = ["system", "method", "p_expert", "novice_minutes", "seed"]
    ends = ["validation_loss", "best_test_loss", "samples", "iterations"]
    trained = np.where(frame.batch == RELEASED_PACE["batch"], THEIRS, OURS)
    found = frame[[*names, *ends]].assign(trained=trained)
    return found.sort_values(
        ["trained", "novice_minutes", "method", "p_expert", "seed"]
    ).reset_index(drop=True)


def theirs(frame: pd.DataFrame) -> pd.DataFrame:
    """Of this grid's results those of trainings as the authors train."""
    return frame[frame.batch == RELEASED_PACE["batch"]]


def curves(frame: pd.DataFrame) -> pd.DataFrame:
    """A line a trial and test along its training: `samples` and validation `loss`, equation (1)."""
    names = ["system", "method", "p_expert", "novice_minutes", "seed", "batch"]
    long = frame[[*names, "component_samples", "component_validation"]].explode(
        ["component_samples", "component_validation"]
    )
    long["trained"] = np.where(long.batch == RELEASED_PACE["batch"], THEIRS, OURS)
    losses = [float(np.sum(one)) for one in long.component_validation]
    return long.assign(samples=long.component_samples.astype(float), loss=losses).drop(
        columns=["component_samples", "component_validation", "batch"]
    )


@styled
def figure(curves: pd.DataFrame, minutes: float = MINUTES[0]) -> Figure:
    """Validation loss along the training, a plot a way to train: lines are means over seeds, shades their range."""
    figure, panels = side_by_side(2)
    mine = curves[
        (curves.novice_minutes == minutes) & (curves.p_expert != MANY_EXPERTS)
    ]
    for axes, trained in zip(panels, (THEIRS, OURS), strict=True):
        axes.set(xscale="log", yscale="log", title=trained)
        axes.set(xlabel="samples seen (control steps)", ylabel="validation loss")
        for method, some in mine[mine.trained == trained].groupby("method", sort=False):
            points = some.groupby("samples").loss.agg(["mean", "min", "max", "size"])
            # which all seeds came to
            points = points[points["size"] == points["size"].max()]
            mean_and_range(axes, points, **METHOD_STYLES[method] | {"marker": ""})
    if len(mine):
        for axes in panels:
            axes.set_ylim(
                0.95 * mine.loss.min(), 1.05 * mine[mine.samples > 3e4].loss.max()
            )
    for axes in panels:
        finish(axes)
    return figure


@styled
def by_size(frame: pd.DataFrame, figure3: pd.DataFrame) -> Figure:
    """Validation loss by novice data as the authors train, beside Figure 3's: means over seeds, shades their range."""
    figure, panels = side_by_side(2)
    for axes, some, title in zip(
        panels, (theirs(frame), figure3), (THEIRS, "as in Figure 3"), strict=True
    ):
        axes.set(title=title, **LOSS_BY_SIZE)
        for method, mine in some[some.method.isin(COMPARED)].groupby(
            "method", sort=False
        ):
            losses = mine.groupby("novice_minutes").validation_loss.agg(
                ["mean", "min", "max"]
            )
            mean_and_range(axes, losses, **METHOD_STYLES[method])
        finish(axes, some.novice_minutes.unique())
    ends = [end for axes in panels if axes.has_data() for end in axes.get_ylim()]
    for axes in panels:
        axes.set_ylim(min(ends, default=None), max(ends, default=None))
    return figure
