"""A comparison by cross-validation: its splits, its intervals and what it says."""

import dataclasses

import numpy as np
import pandas as pd
import pytest

import ownrobot
import sidm
from ownrobot import __main__ as command_line
from ownrobot.comparison import run, store
from ownrobot.comparison.plan import Fit, drives_of, plan_for
from ownrobot.comparison.result import Comparison, FitResult
from ownrobot.comparison.statistics import (
    Interval,
    resampled_loss,
    resampled_mean,
    resampled_ratio,
)
from ownrobot.recordings import write_drives
from sidm.config import ConfigError, Notice
from tests.ownrobot.cart import cart_drive

QUICK = {"methods": ["mean", "least_squares"], "repeats": 2}


def cart_drives(sessions=8, drives=3, steps=20):
    rng = np.random.default_rng(0)
    return [
        cart_drive(rng, steps, f"{session}", f"{session}/{number}")
        for session in range(sessions)
        for number in range(drives)
    ]


@pytest.fixture(scope="module")
def drives():
    return cart_drives()


@pytest.fixture(scope="module")
def comparison(drives):
    return ownrobot.compare(drives, **QUICK)


def sessions(drives):
    return {drive.session for drive in drives}


def test_no_session_stands_on_both_sides_and_repeats_differ(drives):
    plan = plan_for(drives, None, ["mean"])
    first = set()
    for repeat in range(plan.repeats):
        held_out = []
        for fold in range(plan.folds):
            whole, half = (
                drives_of(plan, Fit("mean", repeat, fold, share), drives)
                for share in (1.0, 0.5)
            )
            assert not sessions(whole.learn) & sessions(whole.held_out)
            assert len(sessions(half.learn) & sessions(whole.learn)) == 3  # of 6
            assert half.held_out == whole.held_out
            held_out += [drive.name for drive in whole.held_out]
        assert sorted(held_out) == sorted(drive.name for drive in drives)
        first.add(held_out[0])
    assert len(first) > 1


def test_what_is_compared_by_default_can_learn_the_robot(drives):
    alone = set(plan_for(drives, None).methods)
    assert {"least_squares", "gp"} <= alone and "sidm" not in alone
    assert "rotation_centres" not in alone  # a cart has no wheel speeds
    corrections = {"corrected", "least_squares_corrected", "trees_corrected"}
    both = set(plan_for(drives, drives).methods)
    assert {"sidm", "pretrain_finetune"} | corrections | alone <= both


def test_the_table_is_that_of_fits_by_hand(drives, comparison):
    losses = []
    for fit in (Fit("least_squares", r, f, 1.0) for r in (0, 1) for f in range(4)):
        learn, held_out = drives_of(comparison.plan, fit, drives)
        losses.append(ownrobot.fit(learn, seed=fit.repeat).loss(held_out))
    assert comparison.losses("least_squares") == pytest.approx(losses)
    row = comparison.table.iloc[0]
    assert row.method == "least_squares" and row.loss == pytest.approx(np.mean(losses))
    assert row.low < row.loss < row.high and row.ratio == 1
    assert comparison.ratio("mean", "least_squares").low > 1
    assert (comparison.table.position > 0).all()
    assert len(comparison.curve) == 2 * 3
    errors = comparison.errors("least_squares").set_index("quantity")
    assert (errors.loc["speed"].rmse < errors.loc["speed"]["mean"]).all()


def test_an_interval_knows_that_folds_share_data():
    """The interval covers the loss on new data; a plain standard error is too small.

    A slope is learnt from 30 of 40 points and evaluated on the others, in three repeats
    of four folds. The variance of the noise is 1, so the loss on new data is 1 + 1/30.
    """
    rng = np.random.default_rng(0)
    within = plain = ratios = 0
    trials, true = 400, 1 + 1 / 30
    orders = [np.random.default_rng(repeat).permutation(40) for repeat in range(3)]
    parts = [order[fold::4] for order in orders for fold in range(4)]
    for _ in range(trials):
        x = rng.normal(0, 1, 40)
        y = 0.5 * x + rng.normal(0, 1, 40)
        losses, zeros = np.zeros((2, 12))
        for number, held_out in enumerate(parts):
            learnt = np.setdiff1d(np.arange(40), held_out)
            slope = (x[learnt] @ y[learnt]) / (x[learnt] @ x[learnt])
            losses[number] = np.mean((y[held_out] - slope * x[held_out]) ** 2)
            zeros[number] = np.mean(y[held_out] ** 2)
        interval = resampled_loss(losses, folds=4)
        within += 0 < interval.low < true < interval.high
        error = losses.std(ddof=1) / np.sqrt(12)
        plain += abs(losses.mean() - true) < 2.2 * error
        ratio = resampled_ratio(losses, zeros, folds=4)
        ratios += ratio.low < true / 1.25 < ratio.high  # predicting 0 costs 1.25
    assert min(within, ratios) / trials > 0.9 and plain / trials < 0.8
    paired = resampled_ratio(1.5 * zeros, zeros, folds=4)
    assert paired == pytest.approx((1.5, 1.5, 1.5))
    assert resampled_mean(np.array([2.0]), 4).text(3) == "2.00"


