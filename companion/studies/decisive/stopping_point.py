"""How long to train, to touch: the numbers behind a stopping point that moves.

The reader stops all trainings of a recipe after a number of samples or by a rule, and
sees what each training keeps, Figure 3 and the saving. book/static/stopping.js draws
this. Losses are rounded to a ten-thousandth; savings are those of `length_curves`
and `verdicts`.
"""

from __future__ import annotations

import base64
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from companion.figures.style import METHOD_STYLES, system_label
from companion.statistics.stopping_rules import (
    RULES,
    apply_rule,
    kept_after,
    stored_curve,
)
from companion.studies.decisive.length_curves import RECIPE_LABELS, lengths_of
from companion.studies.decisive.search import FIRST_SEED
from companion.studies.decisive.verdicts import AT, RELEASED, losses_by

SCALE = 10_000  # stored numbers in a unit of loss
DRAWN_TESTS = 160  # tests of a training that are drawn, evenly spread in its logarithm
DIGITS = 4  # of a saving


def packed(losses: Sequence[float]) -> str:
    """Losses as text: Base64 of 16-bit integers, least significant byte first.

    A loss above 6.5535 is stored as that.
    """
    numbers = np.clip(np.rint(np.asarray(losses) * SCALE), 0, 2**16 - 1)
    return base64.b64encode(numbers.astype("<u2").tobytes()).decode()


def drawn_tests(count: int) -> list[int]:
    """Which of `count` tests of a training are drawn, from 0."""
    if count == 0:
        return []
    return np.unique(
        np.geomspace(1, count, DRAWN_TESTS).round().astype(int) - 1
    ).tolist()


def training_contents(row: pd.Series, lengths: Sequence[int]) -> dict[str, Any]:
    """A training's curve, and what it keeps when it is stopped after each length.

    `tests` and their `spacing`, in samples; the `curve` of the validation loss at
    `drawn_tests`; after each length the `kept` validation loss, and the number of the
    test `at` which the kept weights were reached.
    """
    curve = stored_curve(row)
    shown = drawn_tests(len(curve.samples))
    kept = kept_after(curve, lengths)
    return {
        "method": row.method,
        "minutes": row.novice_minutes,
        "seed": int(row.seed),
        "spacing": int(row.test_spacing),
        "tests": len(curve.samples),
        "curve": packed([curve.validation_loss[test] for test in shown]),
        "kept": packed([curve.validation_loss[test] for test in kept]),
        "at": [test + 1 for test in kept],
    }


def rule_contents(group: pd.DataFrame, rule: str) -> list[list[float]]:
    """What a stopping rule keeps of each training of a group.

    The validation loss of the kept weights, as it is published; the samples at which
    they were reached, and those at which training ended.
    """
    kept, losses = apply_rule(group, RULES[rule]), losses_by(group, rule).loss
    return [
        [round(float(loss), DIGITS), int(samples), int(seen)]
        for loss, samples, seen in zip(
            losses, kept.kept_samples, kept.seen, strict=True
        )
    ]


def saving_contents(table: pd.DataFrame) -> dict[str, list[Any]]:
    """Ratios of `along_training` with their ends, by 'data 5', 'loss 1' and so on.

    What is unknown, or has no bound, is None.
    """

    def known(value: float) -> float | None:
        return float(f"{value:.{DIGITS}g}") if np.isfinite(value) else None

    return {
        f"{quantity} {minutes:g}": [
            [known(number) for number in (row.value, row.low, row.high)]
            for row in rows.itertuples()
        ]
        for (quantity, minutes), rows in table.groupby(["quantity", "minutes"])
    }


def recipe_contents(group: pd.DataFrame, saved: pd.DataFrame) -> dict[str, Any]:
    """All that the page needs of a recipe on a system."""
    lengths = lengths_of(group)
    recipe, system = group.recipe.iloc[0], system_label(group.system.iloc[0])
    return {
        "name": f"{system}, {RECIPE_LABELS[recipe]}",
        "id": f"{recipe}-{group.system.iloc[0]}",
        "system": system,
        "trainings": [training_contents(row, lengths) for _, row in group.iterrows()],
        "saving": saving_contents(saved[saved.rule == ""]),
        "rules": {
            rule: {
                "kept": rule_contents(group, rule),
                "samples": int(marked.samples.iloc[0]),
                "saving": saving_contents(marked),
                "bound": str(marked[marked.quantity == "data"].bound.iloc[0]),
            }
            for rule, marked in saved[saved.rule != ""].groupby("rule", sort=False)
        },
    }


def contents(
    frame: pd.DataFrame, search: pd.DataFrame, saved: pd.DataFrame
) -> dict[str, Any]:
    """All numbers of the page, as JSON types.

    `frame` has the rows of `verdicts.results`, `saved` is `along_training` of it,
    `search` has the trainings of the search on system 1.
    """
    recipes: list[dict[str, Any]] = []
    lengths: list[int] = []
    for (recipe, system), group in frame.groupby(["recipe", "system"], sort=False):
        if {"sidm", "novice_only"} <= set(group.method):
            rows = saved[(saved.recipe == recipe) & (saved.system == system)]
            recipes.append(recipe_contents(group, rows))
            lengths = max(lengths, lengths_of(group), key=len)
    draws = [
        training_contents(row, [min(length, row.max_samples) for length in lengths])
        | {
            "number": int(row.seed) - FIRST_SEED,
            "rate": row.learning_rate,
            "decay": row.weight_decay,
            "batch": int(row.batch),
        }
        for _, row in search.iterrows()
    ]
    counts = {len(row) for row in (*frame.every_test_loss, *search.every_test_loss)}
    return {
        "scale": SCALE,
        "drawn": {count: drawn_tests(count) for count in sorted(counts)},
        "minutes": AT,
        "opens": RELEASED,
        "lengths": lengths,
        "rules": list(RULES),
        "methods": {
            name: {key: METHOD_STYLES[name][key] for key in ("label", "color")}
            for name in dict.fromkeys([*frame.method, *search.method])
        },
        "recipes": recipes,
        "search": draws,
    }
