"""The benchmark's scores, its page and its figure."""

import json

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from companion.statistics.intervals import holm
from companion.tasks.catalogue import Task
from companion.tasks.figure import figure
from companion.tasks.page import write_page
from companion.tasks.scores import (
    data_ratio,
    log_ratios,
    mean_of,
    mean_ratio,
    pairwise,
    results_frame,
    score_table,
    scores_by_group,
)
from ownrobot.comparison.statistics import Interval
from tests.companion.tasks.conftest import made


def task_of(robots, minutes=5.0):
    return Task(name=f"{robots}, {minutes:g} min", pair="system1", minutes=minutes)


@pytest.fixture(scope="module")
def frame():
    """Three methods on five tasks; each has a factor, and each task a difficulty."""
    rng = np.random.default_rng(0)
    results = []
    for number in range(5):
        task = task_of(f"robot{number}")
        for seed in range(3):
            level = (number + 1) * np.exp(0.5 * rng.standard_normal())
            for method, factor in (("least_squares", 1.0), ("good", 0.5), ("bad", 2.0)):
                noise = np.exp(0.05 * rng.standard_normal())
                results.append(made(method, task, seed, float(level * factor * noise)))
    return results_frame([*results, made("bad", task, 7, None, "raised")])


def logs_by_hand(frame, task, method):
    """Log ratio to least squares of each seed of a task (S,)."""
    rows = frame[(frame.status == "ok") & (frame.task == task)]
    wide = rows.pivot(index="seed", columns="method", values="loss").dropna()
    return np.log(wide[method] / wide.least_squares)


def test_scores_are_ratios_to_least_squares_over_tasks(frame):
    table = score_table(frame).set_index("method")
    assert table.index.tolist() == ["good", "least_squares", "bad"]
    assert table.loc["least_squares", "score"] == 1
    assert table.failures.to_dict() == {"good": 0, "least_squares": 0, "bad": 1}
    assert table.tasks.to_dict() == {"good": 5, "least_squares": 5, "bad": 4}
    score = table.loc["good", ["score", "low", "high"]].to_numpy(float)
    assert mean_ratio(frame, "good", set(frame.task)) == pytest.approx(score)
    by_task = [logs_by_hand(frame, task, "good") for task in frame.task.unique()]
    mean = np.mean([logs.mean() for logs in by_task])
    variances = [logs.var(ddof=1) / 3 for logs in by_task]
    freedom = sum(variances) ** 2 / sum(v**2 / 2 for v in variances)
    reach = stats.t.ppf(0.975, freedom) * np.sqrt(sum(variances)) / 5
    assert np.log(score) == pytest.approx([mean, mean - reach, mean + reach])


def test_sizes_of_a_pair_of_robots_are_no_further_evidence():
    def mean(robots, sizes, losses):
        results = []
        for minutes in sizes:
            for seed, loss in enumerate(losses):
                task = task_of(robots, minutes)
                results += [made("least_squares", task, seed, 1.0)]
                results += [made("other", task, seed, loss)]
        return mean_of(log_ratios(results_frame(results)).other)

    seeds = [0.5, 0.6, 0.8]
    one, two = (mean("robot", sizes, seeds) for sizes in ([1.0], [1.0, 5.0]))
    assert one == pytest.approx(two) and one.freedom == 2
    factor = mean("husky to warthog", [1.0], seeds).error / one.error
    assert factor == pytest.approx(np.sqrt(1 + 3 * 0.25 / 0.75))  # divided anew
    assert str(mean("robot", [1.0], [0.5]).interval) == "0.50"
    logs = log_ratios(results_frame([])).reindex(columns=["other"])
    assert np.isnan(mean_of(logs.other)).all(), "without rows nothing is known"


def test_a_failed_or_missing_seed_takes_a_methods_score():
    task = task_of("robot")
    rows = [made("least_squares", task, seed, 1.0) for seed in (0, 1)]
    rows += [made("other", task, seed, 1.0) for seed in (0, 1)]
    rows += [made("other", task, 2, None, "limit")]
    rows += [made("short", task, 0, 1.0)]
    rows += [made("good", task, seed, 0.5) for seed in (0, 1, 2)]
    rows += [made("not", task, 0, None, "not for these robots")]
    table = score_table(results_frame(rows)).set_index("method")
    assert table.index[:2].tolist() == ["good", "least_squares"], "fewer tasks are last"
    scores = table.score.dropna().to_dict()
    assert scores == {"good": pytest.approx(0.5), "least_squares": 1}
    assert table.failures[table.failures > 0].to_dict() == {"other": 1}


