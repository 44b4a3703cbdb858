"""How long to train: far past the preset's patience, on a small dataset.

The dataset is one that settings are chosen by, not one of a figure.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from companion.figures.style import METHOD_STYLES, mean_and_range
from companion.methods import ALL_RELEASED, COMPARED, METHODS, RELEASED
from companion.study import Study
from companion.trials import Trial
from sidm.config import replace
from sidm.plots import finish, side_by_side, styled

#: The paper's amount of expert motion, and novice motion that settings are chosen by.
MOTION: dict[str, Any] = {
    "expert_minutes": 500_000 / 600,
    "rollouts": 100,
    "tuning_pool_minutes": 60.0,
}
#: Training goes on until so many samples bring no lower test loss.
LONG: dict[str, Any] = {"patience": 2_500_000, "max_samples": 6_000_000}
MINUTES, SEEDS = (5.0,), 3
MANY_EXPERTS = 0.9  # p_e
#: Method -> minutes of novice data -> number of trials as the authors train. SIDM at
#: 5 min stands beside training without SIDM at 20.
RELEASED_SEEDS: dict[str, dict[float, int]] = {
    "sidm": {1.0: 1, 5.0: SEEDS, 20.0: 1, 60.0: 1},
    "novice_only": {1.0: 1, 5.0: SEEDS, 20.0: SEEDS, 60.0: 1},
}

#: Batches and learning rate of the authors' code; the test loss is taken after as many
#: samples as in this book's trainings.
RELEASED_PACE = dict(
    batch=2,
    discriminator_batch=2,
    matching_batch=2,
    learning_rate=1e-4,
    test_interval=100,
)

#: The two ways to train, as tables and figures name them.
BY_BOOK, BY_AUTHORS = "as this book trains, to the end", "as the authors train"


def trials(study: Study, system: str) -> list[Trial]:
    """The paper's methods trained for long as in this book, and as the authors train.

    SIDM is also trained for long at a p_e of MANY_EXPERTS.
    """
    long = study.with_preset(
        study.preset.replace(**MOTION).for_tuning().replace(**LONG)
    )
    sidm = long.preset.training_of(METHODS["sidm"], system)
    many_experts = replace(sidm, p_expert=MANY_EXPERTS)
    trials = []
    for seed in range(SEEDS):
        firsts = long.points(system, COMPARED, MINUTES, seeds=1)
        firsts += long.points(system, ["sidm"], MINUTES, many_experts, seeds=1)
        trials += [first.replace(seed=seed) for first in firsts]
    authors = long.changed(tuned=(), **RELEASED[ALL_RELEASED][0] | RELEASED_PACE)
    for method, sizes in RELEASED_SEEDS.items():
        for minutes, seeds in sizes.items():
            trials += authors.points(system, [method], [minutes], seeds=seeds)
    return trials


def _way_to_train(frame: pd.DataFrame) -> np.ndarray:
    """BY_AUTHORS or BY_BOOK for each result, told apart by the batch size."""
    return np.where(frame.batch == RELEASED_PACE["batch"], BY_AUTHORS, BY_BOOK)


def table(frame: pd.DataFrame) -> pd.DataFrame:
    """One row per trial: how it was `trained` (BY_BOOK or BY_AUTHORS) and its results.

    The results are losses, samples and iterations at the end of the training.
    """
    names = ["system", "method", "p_expert", "novice_minutes", "seed"]
    results = ["validation_loss", "best_test_loss", "samples", "iterations"]
    rows = frame[[*names, *results]].assign(trained=_way_to_train(frame))
    order = ["trained", "novice_minutes", "method", "p_expert", "seed"]
    return rows.sort_values(order).reset_index(drop=True)


def by_authors(frame: pd.DataFrame) -> pd.DataFrame:
    """The results of this grid's trainings as the authors train."""
    return frame[frame.batch == RELEASED_PACE["batch"]]


def curves(frame: pd.DataFrame) -> pd.DataFrame:
    """Validation losses along each training.

    Returns:
        One row per trial and test: `samples` seen and validation `loss`, equation (1).
    """
    names = ["system", "method", "p_expert", "novice_minutes", "seed", "batch"]
    components = ["component_samples", "component_validation"]
    long = frame[[*names, *components]].explode(components)
    long["trained"] = _way_to_train(long)
    losses = [float(np.sum(squares)) for squares in long.component_validation]
    long = long.assign(samples=long.component_samples.astype(float), loss=losses)
    return long.drop(columns=[*components, "batch"])


@styled
def figure(curves: pd.DataFrame, minutes: float = MINUTES[0]) -> Figure:
    """Validation loss along the training, one plot for each way to train.

    Lines are means over seeds; shades reach from the minimum to the maximum.

    Args:
        curves: made by `curves`.
        minutes: the size of the novice dataset.
    """
    figure, panels = side_by_side(2)
    rows = curves[
        (curves.novice_minutes == minutes) & (curves.p_expert != MANY_EXPERTS)
    ]
    for axes, trained in zip(panels, (BY_AUTHORS, BY_BOOK), strict=True):
        axes.set(xscale="log", yscale="log", title=trained)
        axes.set(xlabel="samples seen (control steps)", ylabel="validation loss")
        methods = rows[rows.trained == trained].groupby("method", sort=False)
        for method, points in methods:
            losses = points.groupby("samples").loss.agg(["mean", "min", "max", "size"])
            # only tests that all seeds reached
            losses = losses[losses["size"] == losses["size"].max()]
            mean_and_range(axes, losses, **METHOD_STYLES[method] | {"marker": ""})
    for axes in panels:
        if len(rows):
            highest = rows[rows.samples > 3e4].loss.max()
            axes.set_ylim(0.95 * rows.loss.min(), 1.05 * highest)
        finish(axes)
    return figure
