"""The benchmark: methods of anyone, good and bad, on the same tasks."""

import dataclasses
import multiprocessing
import os
from concurrent.futures import ProcessPoolExecutor

import pandas as pd
import pytest

from companion.__main__ import main
from companion.numerics import RESULT_VERSIONS, versions
from companion.tasks import catalogue
from companion.tasks import run as run_module
from companion.tasks.catalogue import GROUPS, TASKS, card, find_tasks, load_task
from companion.tasks.methods import LibraryMethod, find_method
from companion.tasks.run import check, newest, records, run
from companion.tasks.trial import kind_of, measure
from sidm.config import ConfigError, replace
from sidm.drives import minutes_of
from tests.companion.tasks.conftest import made

TASK = TASKS["husky to warthog, 0.8 min"]
METHODS = '''
import os, signal, time
import numpy as np

class Still:
    """Predicts that the robot stays where it is."""
    def fit(self, novice, expert, seed):
        self.seed = seed
        return self
    def predict(self, drive):
        motion = np.zeros((len(drive), 3))
        return np.hstack([motion, drive.states[:-1, 3:]])

class Random(Still):
    def predict(self, drive):
        rng = np.random.default_rng(self.seed)
        return rng.standard_normal((len(drive), 6))

class Unseeded(Still):
    def predict(self, drive):
        return np.random.default_rng().standard_normal((len(drive), 6))

class NotANumber(Still):
    def predict(self, drive):
        return super().predict(drive) * np.nan

class WrongShape(Still):
    def predict(self, drive):
        return super().predict(drive)[:, :4]

class WrongPath(Still):
    def rollout(self, state, actions, ground):
        return np.tile(state, (len(actions), 1))

class Raises(Still):
    def fit(self, novice, expert, seed):
        raise KeyError("the novice")

class NotForThese(Still):
    def fit(self, novice, expert, seed):
        raise NotImplementedError("no wheels")

class NotYet(Still):
    def predict(self, drive):
        raise NotImplementedError("later")

class Killed(Still):
    def fit(self, novice, expert, seed):
        os.kill(os.getpid(), signal.SIGKILL)

class NeedsMore(Still):
    def __init__(self, more):
        self.more = more

class Forever(Still):
    def fit(self, novice, expert, seed):
        while True:
            time.sleep(1)

class Peeks(Still):
    """Uses the state after each step."""
    def predict(self, drive):
        motion = np.zeros((len(drive), 3))
        return np.hstack([motion, drive.states[1:, 3:]])
'''


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    path = tmp_path_factory.mktemp("methods") / "entered.py"
    path.write_text(METHODS)
    return path


def test_the_learnt_drives_never_judge():
    data = [load_task(TASK, seed) for seed in (0, 1)]
    for novice, expert, validation in data:
        sessions = [{d.session for d in drives} for drives in (novice, validation)]
        assert not sessions[0] & sessions[1] and len(expert) == 480
        assert 0.8 <= minutes_of(novice) < 1.0
    judged = [{d.name for d in one.validation} for one in data]
    assert judged[0] != judged[1], "seeds differ"
    longer = load_task(TASKS["husky to warthog, 5 min"], 0)
    assert {d.name for d in data[0].novice} < {d.name for d in longer.novice}


@pytest.mark.more
def test_a_simulated_task_sees_the_body_it_names(tmp_path, monkeypatch):
    small = {"minutes": 0.3, "expert_minutes": 0.2, "validation_minutes": 0.2}
    task = replace(TASKS["system1, left and right, 5 min"], **small)
    monkeypatch.setattr(catalogue, "POOL_MINUTES", 0.5)
    novice, expert, validation = load_task(task, 0, tmp_path)
    assert len(novice) == 3 and len({d.session for d in novice}) == 3
    names = [name for name, _ in novice[0].body.actions]
    assert names == ["left", "right"] and expert[0].body.name == "rover"
    assert validation[0].body == novice[0].body and novice[0].ground is not None
    assert novice[0].states.shape == (65, 13)


@pytest.mark.parametrize(
    ("name", "status", "words"),
    [
        ("Random", "ok", ""),
        ("Unseeded", "not reproducible", "differ if repeated"),
        ("NotANumber", "not finite", "a prediction is not finite"),
        ("WrongShape", "wrong shape", "(19, 4), not (19, 6)"),
        ("WrongPath", "wrong shape", "a rollout of shape (10, 6), not (11, 6)"),
        ("Raises", "raised", "KeyError: 'the novice'"),
        ("NotForThese", "not for these robots", "no wheels"),
        ("NotYet", "raised", "NotImplementedError: later"),
        ("Peeks", "peeked", "changes with the state after it"),
    ],
)
def test_each_kind_of_failure_is_told_apart(file, name, status, words):
    values = measure(f"{file}:{name}", TASK, 0, "data")
    assert values["status"] == status
    assert words in values.get("message", "") and ("loss" in values) == (status == "ok")


