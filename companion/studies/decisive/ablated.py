"""p_e and the phases with recipe R: step E1, beside R's own trainings.

The page on claims has the rule. Losses are those of the lowest smoothed test loss up to
the cap of E1, or of what the released rule keeps until then.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from companion.engine.store import Results
from companion.figures.style import legend_below, system_label
from companion.statistics.intervals import holm, mean_ratio, p_value
from companion.statistics.stopping_rules import RULES, apply_rule
from companion.studies.decisive.arms import AT_FIVE, FEW_SEEDS, R_CAPS, arm, restricted
from companion.studies.decisive.further import ABLATED, ABLATION_CAPS, OF_R, ablations
from companion.studies.decisive.verdicts import END, RELEASED
from companion.study import Study
from sidm.plots import finish, side_by_side, styled

LABELS = {
    "p_expert": "$p_e$",
    "prediction_iterations": "prediction iterations a phase",
    "matching_iterations": "matching iterations a phase",
}
TICKS = (0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2, 1.3, 1.5, 2.0)  # of ratios
COLUMNS = (
    "system",
    "setting",
    "value",
    "rule",
    "seeds",
    "loss",
    "ratio",
    "low",
    "high",
    "corrected",
    "differs",
)


def results(study: Study, store: Results) -> pd.DataFrame:
    """The stored trainings of E1 and R's own of the same size and seeds.

    They have columns `setting` and `value` for what was changed; '' and NaN for R's.
    """
    caps = restricted(R_CAPS, {"sidm": AT_FIVE["sidm"]})
    own = [
        trial
        for system in ABLATION_CAPS
        for trial in arm(study, "R", system, caps, FEW_SEEDS)
    ]
    frame = store.frame([*own, *ablations(study)], curves=True)
    changed = [_changed(row) for row in frame.itertuples()]
    names, values = zip(*changed, strict=True) if changed else ((), ())
    return frame.assign(setting=list(names), value=np.array(values, float))


def _changed(row: Any) -> tuple[str, float]:
    """The setting of a training that is not R's, and its value."""
    for name in ABLATED:
        value = getattr(row, name)
        if name == "matching_iterations" and not row.regularise:
            value = 0
        if value != OF_R[name][row.system]:
            return name, value
    return "", np.nan


def losses(frame: pd.DataFrame) -> pd.DataFrame:
    """The validation `loss` of each training of `results`, by each `rule`.

    A training that goes on beyond the cap is read as if it had ended there. The end is
    judged on all validation motion where the weights are those that were kept.
    """
    parts = []
    for (system, name), rule in (
        ((system, name), RULES[name])
        for system in ABLATION_CAPS
        for name in (END, RELEASED)
    ):
        capped = rule._replace(max_samples=ABLATION_CAPS[system])
        kept = apply_rule(frame[frame.system == system], capped)
        to_the_end = apply_rule(kept, rule).kept_samples
        whole = (name == END) & (kept.kept_samples == to_the_end)
        loss = kept.validation_loss.where(whole, kept.kept_validation)
        parts.append(kept.assign(rule=name, loss=loss))
    return pd.concat(parts)