@pytest.mark.parametrize(
    ("ends", "text"),
    [
        ((8.64, 3.6, 21.2), "8.6 (3.6 to 21)"),
        ((124, 99.6, 1234), "120 (100 to 1200)"),
        ((-0.464, -0.817, -0.0031), "−0.46 (−0.82 to −0.0031)"),
        ((-0.277, -0.557, 0.0031), "−0.28 (−0.56 to 0.00)"),  # no finer than its reach
        ((-0.004, -0.11, 0.14), "0.00 (−0.11 to 0.14)"),
        ((0.0, 0.0, 0.0), "0 (0 to 0)"),
        ((0.5, np.nan, np.nan), "0.50"),
    ],
)
def test_an_interval_is_as_precise_as_it_is_known(ends, text):
    assert str(Interval(*ends)) == text


NOISE = 0.02 * np.random.default_rng(0).standard_normal((3, 2, 8))


def made_comparison(losses):
    """A comparison with losses: method -> of half and of all data, and their spread."""
    plan = plan_for(cart_drives(), None, list(losses), 4, 2, [0.5, 1.0])
    results = []
    for (method, (half, whole, spread)), noise in zip(
        losses.items(), NOISE, strict=False
    ):
        values = np.array([half, whole])[:, None] * np.exp(spread * noise)
        for fit in plan.fits():
            if fit.method == method:
                row = values[int(fit.share), 4 * fit.repeat + fit.fold]
                one = {"drive": "a", "session": "a", "steps": 10, "loss": row}
                one = pd.DataFrame([one | {"mean": np.nan, "worst": "x"}])
                about = (fit.share, 1.0, one, pd.DataFrame(), np.zeros((1, 4)))
                results.append(FitResult(fit, *about))
    return Comparison(plan, results, (), [])


@pytest.mark.parametrize(
    ("losses", "method", "words"),
    [
        (
            {"mean": (1, 1, 0), "least_squares": (0.6, 0.5, 1)},
            "least_squares",
            ("Take least_squares", "times that of mean", "more data would help"),
        ),
        (
            {"least_squares": (0.5, 0.5, 1), "novice_only": (0.5, 0.499, 1)},
            "least_squares",
            ("simplest of those not surely apart", "is not sure"),
        ),
        (
            {"mean": (1, 1, 0), "novice_only": (1, 1, 9)},
            "mean",
            ("No method is surely better than 'mean'",),
        ),
        (  # least squares are not surely worse than trees, nor better than no change
            {
                "nothing_changes": (1, 1, 1),
                "least_squares": (1, 0.9, 30),
                "trees": (0.8, 0.75, 1),
            },
            "trees",
            ("Take trees", "times that of nothing_changes"),
        ),
    ],
)
def test_one_sentence_says_which_and_by_how_much(losses, method, words):
    verdict = made_comparison(losses).verdict
    assert verdict.method == method
    assert all(word in verdict.sentence for word in words), verdict.sentence
    assert "\n" not in verdict.sentence


def test_an_interrupted_comparison_goes_on(drives, comparison, tmp_path, monkeypatch):
    """No fit is done twice, and the result is that of one run; files may move."""
    done, real = [], run._fitted

    def counted(task, fit):
        if len(done) == 5:
            raise KeyboardInterrupt
        done.append(fit)
        return real(task, fit)

    monkeypatch.setattr(run, "_fitted", counted)
    with pytest.raises(KeyboardInterrupt):
        ownrobot.compare(drives, folder=tmp_path, **QUICK)
    again = []
    monkeypatch.setattr(
        run, "_fitted", lambda task, fit: again.append(fit) or real(task, fit)
    )
    moved = [dataclasses.replace(d, name=f"moved/{d.name}") for d in drives]
    resumed = ownrobot.compare(moved, folder=tmp_path, **QUICK)
    assert len(again) == len(resumed.plan.fits()) - 5 and not set(again) & set(done)
    plain = comparison.table.drop(columns="seconds")
    pd.testing.assert_frame_equal(resumed.table.drop(columns="seconds"), plain)
    assert resumed.drive_losses("mean").drive.str.startswith("moved/").all()
    resumed.report(tmp_path / "report.html")
    for path in (tmp_path / "fits").iterdir():  # a damaged result is made again
        path.write_text(path.read_text()[:50])
    again.clear()
    ownrobot.compare(drives, folder=tmp_path, **QUICK)
    assert len(again) == len(resumed.plan.fits())


