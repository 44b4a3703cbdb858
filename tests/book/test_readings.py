"""Readings of the paper's statements: made-up results both ways, and the book's."""

from pathlib import Path

import pandas as pd
import pytest

from companion import Results, Study
from companion.pages import readings
from companion.statistics.claims import CONTRARY, DIRECTION, NOT_SEEN
from companion.studies.decisive import verdicts

ROOT = Path(__file__).parents[2]


def losses(method, factor, **columns):
    """Losses of three seeds on system 1 with 5 minutes."""
    return pd.DataFrame(
        {
            "system": "system1",
            "method": method,
            "novice_minutes": 5.0,
            "seed": range(3),
            "validation_loss": [factor, 1.02 * factor, 0.99 * factor],
        }
        | columns
    )


@pytest.mark.parametrize(
    ("tuned", "kept", "core", "verdict"),
    [
        (0.5, 0.6, 0.7, [CONTRARY] * 4),
        (2.0, 1.5, 1.2, [DIRECTION] * 4),
        (1.0, 1.0, 1.0, [NOT_SEEN] * 4),
    ],
)
def test_pretraining_has_three_readings(tuned, kept, core, verdict):
    baselines = pd.concat(
        [
            losses("sidm", 1.0),
            losses("pretrain_finetune", tuned),
            losses("finetune_parts", kept),
        ]
    )
    bodies = pd.concat(
        losses(method, factor * scale, novice_body=body, novice_minutes=minutes)
        for method, factor in (("sidm", 1.0), ("core_finetune", core))
        for body, scale in (("no map", 1.0), ("planar", 3.0))
        for minutes in (1.0, 5.0)
    )
    rows = readings.pretraining(baselines, bodies)
    assert [row.verdict for row in rows] == verdict
    assert len({row.reading for row in rows}) == 4  # the narrowest at two sizes
    assert [row.reading.startswith("SIDM alone") for row in rows] == [True] * 2 + [
        False
    ] * 2


def test_the_books_readings_are_those_of_its_parts():
    store = Results(ROOT / "results")
    rows = readings.readings(store, "data")
    table = pd.DataFrame(rows)
    assert not table.duplicated(["statement", "reading", "system"]).any()
    judged = verdicts.verdicts(
        verdicts.results(Study("study", "data", ROOT / "results"), store)
    )
    first = judged[(judged.verdict == "R1") & (judged.system == "system1")].iloc[0]
    assert rows[0].verdict == first.says and f"{first.value:.1f}" in rows[0].ours
    assert len(readings.page_table(rows)) == len(rows) > 9


def test_without_results_there_are_no_readings(tmp_path):
    rows = readings.readings(Results(tmp_path), str(tmp_path))
    assert rows == []
