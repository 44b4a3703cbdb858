"""Records: what is kept, what is refused, and what goes on when one fails."""

from concurrent.futures import ThreadPoolExecutor

import pytest

from companion import Study, load_preset
from companion.engine.provenance import Provenance, here
from companion.engine.records import Making, Records, key_of
from companion.numerics import versions
from companion.registry import MEASUREMENTS, NAMES, STUDIES, is_of_trials, overview, run
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
    """A third of it; none for more than a hundred, and none at all for less than
    nothing."""
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
    assert store.get(third).about == third and store.get(third).value == pytest.approx(
        1 / 9, rel=1e-5
    )
    assert (
        store.get(third).value != 1 / 9
        and store.get(Question(minutes=0.333333)) is None
    )
    assert key_of(third) != key_of(Question(minutes=0.333333))


def test_one_failure_does_not_lose_the_others(store, capsys):
    """Each is a line; what is stored is not made again."""
    questions = [Question(minutes=minutes) for minutes in (1.0, -1.0, 200.0, 2.0)]
    with ThreadPoolExecutor(1) as executor:
        assert store.run(questions, answer, executor, "answer", progress=False) == 2
        said = capsys.readouterr().err
        assert (
            "answer failed: less than nothing" in said
            and "a number is not finite" in said
        )
        assert [one.value for one in store.stored(questions)] == pytest.approx(
            [1 / 3, 2 / 3], rel=1e-5
        )
        assert store.run(questions[:1], None, executor, "answer", progress=False) == 0


def test_a_record_says_what_it_depends_on():
    made = Making("driving", None, "data").done()
    assert (
        made.numerics == versions("driving")
        and {"simulation", "training", "driving"} < made.numerics.keys()
    )
    assert (
        made.seconds >= 0
        and made.threads == 1
        and not made.other_data
        and not made.stale
    )


def test_what_is_run_goes_by_its_name():
    assert (
        is_of_trials("3")
        and is_of_trials("all")
        and not is_of_trials("driving")
        and not is_of_trials("gap")
    )
    with pytest.raises(
        ConfigError, match="figure 'elsewhere' is called 'recorded-targets' now"
    ):
        is_of_trials("elsewhere")
    with pytest.raises(ConfigError, match="did you mean 'driving'?"):
        is_of_trials("drivng")
    assert len(set(NAMES)) == len(NAMES)


@pytest.mark.parametrize("name", STUDIES)
def test_stored_records_are_found_under_their_keys(name):
    """What they are about may gain values: those that older records do not have must
    leave keys as they are."""
    records = STUDIES[name].module.records(RESULTS)
    paths = {records.path(one.about) for one in records.all()}
    assert paths == set(records.folder.glob("*.json")) != set()


@pytest.mark.parametrize("name", STUDIES)
def test_every_study_has_work_at_the_smallest_sizes(name, tmp_path):
    """Sizes that a preset's pool does not hold are left out."""
    study = Study("smoke", tmp_path, tmp_path)
    jobs = [
        job
        for pair in STUDIES[name].pairs
        for job in STUDIES[name].module.jobs(study, pair)
    ]
    assert jobs and overview(name, study.preset, None, tmp_path, tmp_path)[1] == len(
        set(jobs)
    )


@pytest.mark.parametrize("name", [*STUDIES, *MEASUREMENTS])
def test_nothing_that_is_stored_is_stale(name):
    lines, _ = overview(name, load_preset("laptop"), None, "no data", RESULTS)
    assert lines and all(line.endswith((": stored", "stale 0")) for line in lines), (
        lines
    )


def test_a_measurement_is_made_where_it_lacks_or_is_stale(tmp_path, monkeypatch):
    made = []
    monkeypatch.setattr(
        "companion.studies.gap.make", lambda study, workers: made.append(study.results)
    )
    asked = "gap", load_preset("smoke"), None, 1, tmp_path, tmp_path
    assert (
        overview("gap", asked[1], None, tmp_path, tmp_path)[1] == 1
        and run(*asked) == []
    )
    for made_by, count in (({"simulation": -1}, 2), (versions("free_struts"), 2)):
        write_record(tmp_path / "gap.json", {"numerics": made_by})
        assert run(*asked) == [] and len(made) == count
    (tmp_path / "gap.json").write_text("{")
    with pytest.raises(ConfigError, match="gap.json: damaged"):
        run(*asked)
