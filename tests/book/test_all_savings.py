"""The table of all savings: the numbers of the chapters that it stands beside."""

from pathlib import Path

import pytest

from companion import Results, Study
from companion.pages import all_savings
from companion.registry import grid
from companion.statistics import claims
from companion.studies.decisive import verdicts
from ownrobot.comparison.statistics import Interval

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def store():
    return Results(ROOT / "results")


@pytest.fixture(scope="module")
def table(store):
    return all_savings.table(store)


def test_a_row_is_named_once(table):
    assert not table.duplicated(["Settings", "Stopped by", "Pair"]).any()
    assert table.notna().all(axis=None)


def test_the_decisive_rows_are_the_verdicts(table, store):
    results = verdicts.results(Study("study", "data", store.folder), store)
    judged = verdicts.data_ratios(results).query("method == 'sidm' and value == value")
    texts = [
        Interval(*row[["value", "low", "high"]]).text(2) for _, row in judged.iterrows()
    ]
    shown = table[table["Stopped by"].isin([verdicts.RELEASED, verdicts.END])]
    shown = shown[shown.Settings != all_savings.MIXED]
    assert len(texts) >= 6 and sorted(shown["5 min"]) == sorted(texts)


def test_figure_3s_rows_are_the_claims(table, store):
    figure3 = store.frame(grid("study", "3", data="data", results=str(store.folder)))
    shown = table[table.Settings == "quick (Q)"].set_index("Pair")["5 min"]
    for system, label in (("system1", "system 1"), ("system2", "system 2")):
        row = claims.data_saving_claim(figure3, system).iloc[0]
        assert shown[label] == Interval(row.value, row.low, row.high).text(2)


def test_without_results_there_are_columns_and_no_rows(tmp_path):
    table = all_savings.table(Results(tmp_path))
    assert not len(table) and list(table.columns) == all_savings.COLUMNS
