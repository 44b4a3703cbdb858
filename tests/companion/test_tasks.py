"""The benchmark: methods of anyone, good and bad, on the same tasks."""

import dataclasses
import json
import textwrap
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from companion.__main__ import main
from companion.engine.provenance import here
from companion.numerics import versions
from companion.tasks import run as run_module
from companion.tasks.cards import card
from companion.tasks.catalogue import GROUPS, TASKS, Task, find_tasks, load_task
from companion.tasks.methods import find_method
from companion.tasks.page import groups_of, write_page
from companion.tasks.run import check, entries, records, run
from companion.tasks.scores import (
    data_ratio,
    holm,
    pairwise,
    results_frame,
    score_table,
    scores_by_group,
    task_scores,
)
from companion.tasks.trial import Entry, EntryResult, measure
from sidm.config import ConfigError
from sidm.drives import minutes_of

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

class Raises(Still):
    def fit(self, novice, expert, seed):
        raise KeyError("the novice")

class Dies(Still):
    def fit(self, novice, expert, seed):
        import os
        os._exit(3)

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


def test_a_simulated_task_sees_the_body_it_names(tmp_path):
    small = {"minutes": 0.3, "expert_minutes": 0.2, "validation_minutes": 0.2}
    task = dataclasses.replace(TASKS["system1, left and right, 5 min"], **small)
    import companion.tasks.catalogue as catalogue

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(catalogue, "POOL_MINUTES", 0.5)
        novice, expert, validation = load_task(task, 0, tmp_path)
    assert len(novice) == 3 and len({d.session for d in novice}) == 3
    names = [name for name, _ in novice[0].body.actions]
    assert names == ["left", "right"] and expert[0].body.name == "rover"
    assert validation[0].body == novice[0].body and novice[0].ground is not None
    assert not {d.index for d in novice} & set() and novice[0].states.shape == (65, 13)


@pytest.mark.parametrize(
    ("name", "status", "words"),
    [
        ("Random", "ok", ""),
        ("Unseeded", "not reproducible", "differ if repeated"),
        ("NotANumber", "not finite", "a prediction is not finite"),
        ("WrongShape", "wrong shape", "(19, 4), not (19, 6)"),
        ("Raises", "raised", "KeyError: 'the novice'"),
        ("Dies", "raised", ""),
        ("Forever", "limit", "after 12 s"),
        ("Peeks", "peeked", "changes with the state after it"),
    ],
)
def test_each_kind_of_failure_is_a_row(file, tmp_path, name, status, words):
    limit = 12 if status == "limit" else 600  # s
    (result,) = run(
        [f"{file}:{name}"],
        [TASK],
        seeds=1,
        results=tmp_path,
        limit=limit,
        progress=False,
    )
    assert (result.status, words in result.message) == (status, True), result.message
    assert (result.loss is None) == (status != "ok")
    assert result.about.method == f"entered.py:{name}" and len(result.about.code) == 12


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


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("tres", "unknown method 'tres'; did you mean 'trees'"),
        ("nowhere.py:A", "nowhere.py: there is no such file"),
        ("{file}:Stil", "unknown class with 'fit' 'Stil'"),
        ("{broken}:A", "cannot be imported (SyntaxError"),
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


def test_a_card_says_what_is_predicted_from_what():
    text = card(TASKS["system1, no map, 5 min"])
    assert "5 min of the novice, 60 min of the expert" in text
    assert "commands throttle, steering" in text and "exact" in text
    real = card(TASK, [made("mean", TASK, 0, 6.0), made("mean", TASK, 1, 7.0)])
    assert "the mean         loss 6.5" in real and "jitter of the poses" in real


def made(method, task, seed, loss, status="ok", code=""):
    """A stored result with a loss."""
    about = Entry(method=method, code=code, task=task, seed=seed)
    values = {"loss": loss, "position": loss, "heading": loss, "seconds": 1.0}
    if status != "ok":
        values = {}
    return EntryResult(
        about=about, status=status, provenance=here(1.0, 1, kind="benchmark"), **values
    )


