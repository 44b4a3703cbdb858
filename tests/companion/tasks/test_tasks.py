"""The benchmark: methods of anyone, good and bad, on the same tasks."""

import dataclasses
import multiprocessing
import os
import textwrap
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor

import pandas as pd
import pytest

from companion.__main__ import main
from companion.numerics import NUMERICS, versions
from companion.tasks import catalogue
from companion.tasks import run as run_module
from companion.tasks.cards import card
from companion.tasks.catalogue import GROUPS, TASKS, find_tasks, load_task
from companion.tasks.methods import LibraryMethod, find_method
from companion.tasks.run import check, entries, newest, records, run
from companion.tasks.trial import kind_of, measure
from sidm.config import ConfigError
from sidm.drives import minutes_of
from tests.companion.tasks.conftest import made

TASK = TASKS["husky to warthog, 0.8 min"]
METHODS = '''
import time
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

class Dies(Still):
    def fit(self, novice, expert, seed):
        import os
        os._exit(3)

class Killed(Still):
    def fit(self, novice, expert, seed):
        import os, signal
        os.kill(os.getpid(), signal.SIGKILL)

class NeedsMore(Still):
    def __init__(self, more):
        self.more = more

class FailsFirst(Still):
    def fit(self, novice, expert, seed):
        assert seed > 0
        return super().fit(novice, expert, seed)

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
    path.write_text(textwrap.dedent(METHODS))
    return path


def test_the_learnt_drives_never_judge():
    """No session is on both sides, sizes are those asked for, and seeds differ."""
    data = [load_task(TASK, seed) for seed in (0, 1)]
    for novice, expert, validation in data:
        sessions = [{d.session for d in drives} for drives in (novice, validation)]
        assert not sessions[0] & sessions[1] and len(expert) == 480
        assert 0.8 <= minutes_of(novice) < 1.0
    judged = [{d.name for d in one.validation} for one in data]
    assert judged[0] != judged[1]
    longer = load_task(TASKS["husky to warthog, 5 min"], 0)
    assert {d.name for d in data[0].novice} < {d.name for d in longer.novice}


@pytest.mark.more
def test_a_simulated_task_sees_the_body_it_names(tmp_path):
    small = {"minutes": 0.3, "expert_minutes": 0.2, "validation_minutes": 0.2}
    task = dataclasses.replace(TASKS["system1, left and right, 5 min"], **small)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(catalogue, "POOL_MINUTES", 0.5)
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
    ("name", "status", "words"),
    [
        ("Peeks", "peeked", "changes with the state after it"),
        pytest.param("Dies", "raised", "exit status 3", marks=pytest.mark.more),
        ("Killed", "raised", "ended by SIGKILL"),
        ("Forever", "limit", "after 1 s"),
    ],
)
def test_a_failure_is_a_row_and_ends_its_own_process_alone(
    file, tmp_path, name, status, words
):
    limit = 1 if status == "limit" else 600  # s
    (result,) = run(
        [f"{file}:{name}"],
        [TASK],
        seeds=1,
        results=tmp_path,
        limit=limit,
        progress=False,
    )
    assert (result.status, words in result.message) == (status, True), result.message
    assert result.loss is None
    assert result.about.method == f"entered.py:{name}" and len(result.about.code) == 12


@pytest.mark.more
def test_a_method_gets_what_the_librarys_own_gets(file, tmp_path):
    """Equal predictions have equal rows, in one process or in two."""
    names = [f"{file}:Still", "nothing_changes"]
    one, two = (
        run(names, [TASK], seeds=2, results=tmp_path / f"{workers}", workers=workers)
        for workers in (1, 2)
    )
    values = [
        [(r.about, r.loss, r.position, r.heading) for r in rs] for rs in (one, two)
    ]
    assert values[0] == values[1]
    by_method = {(r.about.method, r.about.seed): r for r in one}
    for seed in (0, 1):
        mine = by_method["entered.py:Still", seed]
        library = by_method["nothing_changes", seed]
        assert mine.loss == pytest.approx(library.loss, rel=1e-5)
        assert mine.position == pytest.approx(library.position, rel=1e-5)
        assert sum(mine.components) == pytest.approx(mine.loss, rel=1e-4)
    assert (
        by_method["entered.py:Still", 0].loss != by_method["entered.py:Still", 1].loss
    )


def test_the_librarys_methods_say_for_which_robots_they_are_not(monkeypatch):
    """A package that is missing is another matter."""
    novice, expert, _ = load_task(TASK, 0)
    body = dataclasses.replace(expert[0].body, actions=(("left", "1"), ("right", "1")))
    others = [dataclasses.replace(drive, body=body) for drive in expert]
    with pytest.raises(NotImplementedError, match="which needs robots of one body"):
        LibraryMethod("trees_corrected").fit(novice, others, 0)
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    with pytest.raises(ConfigError, match="needs scikit-learn"):
        LibraryMethod("trees_corrected").fit(novice, others, 0)


@pytest.mark.more
def test_a_killed_run_goes_on(tmp_path, monkeypatch):
    real, done = run_module.run_trial, []

    def counted(about, *arguments):
        if len(done) == 1:
            raise KeyboardInterrupt
        done.append(about)
        return real(about, *arguments)

    names = ["mean", "nothing_changes"]
    monkeypatch.setattr(run_module, "run_trial", counted)
    with ThreadPoolExecutor(1) as pool, pytest.raises(KeyboardInterrupt):
        run(names, [TASK], seeds=1, results=tmp_path, executor=pool)
    stored = records(tmp_path).all()
    assert [result.about for result in stored] == done
    again = []
    monkeypatch.setattr(
        run_module, "run_trial", lambda *a: again.append(a[0]) or real(*a)
    )
    assert len(run(names, [TASK], seeds=1, results=tmp_path)) == 2
    assert len(again) == 1 and again[0] not in done


def test_other_code_is_another_method(file, tmp_path):
    copy = tmp_path / "entered.py"
    copy.write_text(file.read_text())
    assert find_method(f"{copy}:Still") == find_method(f"{file}:Still")
    copy.write_text(file.read_text() + "\n# changed\n")
    assert find_method(f"{copy}:Still") != find_method(f"{file}:Still")


def test_of_a_file_the_newest_version_counts(file, tmp_path):
    """Or the one that is here, if the file is named."""
    name, here = f"{file}:Still", find_method(f"{file}:Still")
    store, rows = records(tmp_path), []
    for day, code in ((1, "older"), (2, here.code), (3, "newest")):
        row = made(here.name, TASK, 0, 1.0, code=code)
        made_on = dataclasses.replace(row.provenance, date=f"2026-01-0{day}T00:00:00")
        rows.append(dataclasses.replace(row, provenance=made_on))
    for row in (rows[2], made("mean", TASK, 0, 1.0), *rows[:2]):
        store.put(row)
    assert {row.about.code for row in newest(tmp_path)} == {"", "newest"}
    assert {row.about.code for row in newest(tmp_path, [name])} == {"", here.code}


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


def test_tasks_have_names():
    assert find_tasks("all") == [*TASKS.values()] and len(TASKS) >= 21
    assert find_tasks("quick") == [*GROUPS["quick"]]
    for name, group in GROUPS.items():
        assert all(bool(task.pair) == (name != "quick") for task in group)
    assert len(find_tasks("held")) == len(find_tasks("free")) == 6
    with pytest.raises(ConfigError, match="did you mean 'system1, 5 min'"):
        find_tasks("system1, 5 mn")
    with pytest.raises(ConfigError, match="; all; husky to warthog, 0.8 min; "):
        find_tasks("nonsense")


def test_a_card_says_what_is_predicted_from_what():
    text = card(TASKS["system1, no map, 5 min"])
    assert "5 min of the novice, 60 min of the expert" in text
    assert "commands throttle, steering" in text and "exact" in text
    real = card(TASK, [made("mean", TASK, 0, 6.0), made("mean", TASK, 1, 7.0)])
    assert "the mean         loss 6.5" in real and "jitter of the poses" in real


def test_the_command_prints_the_table_and_checks_a_row(
    file, tmp_path, capsys, monkeypatch
):
    results = f"--results {tmp_path}/r"
    task = ["--tasks", TASK.name, "--seeds", "1", *results.split()]
    name = f"{file}:Still"
    assert main(["bench", name, "least_squares", *task]) == 0
    said = capsys.readouterr().out
    assert "entered.py:Still" in said and "least_squares" in said
    csv, page = tmp_path / "rows.csv", tmp_path / "page.html"
    words = ["bench", *results.split(), "--csv", str(csv), "--page", str(page)]
    assert main(words) == 0 and len(pd.read_csv(csv)) == 2 and page.is_file()
    assert main(["bench", name, "--check", *results.split()]) == 0
    assert "the same" in capsys.readouterr().out
    store = records(tmp_path / "r")
    stored = next(result for result in store.all() if result.about.code)
    monkeypatch.setattr(run_module, "run_trial", lambda *_: stored)
    for value in ("loss", "position"):
        half = {value: 0.5 * getattr(stored, value)}
        store.put(dataclasses.replace(stored, **half))
        assert main(["bench", name, "--check", *results.split()]) == 1
        (line,) = [s for s in capsys.readouterr().out.splitlines() if "NOT the" in s]
        assert line.split()[0] == value
    assert main(["bench", name, "--check", "--page", str(page)]) == 2
    assert "--page and --csv write the table" in capsys.readouterr().err


def test_scores_need_the_reference(tmp_path, capsys):
    records(tmp_path).put(made("mean", TASK, 0, 1.0))
    assert main(["bench", "--results", str(tmp_path)]) == 0
    assert "note: scores are ratios to least_squares" in capsys.readouterr().out


def test_a_method_without_all_seeds_has_no_score_and_says_why(tmp_path, capsys):
    store = records(tmp_path)
    for seed in range(3):
        store.put(made("least_squares", TASK, seed, 1.0))
    store.put(made("mean", TASK, 0, 1.0))
    assert main(["bench", "--results", str(tmp_path)]) == 0
    assert "note: a score needs all 3 seeds of a task" in capsys.readouterr().out


def test_the_table_is_of_the_tasks_that_are_asked_for(tmp_path, capsys):
    store = records(tmp_path)
    for task, methods in (("system1, 1 min", 2), ("system1, 5 min", 1)):
        for method in ("least_squares", "mean")[:methods]:
            store.put(made(method, TASKS[task], 0, 1.0))
    words = ["--results", str(tmp_path)]
    assert main(["bench", "--tasks", "held", *words]) == 0
    said = capsys.readouterr().out
    assert "mean" in said and "note: some scores are over fewer tasks" in said
    assert main(["bench", "--tasks", "system1, 5 min", *words]) == 0
    said = capsys.readouterr().out
    assert "mean" not in said and "note" not in said
    assert main(["bench", "--tasks", "free", *words]) == 2
    assert "no rows of these tasks are there" in capsys.readouterr().err


@pytest.mark.more
def test_workers_elsewhere_find_the_method_and_the_recordings(file, tmp_path):
    """A worker of a cluster has another working directory."""
    name = f"{os.path.relpath(file)}:Still"
    elsewhere = {"initializer": os.chdir, "initargs": (tmp_path,)}
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, context, **elsewhere) as executor:
        (result,) = run([name], [TASK], seeds=1, results=tmp_path, executor=executor)
    assert (result.status, result.message) == ("ok", "")


def test_motion_is_simulated_before_the_limit_of_a_trial_runs(tmp_path, monkeypatch):
    task, done = TASKS["system1, 1 min"], []
    stored = made("mean", task, 0, 1.0)

    def load_task(*_, workers, progress):
        done.append(f"motion by {workers}")

    def run_trial(*_):
        done.append("trial")
        return stored

    monkeypatch.setattr(run_module, "load_task", load_task)
    monkeypatch.setattr(run_module, "run_trial", run_trial)
    check("mean", [stored], tmp_path, workers=2)
    run(["mean"], [task], seeds=1, results=tmp_path, workers=3)
    assert done == ["motion by 2", "trial", "motion by 3", "trial"]


def test_what_failed_runs_again_when_asked(file, tmp_path, monkeypatch):
    task, ran = TASKS["system1, 1 min"], []
    store = records(tmp_path)
    store.put(made("mean", task, 0, None, "limit"))
    store.put(made("mean", task, 1, 1.0))
    monkeypatch.setattr(run_module, "load_task", lambda *_, **__: None)

    def run_trial(about, *_):
        ran.append(about.seed)
        return made("mean", task, about.seed, 2.0)

    monkeypatch.setattr(run_module, "run_trial", run_trial)
    again = {"seeds": 2, "results": tmp_path, "progress": False}
    assert [row.loss for row in run(["mean"], [task], **again)] == [None, 1.0]
    (failed,) = (row for row in store.all() if row.status == "limit")

    def interrupt(*_, **__):
        raise KeyboardInterrupt

    with monkeypatch.context() as interrupted, pytest.raises(KeyboardInterrupt):
        interrupted.setattr(run_module, "load_task", interrupt)
        run(["mean"], [task], retry=True, **again)
    assert store.get(failed.about) == failed  # until another row takes its place
    rows = run(["mean"], [task], retry=True, **again)
    assert [row.loss for row in rows] == [2.0, 1.0] and ran == [0]
    monkeypatch.setitem(NUMERICS, "benchmark", 0)
    run(["mean"], [task], **again)
    assert ran == [0, 0, 1]  # of an older version


@pytest.mark.more
def test_a_check_runs_a_trial_that_went_well(file, tmp_path):
    name = f"{file}:FailsFirst"
    rows = run([name], [TASK], seeds=2, results=tmp_path)
    assert [row.status for row in rows] == ["raised", "ok"]
    stored, new = check(name, rows)
    assert stored.about.seed == 1 and stored.loss == pytest.approx(new.loss)


def test_recorded_robots_are_in_the_repository(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["bench", "--list"]) == 2
    said = capsys.readouterr().err
    assert "recordings: there is no such folder" in said and "--tasks held" in said


def test_no_row_of_a_method_is_said(file, tmp_path):
    with pytest.raises(ConfigError, match="no trial of .*Still as it is now is stored"):
        check(f"{file}:Still", records(tmp_path).all())
    assert len(entries(["mean"], [TASK], 3)) == 3


@pytest.mark.more
def test_the_example_of_the_page_beats_the_mean(tmp_path):
    names = ["examples/nearest.py:Nearest", "mean"]
    nearest, mean = run(names, [TASK], seeds=1, results=tmp_path, progress=False)
    assert nearest.status == mean.status == "ok", nearest.message
    assert nearest.loss < 0.5 * mean.loss and nearest.position < 0.7 * mean.position


@pytest.mark.parametrize(
    ("method", "kind", "rel"),
    # a split of a tree, or where a search of length scales ends, may turn on a last bit
    [
        ("least_squares", "benchmark", 1e-3),
        ("trees", "trees", 0.02),
        ("gp", "gaussian_process", 0.02),
    ],
)
def test_a_method_keeps_its_figures(golden, method, kind, rel):
    values = measure(method, TASK, 0, "data")
    figures = {name: values[name] for name in ("loss", "position", "heading")}
    golden.hold(f"benchmark, {method}", kind, figures, rel=rel)


def test_a_row_depends_on_the_version_of_its_method(tmp_path):
    """Settings of trees or of Gaussian processes change the rows of these alone."""
    kinds = {"trees_pooled": "trees", "gp": "gaussian_process", "a.py:A": "benchmark"}
    assert {name: kind_of(name) for name in kinds} == kinds
    (row,) = run(["mean"], [TASK], seeds=1, results=tmp_path, progress=False)
    assert row.provenance.numerics == versions("benchmark")
    assert versions("trees") == versions("benchmark") | {"trees": NUMERICS["trees"]}
