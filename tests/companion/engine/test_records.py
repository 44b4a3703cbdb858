"""Records: which are stored, which are refused, and what one failure changes."""

from concurrent.futures import ThreadPoolExecutor

import pytest

from companion import Study, grid
from companion.engine.provenance import Provenance, record_provenance
from companion.engine.records import ProvenanceTimer, Records, key_of
from companion.numerics import versions
from companion.registry import MEASUREMENTS, NAMES, STUDIES, find
from sidm.config import ConfigError, config
from sidm.storage import write_record
from tests.companion.conftest import RESULTS


@config
class Question:
    """A number of minutes."""

    minutes: float


@config
class Answer:
    """A figure."""

    about: Question
    value: float
    provenance: Provenance


def answer(question: Question) -> Answer:
    """A third of the question; an error above a hundred or below zero."""
    if question.minutes < 0:
        raise ValueError("less than nothing")
    value = float("nan") if question.minutes > 100 else question.minutes / 3
    return Answer(
        about=question, value=value, provenance=record_provenance(1.0, 1, False)
    )


@pytest.fixture
def store(tmp_path):
    return Records(Answer, tmp_path, "answers", "make answers")


def answers(store, questions) -> int:
    with ThreadPoolExecutor(1) as executor:
        return store.run(questions, answer, executor, "answer", progress=False)


def test_figures_are_rounded_and_what_they_are_about_is_not(store):
    """A question of a third of a minute is found under its own key."""
    third = Question(minutes=1 / 3)
    store.put(answer(third))
    assert store.get(third).about == third
    assert store.get(third).value == 0.111111
    assert store.get(Question(minutes=0.333333)) is None


def test_one_failure_does_not_lose_the_others(store, capsys):
    """Each failure is a line, and still missing."""
    questions = [Question(minutes=minutes) for minutes in (3.0, -1.0, 200.0, 6.0)]
    assert answers(store, questions) == 2
    errors = capsys.readouterr().err
    assert "answer failed: less than nothing" in errors
    assert "a number is not finite" in errors
    assert [record.value for record in store.stored(questions)] == [1.0, 2.0]
    assert store.missing(questions) == questions[1:3]


def test_a_record_says_what_it_depends_on():
    made = ProvenanceTimer("driving", None, "data").done()
    assert made.numerics == versions("driving") and not made.stale
    assert {"simulation", "training", "driving"} < made.numerics.keys()
    assert made.seconds >= 0 and made.threads == 1 and made.digests == {}


def test_what_is_run_goes_by_its_name():
    assert len(set(NAMES)) == len(NAMES)
    assert find("3") is find("all") is find("components") is None  # grids
    assert grid("smoke", "components", "system1")  # a module of studies with trials
    assert find("driving") is STUDIES["driving"] and find("gap") is MEASUREMENTS["gap"]
    with pytest.raises(ConfigError, match="did you mean 'driving'?"):
        find("drivng")


@pytest.mark.parametrize("name", STUDIES)
def test_stored_records_are_found_under_their_keys(name):
    """Questions may gain fields.

    A field that older records lack must leave their keys as they are.
    """
    records = STUDIES[name].module.records(RESULTS)
    keys = {key_of(record.about) for record in records.all()}
    assert keys == set(records.keys()) != set()


@pytest.mark.parametrize("name", STUDIES)
def test_every_study_has_work_at_the_smallest_sizes(name, tmp_path):
    """Sizes above a preset's pool are left out."""
    study = Study("smoke")
    jobs = sum(STUDIES[name].jobs(study, None).values(), [])
    assert jobs and STUDIES[name].overview(study, None, tmp_path)[1] == len(set(jobs))


@pytest.mark.parametrize("name", [*STUDIES, *MEASUREMENTS])
def test_nothing_that_is_stored_is_stale(name):
    lines, _ = find(name).overview(Study("laptop"), None, RESULTS)
    stored = [line.endswith((": stored", "stale 0")) for line in lines]
    assert lines and all(stored), lines


def test_a_measurement_is_made_where_it_lacks_or_is_stale(tmp_path, monkeypatch):
    made = []

    def make(study, workers, data, results):
        made.append("gap")
        return {"found": {}}

    monkeypatch.setattr("companion.studies.simulated_gap.make", make)
    gap, study = MEASUREMENTS["gap"], Study("smoke")
    assert gap.overview(study, None, tmp_path)[1] == 1
    assert gap.run(study, None, 1, tmp_path, tmp_path) == 0 and len(made) == 1
    for made_by in ({"simulation": -1}, versions("free_struts")):
        write_record(tmp_path / "gap.json", {"numerics": made_by})
        assert gap.run(study, None, 1, tmp_path, tmp_path) == 0 and len(made) == 2
    (tmp_path / "gap.json").write_text("{")
    with pytest.raises(ConfigError, match="gap.json: damaged"):
        gap.run(study, None, 1, tmp_path, tmp_path)