def made_frame():
    """Three methods on five tasks; each has a factor, and each task a difficulty."""
    rng = np.random.default_rng(0)
    results = []
    for number in range(5):
        task = Task(name=f"robot{number}, 5 min", pair="system1", minutes=5.0)
        for seed in range(3):
            level = (number + 1) * np.exp(0.5 * rng.standard_normal())
            for method, factor in (("least_squares", 1.0), ("good", 0.5), ("bad", 2.0)):
                noise = np.exp(0.05 * rng.standard_normal())
                results.append(made(method, task, seed, float(level * factor * noise)))
    return results_frame([*results, made("bad", task, 7, None, "raised")])


def test_scores_are_ratios_to_least_squares_over_tasks():
    frame = made_frame()
    table = score_table(frame).set_index("method")
    assert table.index.tolist() == ["good", "least_squares", "bad"]
    assert table.loc["good", "score"] == pytest.approx(0.5, rel=0.1)
    assert table.loc["good", "low"] < 0.5 < table.loc["good", "high"]
    assert table.loc["least_squares", "score"] == 1
    assert table.failures.to_dict() == {"good": 0, "least_squares": 0, "bad": 1}
    logs = []  # the same by hand
    for _, rows in frame[frame.status == "ok"].groupby("task"):
        wide = rows.pivot(index="seed", columns="method", values="loss")
        logs.append(np.log(wide.good / wide.least_squares).mean())
    assert table.loc["good", "score"] == pytest.approx(np.exp(np.mean(logs)))
    assert np.log(table.loc["good", "high"]) == pytest.approx(
        np.mean(logs) + 2.776 * np.std(logs, ddof=1) / np.sqrt(5), rel=1e-3
    )


def test_a_group_is_scored_where_all_its_tasks_are():
    frame = made_frame()
    names = sorted(frame.task.unique())
    short = frame[(frame.method != "good") | (frame.task != names[0])]
    groups = {"first": names[:2], "rest": names[2:], "none": ["no task"]}
    table = scores_by_group(short, groups)
    assert table.index.tolist() == ["least_squares", "bad", "good"]
    assert not len(scores_by_group(frame[:0], groups))
    assert table.loc["good", "first"] is None and table["none"].isna().all()
    rest = score_table(frame[frame.task.isin(names[2:])]).set_index("method")
    assert table.loc["good", "rest"] == tuple(
        rest.loc["good", ["score", "low", "high"]]
    )


def test_the_interval_of_one_task_is_over_its_seeds():
    frame = made_frame()
    task = frame.task.min()
    found = scores_by_group(frame, {"one": [task]}).loc["good", "one"]
    wide = frame[frame.task == task].pivot(
        index="seed", columns="method", values="loss"
    )
    logs = np.log(wide.good / wide.least_squares)
    width = stats.t.ppf(0.975, len(logs) - 1) * stats.sem(logs)
    assert np.log(found) == pytest.approx(
        [logs.mean(), logs.mean() - width, logs.mean() + width]
    )


def test_a_task_with_a_failed_seed_has_no_score():
    task = Task(name="robot, 5 min", pair="system1", minutes=5.0)
    results = [made("least_squares", task, s, 1.0) for s in (0, 1)]
    results += [made("other", task, 0, 1.0), made("other", task, 1, None, "limit")]
    assert task_scores(results_frame(results)).other.isna().all()


def test_who_is_apart_is_corrected_for_all_pairs():
    pairs = pairwise(made_frame())
    assert len(pairs) == 3 and pairs.apart.all()
    best = pairs[(pairs["first"] == "good") & (pairs.second == "bad")]
    assert best.ratio.iloc[0] == pytest.approx(0.25, rel=0.1)
    assert holm(np.array([0.01, 0.04, 0.03])).tolist() == pytest.approx(
        [0.03, 0.06, 0.06]
    )