def table(frame: pd.DataFrame) -> pd.DataFrame:
    """Losses with a setting of R changed over R's, paired by seed.

    A row per `system`, `setting`, `value` and `rule` that shares a seed with R: how
    many `seeds` pair it, the mean `loss`, the `ratio` with its ends `low` and `high`,
    the p-value `corrected` by Holm over the system's settings, and whether it `differs`
    by the rule. With fewer than FEWEST_SEEDS there is no interval; without all settings
    no p-value.
    """
    rows = []
    every = losses(frame)
    for (system, rule), group in every.groupby(["system", "rule"], sort=False):
        reference = group[group.setting == ""].set_index("seed").loss
        made, tests = [], []
        for (setting, value), arms in group[group.setting != ""].groupby(
            ["setting", "value"]
        ):
            own = arms.set_index("seed").loss
            seeds = own.index.intersection(reference.index)
            if not len(seeds):
                continue
            pairs = own[seeds].to_numpy(), reference[seeds].to_numpy()
            ratio = mean_ratio(*pairs)
            tests.append(p_value(ratio, len(seeds)))
            made.append(
                (system, setting, value, rule, len(seeds), own[seeds].mean(), *ratio)
            )
        planned = sum(
            value != OF_R[setting][system]
            for setting, values in ABLATED.items()
            for value in values
        )
        judged = len(tests) == planned and bool(np.isfinite(tests).all())
        corrected = holm(np.array(tests)) if judged else np.full(len(tests), np.nan)
        rows += [
            (*row, p, bool(p < 0.05)) for row, p in zip(made, corrected, strict=True)
        ]
    return pd.DataFrame(rows, columns=list(COLUMNS))


@styled
def figure(
    ratios: pd.DataFrame,
    quick: pd.DataFrame | None = None,
    systems: Sequence[str] = tuple(ABLATION_CAPS),
) -> Figure:
    """Ratios to the recipe's own loss by one rule: a row a system, a column a setting.

    `quick` has the same columns for recipe Q, drawn beside them in grey: `system`,
    `setting`, `value`, `ratio`, `low`, `high`. Its own values have the ratio 1.
    """
    figure, panels = side_by_side(len(systems) * len(LABELS), len(LABELS))
    figure.set_size_inches(10.4, 3.2 * len(systems))
    for number, axes in enumerate(panels):
        row, column = divmod(number, len(LABELS))
        system, setting = systems[row], list(LABELS)[column]
        if column:
            axes.sharey(panels[row * len(LABELS)])
        values = sorted({*ABLATED[setting], OF_R[setting][system]})
        places = {value: float(place) for place, value in enumerate(values)}
        own = _of(ratios, system, setting)
        other = own[:0] if quick is None else _of(quick, system, setting)
        if len(own) or len(other):
            at = places[OF_R[setting][system]]
            axes.plot(at, 1.0, marker="o", color="#0072B2", label="as released (R)")
            _draw(axes, own, places, -0.08, "#0072B2", "o", None)
            _draw(axes, other, places, 0.12, "0.55", "s", "stopped early (Q)")
            axes.axhline(1, color="0.5", lw=1, linestyle="-", marker="", zorder=0)
        axes.set(yscale="log", xlabel=LABELS[setting], title=system_label(system))
        if not column:
            axes.set_ylabel("loss / that of the recipe")
        finish(axes, legend=False)
        if axes.has_data():
            axes.set_xticks(list(places.values()), [f"{value:g}" for value in places])
            axes.set_xlim(-0.5, len(places) - 0.5)
    for number, axes in enumerate(panels):
        if axes.has_data():
            low, high = axes.get_ylim()
            ticks = [tick for tick in TICKS if low <= tick <= high]
            axes.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
        axes.tick_params(labelleft=number % len(LABELS) == 0)
    legend_below(figure, panels)
    return figure


def _of(ratios: pd.DataFrame, system: str, setting: str) -> pd.DataFrame:
    return ratios[(ratios.system == system) & (ratios.setting == setting)]


def _draw(
    axes: Axes,
    shown: pd.DataFrame,
    places: dict[float, float],
    beside: float,
    colour: str,
    marker: str,
    label: str | None,
) -> None:
    """Draw ratios with their intervals at the places of their values."""
    shown = shown[shown.value.isin(list(places))]
    if not len(shown):
        return
    reach = np.nan_to_num([shown.ratio - shown.low, shown.high - shown.ratio])
    axes.errorbar(
        shown.value.map(places) + beside,
        shown.ratio,
        yerr=reach,
        color=colour,
        linestyle="",
        marker=marker,
        capsize=3,
        label=label,
    )
