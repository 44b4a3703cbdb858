"""Records: what is kept, what is refused, and what goes on when one fails."""

from concurrent.futures import ThreadPoolExecutor

import pytest

from companion import Study
from companion.catalogue import STUDIES, find_study
from companion.engine.provenance import Provenance, here
from companion.engine.records import Making, Records, key_of
from companion.numerics import versions
from sidm.config import ConfigError, config
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
    """A third of it; none for more than a hundred, and none at all for less than nothing."""
    if question.minutes < 0:
        raise ValueError("less than nothing")
    value = float("nan") if question.minutes > 100 else question.minutes / 3
    return Answer(about=question, value=value, provenance=here(1.0, 1, False))


@pytest.fixture
def store(tmp_path):
    return Records(Answer, tmp_path / "answers", "make answers")


def test_figures_are_rounded_and_what_they_are_about_is_not(store):
    """A third of a minute is found again under its own key."""
    third = Question(minutes=1 / 3)
    store.put(answer(third))
    assert store.get(third).about == third and store.get(third).value == pytest.approx(1 / 9, rel=1e-5)
    assert store.get(third).value != 1 / 9 and store.get(Question(minutes=0.333333)) is None
    assert key_of(third) != key_of(Question(minutes=0.333333))


def test_one_failure_does_not_lose_the_others(store, capsys):
    """Each is a line; what is stored is not made again."""
    questions = [Question(minutes=minutes) for minutes in (1.0, -1.0, 200.0, 2.0)]
    with ThreadPoolExecutor(1) as executor:
        assert store.run(questions, answer, executor, "answer", progress=False) == 2
        said = capsys.readouterr().err
        assert "answer failed: less than nothing" in said and "a number is not finite" in said
        assert [one.value for one in store.stored(questions)] == pytest.approx([1 / 3, 2 / 3], rel=1e-5)
        assert store.run(questions[:1], None, executor, "answer", progress=False) == 0


def test_a_record_says_what_it_depends_on():
    made = Making("driving", None, "data").done()
    assert made.numerics == versions("driving") and {"simulation", "training", "driving"} < made.numerics.keys()
    assert made.seconds >= 0 and made.threads == 1 and not made.other_data and not made.stale


def test_a_study_goes_by_its_name():
    assert find_study("driving") is STUDIES["driving"]
    with pytest.raises(ConfigError, match="study 'elsewhere' is called 'recorded-targets' now"):
        find_study("elsewhere")
    with pytest.raises(ConfigError, match="did you mean 'driving'?"):
        find_study("drivng")


@pytest.mark.parametrize("name", STUDIES)
def test_stored_records_are_found_under_their_keys(name):
    """What they are about may gain values: those that older records do not have must leave keys as they are."""
    records = STUDIES[name].doors.records(RESULTS)
    paths = {records.path(one.about) for one in records.all()}
    assert paths == set(records.folder.glob("*.json")) != set()


@pytest.mark.parametrize("name", STUDIES)
def test_every_study_has_work_at_the_smallest_sizes(name, tmp_path):
    """Sizes that a preset's pool does not hold are left out."""
    jobs = find_study(name).doors.jobs(Study("smoke", tmp_path, tmp_path), find_study(name).systems[0])
    assert len(jobs)