@pytest.mark.parametrize(
    ("name", "limit", "status", "words"),
    [
        ("Killed", 600, "raised", "ended by SIGKILL"),
        ("Forever", 1, "limit", "after 1 s"),
    ],
)
def test_a_failure_is_a_row_and_ends_its_own_process_alone(
    file, tmp_path, name, limit, status, words
):
    where = {"results": tmp_path, "limit": limit, "progress": False}
    (result,) = run([f"{file}:{name}"], [TASK], seeds=1, **where)
    assert result.status == status and words in result.message
    assert result.loss is None
    assert result.about.method == f"entered.py:{name}" and len(result.about.code) == 12


@pytest.mark.more
def test_a_method_gets_what_the_librarys_own_gets(file, tmp_path):
    names = [f"{file}:Still", "nothing_changes"]
    found = []
    for workers in (1, 2):
        where = tmp_path / f"{workers}"
        results = run(names, [TASK], seeds=1, results=where, workers=workers)
        found.append([(r.about, r.loss, r.position, r.heading) for r in results])
    assert found[0] == found[1]
    mine, library = results
    assert mine.loss == pytest.approx(library.loss, rel=1e-5)
    assert mine.position == pytest.approx(library.position, rel=1e-5)
    assert sum(mine.components) == pytest.approx(mine.loss, rel=1e-4)


def test_the_librarys_methods_say_for_which_robots_they_are_not(monkeypatch):
    novice, expert, _ = load_task(TASK, 0)
    body = replace(expert[0].body, actions=(("left", "1"), ("right", "1")))
    others = [dataclasses.replace(drive, body=body) for drive in expert]
    with pytest.raises(NotImplementedError, match="needs robots of one body"):
        LibraryMethod("trees_corrected").fit(novice, others, 0)
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    with pytest.raises(ConfigError, match="needs scikit-learn"):
        LibraryMethod("trees_corrected").fit(novice, others, 0)


def test_of_a_file_the_newest_version_counts(file, tmp_path):
    """Other code is another method."""
    name, here = f"{file}:Still", find_method(f"{file}:Still")
    copy = tmp_path / "entered.py"
    for text, same in (("", True), ("\n# changed\n", False)):
        copy.write_text(file.read_text() + text)
        assert (find_method(f"{copy}:Still") == here) == same
    store = records(tmp_path)
    for day, code in ((3, "newest"), (1, "older"), (2, here[1])):
        row = made(here[0], TASK, 0, 1.0, code=code)
        date = f"2026-01-0{day}T00:00:00"
        store.put(replace(row, provenance=replace(row.provenance, date=date)))
    store.put(made("mean", TASK, 0, 1.0))
    assert {row.about.code for row in newest(tmp_path)} == {"", "newest"}
    assert {row.about.code for row in newest(tmp_path, [name])} == {"", here[1]}


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("tres", "unknown method 'tres'; did you mean 'trees'"),
        ("nowhere.py:A", "nowhere.py: there is no such file"),
        ("{file}:Stil", "unknown class with 'fit' 'Stil'"),
        ("{broken}:A", "cannot be imported (SyntaxError"),
        ("{file}", "entered.py: add the name of the class, as "),
        ("{file}:NeedsMore", "cannot be made without arguments (TypeError"),
    ],
)
def test_what_is_no_method_is_one_line(file, tmp_path, name, words):
    broken = tmp_path / "broken.py"
    broken.write_text("class A")
    with pytest.raises(ConfigError) as caught:
        find_method(name.format(file=file, broken=broken))
    assert words in str(caught.value) and "\n" not in str(caught.value)


def test_tasks_have_names_and_cards():
    assert find_tasks("all") == [*TASKS.values()]
    assert find_tasks("quick") == [*GROUPS["quick"]]
    assert len(find_tasks("held")) == len(find_tasks("free")) == 6
    with pytest.raises(ConfigError, match="did you mean 'system1, 5 min'"):
        find_tasks("system1, 5 mn")
    with pytest.raises(ConfigError, match="; all; husky to warthog, 0.8 min; "):
        find_tasks("nonsense")
    simulated = card(TASKS["system1, no map, 5 min"])
    assert "5 min of the novice, 60 min of the expert" in simulated
    real = card(TASK, [made("mean", TASK, 0, 6.0), made("mean", TASK, 1, 7.0)])
    assert "the mean         loss 6.5" in real and "jitter of the poses" in real