def test_a_data_ratio_is_read_on_the_curve_of_training_alone():
    """Loss falls as 1 / minutes: half the loss is worth twice the data."""
    results = []
    for minutes in (1.0, 5.0, 20.0):
        task = Task(name=f"robot, {minutes:g} min", pair="system1", minutes=minutes)
        results.append(made("novice_only", task, 0, 1 / minutes))
        results.append(made("other", task, 0, 0.5 / minutes))
    frame = results_frame(results)
    assert data_ratio(frame, "other") == pytest.approx(2.0)
    assert data_ratio(frame, "novice_only") == pytest.approx(1.0)
    assert np.isnan(data_ratio(frame, "none"))


def test_the_page_holds_every_row(tmp_path):
    frame = made_frame()
    write_page(frame, tmp_path / "page.html")
    page = (tmp_path / "page.html").read_text()
    start = page.index('type="application/json">') + len('type="application/json">')
    data = json.loads(page[start : page.index("</script>", start)])
    assert len(data["rows"]) == len(frame)
    (group,) = data["groups"]
    methods = [row["method"] for row in group["methods"]]
    assert methods == ["good", "least_squares", "bad"]
    assert len(group["tasks"]["values"][0]) == len(group["names"]) == 5
    assert "http://" not in page and "https://" not in page


def test_the_page_has_each_group_of_tasks_and_all():
    names = ("system1, 5 min", "system1, 20 min", "husky to warthog, 5 min")
    results = [made("mean", TASKS[name], 0, 1.0) for name in names]
    groups = groups_of(results_frame(results))
    assert groups == {
        "recorded robots": [names[2]],
        "struts held by motors": [*names[:2]],
        "all tasks": [names[2], *names[:2]],
    }
    assert list(groups_of(results_frame(results[:2]))) == ["struts held by motors"]


def test_methods_with_fewer_tasks_come_last():
    tasks = [TASKS[f"system1, {minutes} min"] for minutes in (1, 5)]
    results = [made("least_squares", task, 0, 1.0) for task in tasks]
    results += [made("mean", task, 0, 2.0) for task in tasks]
    results.append(made("quick_win", tasks[0], 0, 0.5))
    table = score_table(results_frame(results))
    assert table.method.tolist() == ["least_squares", "mean", "quick_win"]


def test_the_command_prints_the_table_and_checks_a_row(file, tmp_path, capsys):
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
    store.put(dataclasses.replace(stored, loss=0.5 * stored.loss))
    assert main(["bench", name, "--check", *results.split()]) == 1
    assert "NOT the same" in capsys.readouterr().out


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


def test_no_row_of_a_method_is_said(file, tmp_path):
    with pytest.raises(ConfigError, match="no trial of .*Still as it is now is stored"):
        check(f"{file}:Still", records(tmp_path).all())
    assert len(entries(["mean"], [TASK], 3)) == 3


def test_the_example_of_the_page_beats_the_mean(tmp_path):
    names = ["examples/nearest.py:Nearest", "mean"]
    nearest, mean = run(names, [TASK], seeds=1, results=tmp_path, progress=False)
    assert nearest.status == mean.status == "ok", nearest.message
    assert nearest.loss < 0.5 * mean.loss and nearest.position < 0.7 * mean.position


@pytest.mark.parametrize(
    ("method", "kind", "rel"),
    # a split of a tree may turn on the last bit of a feature
    [("least_squares", "benchmark", 1e-3), ("trees", "trees", 0.02)],
)
def test_a_method_keeps_its_figures(golden, method, kind, rel):
    values = measure(method, TASK, 0, "data")
    figures = {name: values[name] for name in ("loss", "position", "heading")}
    golden.hold(f"benchmark, {method}", kind, figures, rel=rel)


def test_a_row_of_trees_depends_on_their_version(tmp_path):
    """Settings of the trees change their rows alone."""
    names = ["trees", "mean"]
    trees, mean = run(names, [TASK], seeds=1, results=tmp_path, progress=False)
    assert trees.provenance.numerics == versions("trees")
    assert mean.provenance.numerics == versions("benchmark")