def test_other_drives_settings_or_code_have_other_results(
    drives, tmp_path, monkeypatch
):
    plan = plan_for(drives, None, ["least_squares"])
    task = run.Task(plan, drives, None, run.settings_with(), tmp_path)
    moved = dataclasses.replace(drives[0], states=drives[0].states + 0.1)
    over = [
        dataclasses.replace(moved, ground=sidm.Ground(np.full((4, 4), height), 0.5))
        for height in (0.0, 0.1)
    ]
    tasks = [
        *(
            task._replace(novice=[one, *drives[1:]])
            for one in (drives[0], moved, *over)
        ),
        task._replace(expert=drives),
        task._replace(settings=run.settings_with(values={"hidden": 8})),
        task._replace(plan=plan._replace(seed=1)),
        task._replace(plan=plan._replace(folds=3)),
    ]
    fit = plan.fits()[0]
    files = {store.file_of(each, fit) for each in tasks}
    assert len(files) == len(tasks) and store.file_of(task, fit) in files
    for changed in ("source_digest", "library_versions"):
        monkeypatch.setattr(store, changed, lambda *_: "another")
        files.add(store.file_of(task, fit))
    assert len(files) == len(tasks) + 2


def test_what_cannot_be_compared_is_one_line(drives):
    for how, words in (
        ({"methods": ["sidm"]}, "learns from an expert's drives too"),
        ({"folds": 1}, "folds must be at least 2"),
        ({"repeats": 0}, "repeats must be at least 1"),
        ({"shares": [0.0]}, "shares are above 0"),
        ({"workers": 0}, "workers must be at least 1"),
        ({"expert_body": "robot.yaml"}, "expert_body is given, but there is no exp"),
        ({"novice": cart_drives(1, 1)}, "a single drive leaves none to evaluate on"),
    ):
        with pytest.raises(ConfigError, match=words):
            ownrobot.compare(**{"novice": drives} | how)


def test_the_command_writes_tables_and_a_report(drives, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_drives("drives.csv", drives, "tests")
    body = "name: cart\npose: planar\ncolumns: {speed: m/s}\nactions: {throttle: 1}\n"
    (tmp_path / "robot.yaml").write_text(body)
    words = "compare drives.csv --body robot.yaml --methods mean least_squares"
    assert command_line.main([*words.split(), "--repeats", "1", "--workers", "2"]) == 0
    assert "Take least_squares" in capsys.readouterr().out
    table = pd.read_csv("comparison/comparison.csv")
    assert table.method.tolist() == ["least_squares", "mean"]
    assert len(pd.read_csv("comparison/learning-curve.csv")) == 6
    page = (tmp_path / "comparison" / "report.html").read_text()
    assert "Take least_squares" in page and page.count("<svg") >= 3
    assert "<iframe" in page  # the replay of the worst drive
    for outside in ('src="http', 'href="http', "url(http", "@import"):
        assert outside not in page


def test_a_method_that_learns_nothing_has_a_level_learning_curve(drives):
    """The losses of all shares are weighted alike; drives need no names."""
    unnamed = [dataclasses.replace(drive, name="") for drive in drives]
    level = ownrobot.compare(unnamed, methods=["nothing_changes"], repeats=1)
    assert level.curve.loss.to_numpy() == pytest.approx(3 * [level.curve.loss[0]])
    assert level.drive_losses("nothing_changes").drive.nunique() == len(drives)


def test_what_may_surprise_is_noted_and_stands_in_the_report(drives, tmp_path):
    """Few sessions are held out in one way; a quarter of them is too few to learn."""
    few = cart_drives(3, 1)
    with pytest.warns(Notice, match="3 sessions .*: 1 repeat, not 2"):
        found = ownrobot.compare(few, drives, settings={"hidden": 8}, **QUICK)
    found.report(tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text()
    for words in (
        "with 25% of the data",
        "1 repeat, not 2",
        "none of the methods learns from the expert",
        "hidden: without effect on mean, least_squares",
        "3 fits are too few to compare methods: record more sessions",
    ):
        assert words in page
    assert 0.25 not in set(found.curve.share)


def test_pretrained_weights_are_those_of_the_settings(drives, monkeypatch):
    """Folds share them, other settings do not; a fit's seconds include them."""
    made = []

    def pretrained(data, method):
        made.append(data.settings.training.max_samples)

    monkeypatch.setattr(run, "pretrained", pretrained)
    monkeypatch.setattr(run, "_STARTS", {})
    plan = plan_for(drives, drives, ["expert_only"])
    found = []
    for samples in (200, 200, 6000):
        settings = run.settings_with(values={"max_samples": samples})
        task = run.Task(plan, drives, drives, settings, None)
        found.append(run._start(task, "expert_only", drives, 0))
    assert made == [200, 6000] and found[0] == found[1] and found[0][1] > 0
