"""The search of the trees' settings: draws, a search of a tiny study, what it chose."""

import numpy as np
import pytest

from companion.numerics import versions
from companion.studies import tree_search
from companion.studies.tree_search import best, draw, draws, read
from ownrobot.methods import boosting
from ownrobot.methods.boosting import Growth
from sidm.storage import read_record, write_record
from tests.companion.conftest import RESULTS


@pytest.fixture
def few(study, monkeypatch):
    """A search of two draws a method on the tiny study's motion."""

    def trial(study, seed):
        return study.trial("system1", "least_squares", 0.75, seed)

    monkeypatch.setattr(tree_search, "_trial", trial)
    monkeypatch.setattr(tree_search, "DRAWS", {"trees": 2, "trees_corrected": 2})
    monkeypatch.setattr(tree_search, "SEEDS", (0, 1))
    monkeypatch.setattr(tree_search, "ROUNDS", 50)
    monkeypatch.setattr(tree_search, "LEAVES", (3,))
    monkeypatch.setattr(tree_search, "BEFORE", (Growth(50, leaves=3),) * 2)
    return study


def test_draws_follow_the_number_of_knobs():
    found = draws()
    assert len(set(found)) == len(found) == 30
    for chosen in found:
        growths = [chosen.novice, *filter(None, [chosen.expert])]
        assert len(growths) == 1 + (chosen.method == "trees_corrected")
        for growth in growths:
            assert 0.02 <= growth.rate <= 0.3 and 5 <= growth.samples <= 100
            assert growth.leaves in tree_search.LEAVES
    rates = [chosen.novice.rate for chosen in found if chosen.number]
    assert len(set(rates)) > 20


def test_a_search_is_stored_and_read(few):
    tree_search.make(few, workers=1)
    stored = read_record(few.results / tree_search.NAME)
    assert stored["numerics"] == versions("fitting")
    assert len(stored["least_squares"]) == 2
    table = read(few.results)
    assert table.groupby("method").number.apply(set).tolist() == [{0, 1}, {0, 1}]
    logs = np.log(stored["trees"][1][1]) - np.log(stored["least_squares"])
    row = table[(table.method == "trees") & (table.number == 1)].iloc[0]
    assert row.score == pytest.approx(np.exp(logs.mean()))
    assert row.novice == draw("trees", 1).novice


def test_a_search_goes_on_where_it_was(few):
    """Draws that are kept are not searched again."""
    kept = few.data / "checkpoints" / tree_search.NAME
    done = {f"{chosen.method} {chosen.number}": [1.0, 2.0] for chosen in draws()[:-1]}
    write_record(kept, {"losses": done, "numerics": versions("fitting")})
    tree_search.make(few, workers=1)
    stored = read_record(few.results / tree_search.NAME)
    assert [losses for _, losses in stored["trees"]] == [[1.0, 2.0]] * 2
    assert stored["trees_corrected"][1][1] != [1.0, 2.0] and not kept.exists()


def test_the_lowest_score_is_chosen(tmp_path):
    def row(method, number, losses):
        chosen = draw(method, number)
        return [[list(g) for g in chosen[2:] if g is not None], losses]

    rows = {
        "trees": [row("trees", 0, [0.9, 1.8]), row("trees", 1, [0.5, 3.0])],
        "trees_corrected": [row("trees_corrected", n, [n + 1.0, 1.0]) for n in (0, 1)],
    }
    write_record(tmp_path / tree_search.NAME, rows | {"least_squares": [1.0, 2.0]})
    chosen = best(tmp_path)
    assert chosen["trees"].number == 1 and chosen["trees_corrected"].number == 0
    assert read(tmp_path).score.iloc[0] == pytest.approx(np.sqrt(0.75))


def test_trees_grow_with_what_the_search_chose():
    chosen = best(RESULTS)
    assert boosting.NOVICE == chosen["trees"].novice
    assert (boosting.CORRECTION, boosting.EXPERT) == chosen["trees_corrected"][2:]
