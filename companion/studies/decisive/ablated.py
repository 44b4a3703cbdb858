"""p_e and the phases with recipe R: step E1, beside R's own trainings.

The page on claims has the rule. Losses are those of the lowest smoothed test loss up to
the cap of E1, or of what the released rule keeps until then.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from companion.engine.store import Results
from companion.figures.dots import CLOSEST, apart
from companion.figures.style import legend_below, system_label
from companion.statistics.claims import NO_VERDICT, NOT_SEEN, verdict
from companion.statistics.intervals import holm, p_values
from companion.statistics.pairs import pooled_comparison
from companion.statistics.stopping_rules import RULES, apply_rule
from companion.studies.ablations import values_of
from companion.studies.decisive.arms import (
    ABLATED,
    ABLATION_CAPS,
    FEW_SEEDS,
    OF_R,
    R_CAPS,
    ablations,
    arm,
    both_phases,
    restricted,
)
from companion.studies.decisive.verdicts import END, RELEASED
from companion.study import Study
from ownrobot.comparison.statistics import Interval
from ownrobot.plots import finish, side_by_side, styled

LABELS = {
    "p_expert": "$p_e$",
    "matching_iterations": "matching",
    "discriminator_iterations": "discriminator",
    "prediction_iterations": "prediction",
}
#: Columns of `phase_losses`.
PHASES = ["system", "iterations", "prediction", "matching", "accuracy", "unrest"]
TICKS = (0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2, 1.3, 1.5, 2.0)  # of ratios


def results(study: Study, store: Results) -> pd.DataFrame:
    """The stored trainings of E1 and R's own of the same size and seeds.

    They have columns `setting` and `value` for what was changed; '' and NaN for R's.
    """
    caps = restricted(R_CAPS, sidm=(5.0,))
    own = [
        trial
        for system in ABLATION_CAPS
        for trial in arm(study, "R", system, caps, FEW_SEEDS)
    ]
    frame = store.frame([*own, *ablations(study)], curves=True)
    frame = frame.assign(setting="", value=np.nan)
    for name in ABLATED:
        value = values_of(frame, name).astype(float)
        changed = value.ne(frame.system.map(OF_R[name])) & frame.setting.eq("")
        frame.loc[changed, "setting"] = name
        frame.loc[changed, "value"] = value[changed]
    return frame


def losses(frame: pd.DataFrame) -> pd.DataFrame:
    """The validation `loss` of each training of `results`, by each `rule`.

    A training that goes on beyond the cap is read as if it had ended there. The end is
    judged on all validation motion where the weights are those that were kept.
    """
    parts = []
    for (system, cap), name in itertools.product(
        ABLATION_CAPS.items(), (END, RELEASED)
    ):
        rule = RULES[name]
        kept = apply_rule(frame[frame.system == system], rule._replace(max_samples=cap))
        to_the_end = apply_rule(kept, rule).kept_samples
        whole = (name == END) & (kept.kept_samples == to_the_end)
        loss = kept.validation_loss.where(whole, kept.kept_validation)
        parts.append(kept.assign(rule=name, loss=loss))
    return pd.concat(parts)


def table(frame: pd.DataFrame) -> pd.DataFrame:
    """Losses with a setting of R changed over R's, paired by seed.

    A row per `system`, `setting`, `value` and `rule` that shares a seed with R: how
    many `seeds` pair it, the `ratio` with its ends `low` and `high`, the p-value
    `corrected` by Holm over the system's settings, and whether it `differs` by the
    rule. With fewer than FEWEST_SEEDS there is no interval; without all settings no
    p-value.
    """
    every, by, parts = losses(frame), ["rule", "setting", "value"], []
    for (system, _), group in every.groupby(["system", "rule"], sort=False):
        own = group.setting == ""
        ratios = pooled_comparison(group[~own], group[own], by, "loss").sort_values(by)
        p = p_values(ratios[["ratio", "low", "high"]], ratios.seeds)
        planned = [
            value
            for setting, values in ABLATED.items()
            for value in values
            if value != OF_R[setting][system]
        ]
        judged = len(p) == len(planned) and np.isfinite(p).all()
        parts.append(ratios.assign(corrected=holm(p) if judged else np.nan))
    if not parts:
        parts = [pooled_comparison(every, every, by, "loss").assign(corrected=np.nan)]
    table = pd.concat(parts, ignore_index=True)
    return table.assign(differs=table.corrected < 0.05)


def changed_to(table: pd.DataFrame, setting: str, value: float) -> pd.DataFrame:
    """The rows of `table`, or of `training_ratios`, of one changed setting of R."""
    return table[table.setting.eq(setting) & table.value.eq(value)]


def says_above(ratios: pd.DataFrame) -> list[str]:
    """The verdict of each row of `table` on the claim that its ratio lies above 1."""
    says = []
    for row in ratios.itertuples():
        estimate = Interval(row.ratio, row.low, row.high)
        known = verdict(estimate, 1.0) if row.corrected < 0.05 else NOT_SEEN
        says.append(NO_VERDICT if np.isnan(row.corrected) else known)
    return says


def training_ratios(frame: pd.DataFrame) -> pd.DataFrame:
    """Prediction losses on the novice's training data over R's, of `results`.

    The loss of a training is its mean over the second half, up to the cap. A row per
    `system`, `setting` and `value` that shares a seed with R: `seeds`, `ratio`, and the
    ends of its interval, `low` and `high`.
    """
    whole = frame[frame.test_spacing > 0]
    tests = (whole.system.map(ABLATION_CAPS) // whole.test_spacing).astype(int)
    seen = [x[:n] for x, n in zip(whole.every_training_loss, tests, strict=True)]
    every = whole.assign(loss=[np.mean(loss[len(loss) // 2 :]) for loss in seen])
    own = every.setting == ""
    by = ["setting", "value"]
    return pooled_comparison(every[~own], every[own], by, "loss")


def phase_losses(study: Study, store: Results) -> pd.DataFrame:
    """Losses of both phases over the second half of a training, of step E1 again.

    A row per stored training: `system`, `iterations` a phase, and the means of the
    `prediction` loss on the novice's training data, of the `matching` loss, equation
    (4), and of the discriminator's `accuracy`. The `unrest` is how much the logarithm
    of the prediction loss changes from one test to the next, as a standard deviation.
    """
    rows = []
    for row in store.frame(both_phases(study), curves=True).itertuples():
        matching, prediction = row.matching_iterations, row.prediction_iterations
        tests = slice(len(row.every_training_loss) // 2, None)
        losses, matched, accuracy = (
            np.array(values[tests], float)
            for values in (
                row.every_training_loss,
                row.every_matching_loss,
                row.every_discriminator_accuracy,
            )
        )
        rows.append(
            {
                "system": row.system,
                "iterations": f"{prediction} prediction, {matching} matching",
                "prediction": losses.mean(),
                "matching": matched.mean(),
                "accuracy": accuracy.mean(),
                "unrest": np.diff(np.log(losses)).std(),
            }
        )
    return pd.DataFrame(rows, columns=PHASES)


@styled
def figure(
    ratios: pd.DataFrame,
    quick: pd.DataFrame,
    systems: Sequence[str] = tuple(ABLATION_CAPS),
) -> Figure:
    """Ratios to the recipe's own loss, a dot for each value: a plot per system.

    A hollow mark stands at a recipe's own value.

    Args:
        ratios: rows of `table` of one rule.
        quick: the same columns for recipe Q: `system`, `setting`, `value`, `ratio`,
            `low`, `high`. Its own values have the ratio 1 and no interval.
        systems: plots of the figure.
    """
    own = [
        {"system": system, "setting": name, "value": value, "ratio": 1.0}
        for name, of in OF_R.items()
        for system, value in of.items()
        if len(ratios)
    ]
    released = pd.concat([ratios, pd.DataFrame(own)])
    figure, panels = side_by_side(len(systems), min(len(systems), 2))
    for axes, system in zip(panels, systems, strict=True):
        drawn = released[released.system == system], quick[quick.system == system]
        places = _places(pd.concat(drawn))
        looks = (("#0072B2", "o", "recipe R"), ("0.5", "s", "recipe Q"))
        for shown, beside, look in zip(drawn, (-0.14, 0.14), looks, strict=True):
            _draw(axes, shown, places, beside, *look)
        axes.set(xscale="log", xlabel="loss / that of the recipe")
        axes.set_title(system_label(system))
        if places:
            axes.axvline(1, color="0.5", lw=1, linestyle="-", marker="", zorder=0)
        finish(axes, legend=False)
        if places:
            texts = [f"{LABELS[name]} {round(value, 2):g}" for name, value in places]
            axes.set_yticks([*places.values()], texts)
            axes.set_ylim(max(places.values()) + 0.7, -0.7)
            ticks = apart(TICKS, axes.get_xlim(), CLOSEST * len(panels))
            axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    rows = max((len(axes.get_yticks()) for axes in panels), default=0)
    figure.set_figheight(max(3.0, 1.2 + 0.28 * rows))
    legend_below(figure, panels)
    return figure


def _places(shown: pd.DataFrame) -> dict[tuple[str, float], float]:
    """Setting and value -> place from above, settings with a gap between them."""
    places: dict[tuple[str, float], float] = {}
    at = 0.0
    for name in LABELS:
        for value in sorted(set(shown[shown.setting == name].value)):
            places[name, value] = at
            at += 1
        at += 0.6
    return places


def _draw(
    axes: Axes,
    shown: pd.DataFrame,
    places: dict[tuple[str, float], float],
    beside: float,
    colour: str,
    marker: str,
    label: str,
) -> None:
    """Draw ratios with their intervals at the places of their values."""
    keys = zip(shown.setting, shown.value, strict=True)
    heights = np.array([places.get(key, np.nan) for key in keys]) + beside
    is_own = (shown.ratio == 1).to_numpy()
    line: dict[str, Any] = {"color": colour, "marker": marker, "linestyle": ""}
    changed = shown[~is_own]
    if len(changed):
        reach = np.nan_to_num(
            [changed.ratio - changed.low, changed.high - changed.ratio]
        )
        axes.errorbar(
            changed.ratio, heights[~is_own], xerr=reach, capsize=3, label=label, **line
        )
    if is_own.any():
        axes.plot(shown.ratio[is_own], heights[is_own], mfc="white", **line)