def test_the_interval_covers_and_the_test_errs_as_often_as_they_say():
    """Two robots, two sizes, three seeds: 95 % of intervals hold the truth."""
    rng, held, wrong = np.random.default_rng(3), 0, 0
    index = pd.MultiIndex.from_product(
        [["a", "b"], [0, 1, 2]], names=["robots", "seed"]
    )
    for _ in range(1000):
        shared = pd.Series(rng.standard_normal(6) * ([1.0] * 3 + [2.0] * 3), index)
        logs = pd.concat(
            {f"task{n}": shared + 0.3 * rng.standard_normal(6) for n in (1, 2)},
            names=["task"],
        ).reorder_levels(["robots", "task", "seed"])
        mean = mean_of(logs)
        held += mean.interval.low < 1 < mean.interval.high
        wrong += mean.p < 0.05
    assert 930 <= held <= 980 and wrong == 1000 - held


def test_a_group_is_scored_where_all_its_tasks_are(frame):
    names = sorted(frame.task.unique())
    short = frame[(frame.method != "good") | (frame.task != names[0])]
    groups = {"first": names[:2], "rest": names[2:], "none": ["no task"]}
    table = scores_by_group(short, groups)
    assert table.index.tolist() == ["least_squares", "bad", "good"]
    assert not len(scores_by_group(frame[:0], groups))
    assert table.loc["good", "first"] is None and table["none"].isna().all()
    rest = score_table(frame[frame.task.isin(names[2:])]).set_index("method")
    score = tuple(rest.loc["good", ["score", "low", "high"]])
    assert table.loc["good", "rest"] == score
    # the interval of one task is over its seeds
    logs = logs_by_hand(frame, names[0], "bad")
    reach = stats.t.ppf(0.975, len(logs) - 1) * stats.sem(logs)
    found = scores_by_group(frame, {"one": names[:1]}).loc["bad", "one"]
    ends = [logs.mean(), logs.mean() - reach, logs.mean() + reach]
    assert np.log(found) == pytest.approx(ends)


def test_who_is_apart_is_corrected_for_all_pairs(frame):
    pairs = pairwise(frame)
    assert len(pairs) == 3 and pairs.apart.all()
    best = pairs[(pairs["first"] == "good") & (pairs.second == "bad")]
    assert best.ratio.iloc[0] == pytest.approx(0.25, rel=0.1)
    corrected = holm(np.array([0.01, 0.04, 0.03]))
    assert corrected == pytest.approx([0.03, 0.06, 0.06])


@pytest.mark.parametrize(
    ("alone", "loss", "expected"),
    [
        ([1.0, 0.2, 0.05], 0.1, (2.0, "")),  # half the loss is worth twice the data
        ([1.0, 0.5, 0.2], 0.1, (4.0, ">")),  # 20 minutes alone do not reach it
        ([1.0, 0.5, 0.2], 2.0, (0.2, "<")),
        ([1.0, 0.5, 0.55], 0.5, (1.0, "")),  # no more than the size that reached it
    ],
)
def test_a_data_ratio_is_read_on_the_curve_of_training_alone(alone, loss, expected):
    results = []
    for minutes, value in zip((1.0, 5.0, 20.0), alone, strict=True):
        task = task_of("robot", minutes)
        results.append(made("novice_only", task, 0, value))
        results.append(made("other", task, 0, loss))
    frame = results_frame(results)
    assert data_ratio(frame, "other") == (pytest.approx(expected[0]), expected[1])
    assert np.isnan(data_ratio(frame, "none")[0])


def test_the_page_holds_every_row(frame, tmp_path):
    write_page(frame, tmp_path / "page.html")
    page = (tmp_path / "page.html").read_text()
    _, _, rest = page.partition('type="application/json">')
    data = json.loads(rest[: rest.index("</script>")])
    assert len(data["rows"]) == len(frame)
    (group,) = data["groups"]
    methods = [row["method"] for row in group["methods"]]
    assert methods == ["good", "least_squares", "bad"]
    assert len(group["tasks"]["values"][0]) == len(group["names"]) == 5
    assert "http://" not in page and "https://" not in page


def test_the_figure_has_a_plot_for_each_group_and_a_number_for_each_dot():
    groups = ["held struts, 5 min", "two real robots"]
    scores = pd.DataFrame(None, index=["sidm", "trees"], columns=groups, dtype=object)
    scores.at["sidm", "held struts, 5 min"] = Interval(1.23, 1.1, 1.3)
    scores.at["trees", "held struts, 5 min"] = Interval(0.9, 0.8, 1.0)
    scores.at["trees", "two real robots"] = Interval(1.0, 0.8, 1.2)
    drawn = figure(scores, ["sidm", "trees", "gp"])
    assert [axes.get_title(loc="left") for axes in drawn.axes] == groups
    labels = [label.get_text() for label in drawn.axes[0].get_yticklabels()]
    heads = ["novice's drives alone", "with the expert's drives"]
    assert labels == [heads[0], "boosted trees", heads[1], "SIDM"]
    assert [t.get_text() for t in drawn.axes[0].texts] == ["0.90", "1.2"]
    (empty,) = figure(pd.DataFrame(), ["sidm"]).axes
    assert empty.texts[0].get_text() == "no trials stored"
