"""Every data ratio of an SIDM in this book, under all settings, side by side.

A data ratio is how many times the novice data training alone needs for an SIDM's loss.
"""

from __future__ import annotations

import itertools

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from companion.figures.dots import dot_plot
from companion.figures.style import system_label
from companion.methods import FOR_LITTLE
from companion.statistics import savings
from companion.statistics.stopping_rules import RULES
from companion.studies.decisive import verdicts
from companion.studies.decisive.length_curves import RECIPE_LABELS
from sidm.systems import PAPER_SYSTEMS

#: Chosen after the results: both losses of an SIDM are alike.
MIXED = "SIDM as released (R), rival tuned (T), chosen afterwards"
WORDS = (
    "Labelled dots with 95 % intervals, one plot for each pair of robots: how many "
    "times less data an SIDM with five minutes needs, as the paper says, and here by "
    "three recipes and their stopping rules. Most dots lie between 1 and the paper's."
)
#: Recipe and stopping rule of the figure's rows.
DRAWN = (("R", verdicts.RELEASED), ("R", verdicts.END), ("T", verdicts.END))
SIZES = (1.0, 5.0, 20.0)  # min of novice data
#: Recipes of the SIDM and of its rival in the decisive experiment, and stopping rules
#: -> settings in words.
SETTINGS = {
    ("R", "R", tuple(RULES)): RECIPE_LABELS["R"],
    ("T", "T", tuple(RULES)): RECIPE_LABELS["T"],
    ("R", "T", (verdicts.END,)): MIXED,
}
QUICK = RECIPE_LABELS["Q"]
QUICK_SETTINGS = {
    "sidm": QUICK,
    "sidm" + FOR_LITTLE: f"{QUICK}, tuned for little data",
}
OWN = "patience"  # stopping rule
COLUMNS = ["Settings", "Stopped by", "Pair"]
COLUMNS += [f"{size:g} min" for size in SIZES]


def table(decisive: pd.DataFrame, quick: pd.DataFrame) -> pd.DataFrame:
    """A row for each settings, stopping rule and pair of robots; a column a size.

    `decisive` has rows of `verdicts.results`, `quick` those of `savings.savings`.
    """
    rows: list[tuple] = []
    quick = quick.assign(text=savings.ratio_texts(quick))
    for method, settings in QUICK_SETTINGS.items():
        of_method = quick[quick.method == method]
        for system, found in of_method.groupby("system", sort=False):
            by_size = found.set_index("novice_minutes").text
            texts = [by_size.get(size, "-") for size in SIZES]
            rows.append((settings, OWN, system_label(str(system)), *texts))
    for (recipe, rival, rules), settings in SETTINGS.items():
        for rule, system in itertools.product(rules, PAPER_SYSTEMS):
            where = recipe, system, rule
            ratios = (
                verdicts.sidm_saving(decisive, *where, size, rival) for size in SIZES
            )
            texts = [ratio.text(2) for ratio in ratios]
            if set(texts) != {savings.NO_VALUE}:
                rows.append((settings, rule, system_label(system), *texts))
    return pd.DataFrame(rows, columns=COLUMNS)


def by_recipe(shown: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Rows of `table` by the letter of their recipe; of two recipes the latter.

    Settings that are the same in all rows are left out.
    """
    letter = shown.Settings.str.extract(r".*\((\w)\)", expand=False)
    parts = {recipe: shown[letter == recipe] for recipe in RECIPE_LABELS}
    return {
        recipe: rows if rows.Settings.nunique() > 1 else rows.drop(columns="Settings")
        for recipe, rows in parts.items()
    }


def figure(decisive: pd.DataFrame, quick: pd.DataFrame) -> Figure:
    """Data ratios of an SIDM with five minutes beside the paper's, as labelled dots.

    `decisive` has rows of `verdicts.results`, `quick` those of `savings.savings`.
    """
    rows = []
    sidm = quick[(quick.method == "sidm") & (quick.novice_minutes == verdicts.AT)]
    for system, paper in verdicts.PAPER.items():
        found = [("the paper", paper, np.nan, np.nan)]
        for recipe, rule in DRAWN:
            ratio = verdicts.sidm_saving(decisive, recipe, system, rule, verdicts.AT)
            name = f"{RECIPE_LABELS[recipe]}, rule: {rule}"
            found.append((name, ratio.value, ratio.low, ratio.high))
        own = sidm[(sidm.system == system) & (sidm.bound == "=")]
        ends = own[["ratio", "low", "high"]].itertuples(index=False)
        found += [(f"{QUICK}, rule: {OWN}", *values) for values in ends]
        rows += [(system_label(system), "", "sidm", *line) for line in found]
    names = ["panel", "group", "method", "row", "value", "low", "high"]
    dots = pd.DataFrame(rows, columns=names).dropna(subset="value")
    return dot_plot(dots, "data saved with five minutes (times)")