def test_the_command_prints_the_table_and_checks_a_row(
    file, tmp_path, capsys, monkeypatch
):
    results, name = ["--results", str(tmp_path / "r")], f"{file}:Still"
    task = ["--tasks", TASK.name, "--seeds", "1", *results]
    assert main(["bench", name, "least_squares", *task]) == 0
    said = capsys.readouterr().out
    assert "entered.py:Still" in said and "least_squares" in said
    store = records(tmp_path / "r")
    with pytest.raises(ConfigError, match="no trial of mean as it is now is stored"):
        check("mean", store.all())
    csv, page = tmp_path / "rows.csv", tmp_path / "page.html"
    words = ["bench", *results, "--csv", str(csv), "--page", str(page)]
    assert main(words) == 0 and len(pd.read_csv(csv)) == 2 and page.is_file()
    assert main(["bench", name, "--check", *results]) == 0
    assert "the same" in capsys.readouterr().out
    stored = next(result for result in store.all() if result.about.code)
    monkeypatch.setattr(run_module, "run_trial", lambda *_: stored)
    store.put(replace(stored, position=0.5 * stored.position))
    assert main(["bench", name, "--check", *results]) == 1
    (line,) = [s for s in capsys.readouterr().out.splitlines() if "NOT the" in s]
    assert line.split()[0] == "position"
    assert main(["bench", name, "--check", "--page", str(page)]) == 2
    assert "--page and --csv write the table" in capsys.readouterr().err


SQUARES = [("least_squares", 1, seed) for seed in range(3)]


@pytest.mark.parametrize(
    ("rows", "tasks", "note"),
    [
        ([("mean", 1, 0)], "all", "scores are ratios to least_squares"),
        ([*SQUARES, ("mean", 1, 0)], "all", "a score needs all 3 seeds of a task"),
        (
            [SQUARES[0], ("mean", 1, 0), ("least_squares", 5, 0)],
            "held",
            "some scores are over fewer tasks",
        ),
        (SQUARES[:1], "system1, 1 min", ""),
    ],
)
def test_a_table_says_what_its_scores_lack(rows, tasks, note, tmp_path, capsys):
    for method, minutes, seed in rows:
        task = TASKS[f"system1, {minutes} min"]
        records(tmp_path).put(made(method, task, seed, 1.0))
    words = ["bench", "--results", str(tmp_path), "--tasks"]
    assert main([*words, tasks]) == 0
    said = capsys.readouterr().out
    assert f"note: {note}" in said if note else "note" not in said
    assert main([*words, "free"]) == 2
    assert "no rows of these tasks are there" in capsys.readouterr().err


@pytest.mark.more
def test_workers_elsewhere_find_the_method_and_the_recordings(file, tmp_path):
    name = f"{os.path.relpath(file)}:Still"
    elsewhere = {"initializer": os.chdir, "initargs": (tmp_path,)}
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, context, **elsewhere) as executor:
        (result,) = run([name], [TASK], seeds=1, results=tmp_path, executor=executor)
    assert (result.status, result.message) == ("ok", "")


def test_what_failed_runs_again_when_asked(tmp_path, monkeypatch):
    """What is interrupted leaves the failed row until another takes its place."""
    task, ran, store = TASKS["system1, 1 min"], [], records(tmp_path)
    failed = made("mean", task, 0, None, "limit")
    for row in (failed, made("mean", task, 1, 1.0)):
        store.put(row)

    def load_task(*_, workers, progress):
        ran.append(f"motion by {workers}")
        if workers == 3:
            raise KeyboardInterrupt

    def run_trial(about, *_, **__):
        ran.append(about.seed)
        return made("mean", task, about.seed, 2.0)

    def losses(**settings):
        rows = run(["mean"], [task], seeds=2, results=tmp_path, **settings)
        return [row.loss for row in rows]

    monkeypatch.setattr(run_module, "load_task", load_task)
    monkeypatch.setattr(run_module, "run_trial", run_trial)
    assert losses(workers=1) == [None, 1.0] and ran == []
    with pytest.raises(KeyboardInterrupt):
        losses(workers=3, retry=True)
    assert store.get(failed.about) == failed
    assert losses(workers=1, retry=True) == [2.0, 1.0]
    # motion is simulated before the limit of a trial runs
    assert ran == ["motion by 3", "motion by 1", 0]
    monkeypatch.setitem(RESULT_VERSIONS, "benchmark", 0)
    losses(workers=1)
    assert ran[-2:] == [0, 1], "rows of an older version"


@pytest.mark.more
def test_the_example_of_the_page_beats_the_mean(tmp_path):
    names = ["examples/nearest.py:Nearest", "mean"]
    nearest, mean = run(names, [TASK], seeds=1, results=tmp_path, progress=False)
    assert nearest.status == mean.status == "ok", nearest.message
    assert nearest.loss < 0.5 * mean.loss and nearest.position < 0.7 * mean.position


@pytest.mark.parametrize(
    ("method", "kind", "rel"),
    [  # a split of a tree, or where a search of length scales ends, may turn on a bit
        ("least_squares", "benchmark", 1e-3),
        ("trees", "trees", 0.02),
        ("gp", "gaussian_process", 0.02),
    ],
)
def test_a_method_keeps_its_figures(golden, method, kind, rel):
    values = measure(method, TASK, 0, "data")
    figures = {name: values[name] for name in ("loss", "position", "heading")}
    assert kind_of(method) == kind and kind in versions(kind)
    golden.hold(f"benchmark, {method}", kind, figures, rel=rel)
