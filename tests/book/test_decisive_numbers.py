"""Numbers that pages quote of the decisive experiment."""

from pathlib import Path

import pytest

from companion import Results, Study
from companion.pages import decisive_numbers
from companion.studies.decisive import search, verdicts
from ownrobot.comparison.statistics import Interval

ROOT = Path(__file__).parents[2]
PUBLISHED = {
    "released-saving": ("R1", "system1"),
    "released-saving-2": ("R1", "system2"),
    "end-saving": ("R2", "system1"),
    "end-saving-2": ("R2", "system2"),
    "tuned-released": ("T1", "system1"),
    "tuned-saving": ("T2", "system1"),
}


def test_they_are_the_verdicts():
    store = Results(ROOT / "results")
    frame = verdicts.results(Study("study", "data", store.folder), store)
    judged = verdicts.verdicts(frame)
    judged = judged[judged.method == "sidm"].set_index(["verdict", "system"])
    texts = decisive_numbers.texts(frame)
    for name, where in PUBLISHED.items():
        row = judged.loc[[where]].iloc[0]
        assert texts[name] == Interval(row.value, row.low, row.high).text(2)
    assert "not run" not in texts.values()


@pytest.mark.parametrize("count", [0, 8])
def test_what_lacks_results_is_not_run(tmp_path, make_row, count):
    store, study = Results(tmp_path), Study("study", tmp_path, tmp_path)
    for trial in search.compare_units(study)[:count:3]:
        store.put(make_row(trial))
    frame = verdicts.results(study, store)
    assert {*decisive_numbers.texts(frame).values()} == {"not run"}
    units = store.frame(search.compare_units(study))
    assert {*decisive_numbers.unit_texts(units).values()} == {"not run"}
