"""A comparison by cross-validation: its splits, its intervals and what it says."""

import dataclasses

import numpy as np
import pandas as pd
import pytest

import ownrobot
import sidm
from ownrobot import __main__ as command_line
from ownrobot.comparison import run
from ownrobot.comparison.plan import Fit, drives_of, plan_for
from ownrobot.comparison.result import Comparison, FitResult
from ownrobot.comparison.statistics import (
    resampled_loss,
    resampled_mean,
    resampled_ratio,
)
from ownrobot.fitting.score import DriveLosses
from ownrobot.recordings import write_drives
from sidm.body import Body
from sidm.config import ConfigError
from sidm.drives import Drive
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


def test_no_session_stands_on_both_sides(drives):
    plan = plan_for(drives, None, ["mean"])
    for repeat in range(plan.repeats):
        held_out = []
        for fold in range(plan.folds):
            whole, half, quarter = (
                drives_of(plan, Fit("mean", repeat, fold, share), drives)
                for share in (1.0, 0.5, 0.25)
            )
            assert not sessions(whole.learn) & sessions(whole.held_out)
            assert sessions(whole.learn) > sessions(half.learn)
            assert sessions(half.learn) > sessions(quarter.learn)
            assert len(sessions(half.learn)) == 3  # of 6
            assert half.held_out == whole.held_out
            held_out += [drive.name for drive in whole.held_out]
        assert sorted(held_out) == sorted(drive.name for drive in drives)


def test_repeats_divide_the_sessions_anew():
    drives = cart_drives(16, drives=1)
    plan = plan_for(drives, None, ["mean"])
    first, second = (
        sessions(drives_of(plan, Fit("mean", repeat, 0, 1.0), drives).held_out)
        for repeat in (0, 1)
    )
    assert first != second


def test_what_is_compared_by_default_can_learn_the_robot(drives):
    alone = plan_for(drives, None).methods
    assert {"least_squares", "gp"} <= set(alone) and "sidm" not in alone
    assert "rotation_centres" not in alone  # a cart has no wheel speeds
    both = plan_for(drives, drives).methods
    corrections = {"corrected", "least_squares_corrected", "trees_corrected"}
    assert {"sidm", "pretrain_finetune", *corrections, *alone} <= set(both)
    lever = Body(
        name="lever",
        pose="none",
        columns=(("speed", "m/s"),),
        actions=(("throttle", "1"),),
    )
    expert = [
        Drive(drive.states[:, 3:], drive.actions, lever, name=drive.name)
        for drive in drives
    ]
    other = plan_for(drives, expert).methods
    assert {"sidm", "core_finetune"} <= set(other)
    assert not {"pretrain_finetune", *corrections} & set(other)


def test_the_table_is_that_of_fits_by_hand(drives, comparison):
    """The loss of a fold is that of a model which has not seen the fold."""
    plan = comparison.plan
    losses = []
    for fit in (Fit("least_squares", r, f, 1.0) for r in (0, 1) for f in range(4)):
        learn, held_out = drives_of(plan, fit, drives)
        model = ownrobot.fit(learn, method="least_squares", seed=fit.repeat)
        losses.append(model.loss(held_out))
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
    for _ in range(trials):
        x = rng.normal(0, 1, 40)
        y = 0.5 * x + rng.normal(0, 1, 40)
        losses, zeros = [], []
        for repeat in range(3):
            order = np.random.default_rng(repeat).permutation(40)
            for fold in range(4):
                held_out = order[fold::4]
                learnt = np.setdiff1d(order, held_out)
                slope = (x[learnt] @ y[learnt]) / (x[learnt] @ x[learnt])
                losses.append(np.mean((y[held_out] - slope * x[held_out]) ** 2))
                zeros.append(np.mean(y[held_out] ** 2))
        interval = resampled_loss(np.array(losses), folds=4)
        within += 0 < interval.low < true < interval.high
        error = np.std(losses, ddof=1) / np.sqrt(len(losses))
        plain += abs(np.mean(losses) - true) < 2.2 * error
        ratio = resampled_ratio(np.array(losses), np.array(zeros), folds=4)
        ratios += ratio.low < true / 1.25 < ratio.high  # predicting 0 costs 1.25
    assert min(within, ratios) / trials > 0.9
    assert plain / trials < 0.8


def test_a_ratio_is_paired():
    rng = np.random.default_rng(0)
    second = np.exp(rng.normal(0, 2, 12))
    ratio = resampled_ratio(1.5 * second, second, folds=4)
    assert ratio == pytest.approx((1.5, 1.5, 1.5))
    assert resampled_mean(np.array([2.0]), 4).text(3) == "2.00"


def made_comparison(losses, minutes=(1.0, 2.0), folds=4, repeats=2):
    """A comparison with these losses (method -> two shares of (n,) losses)."""
    plan = plan_for(cart_drives(), None, list(losses), folds, repeats, [0.5, 1.0])
    table = pd.DataFrame(
        columns=["prediction", "quantity", "horizon", "unit", "rmse"]
        + ["average", "median", "nothing_changes", "mean"]
    )
    results = []
    for method, parts in losses.items():
        for share, values, of_minutes in zip((0.5, 1.0), parts, minutes, strict=True):
            for number, value in enumerate(values):
                fit = Fit(method, number // folds, number % folds, share)
                one = DriveLosses(
                    np.array([[value]]),
                    None,
                    np.array([10]),
                    np.array(["a"]),
                    np.array(["a"]),
                )
                about = (of_minutes, 1.0, one, table, "a", np.zeros((1, 4)))
                results.append(FitResult(fit, *about))
    return Comparison(plan, results, (), [])


NOISE = np.exp(0.02 * np.random.default_rng(0).standard_normal((4, 8)))


@pytest.mark.parametrize(
    ("losses", "method", "words"),
    [
        (
            {
                "mean": (1 + 0 * NOISE[0], 1 + 0 * NOISE[0]),
                "least_squares": (0.6 * NOISE[0], 0.5 * NOISE[1]),
                "novice_only": (0.9 * NOISE[2], 0.8 * NOISE[3]),
            },
            "least_squares",
            ("0.4", "times that of mean", "novice_only", "more data would help"),
        ),
        (
            {
                "least_squares": (0.5 * NOISE[0], 0.5 * NOISE[1]),
                "novice_only": (0.5 * NOISE[2], 0.499 * NOISE[3]),
            },
            "least_squares",
            ("simplest of those not surely apart", "is not sure"),
        ),
        (
            {
                "mean": (1 + 0 * NOISE[0], 1 + 0 * NOISE[0]),
                "novice_only": (NOISE[0] ** 9, NOISE[1] ** 9),
            },
            "mean",
            ("No method is surely better than 'mean'",),
        ),
        (  # least squares are not surely worse than trees, nor better than no change
            {
                "nothing_changes": (NOISE[0], NOISE[0]),
                "least_squares": (NOISE[1] ** 30, 0.9 * NOISE[1] ** 30),
                "trees": (0.8 * NOISE[2], 0.75 * NOISE[2]),
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


def test_two_fits_decide_nothing():
    losses = {
        "least_squares": (NOISE[0][:2], 0.5 * NOISE[1][:2]),
        "mean": (2 + NOISE[2][:2], 2 + NOISE[3][:2]),
    }
    verdict = made_comparison(losses, folds=2, repeats=1).verdict
    assert verdict.method == "least_squares" and verdict.others == ("mean",)
    assert "2 fits are too few" in verdict.sentence
    assert "Take" not in verdict.sentence


def test_an_interrupted_comparison_goes_on(drives, tmp_path, monkeypatch):
    """No fit is done twice, and the result is that of one run."""
    done = []
    real = run._fitted

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
    resumed = ownrobot.compare(drives, folder=tmp_path, **QUICK)
    assert len(again) == len(resumed.plan.fits()) - 5 and not set(again) & set(done)
    plain = ownrobot.compare(drives, **QUICK).table.drop(columns="seconds")
    pd.testing.assert_frame_equal(resumed.table.drop(columns="seconds"), plain)
    for path in (tmp_path / "fits").iterdir():  # a damaged result is made again
        path.write_text(path.read_text()[:50])
    again.clear()
    ownrobot.compare(drives, folder=tmp_path, **QUICK)
    assert len(again) == len(resumed.plan.fits())


def test_other_drives_or_settings_have_other_results(drives):
    plan = plan_for(drives, None, ["least_squares"])
    settings = run.settings_with()
    task = run.Task(plan, drives, None, settings, None)
    fit = plan.fits()[0]
    moved = dataclasses.replace(drives[0], states=drives[0].states + 0.1)
    others = [
        task._replace(novice=[moved, *drives[1:]]),
        task._replace(expert=drives),
        task._replace(settings=run.settings_with(values={"hidden": 8})),
        task._replace(plan=plan._replace(seed=1)),
        task._replace(plan=plan._replace(folds=3)),
    ]
    keys = {run.key_of(each, fit) for each in (task, *others)}
    assert len(keys) == 6 and run.key_of(task, fit) in keys


@pytest.mark.parametrize("changed", ["source_digest", "library_versions"])
def test_other_code_or_libraries_have_other_results(drives, monkeypatch, changed):
    plan = plan_for(drives, None, ["least_squares"])
    task, fit = run.Task(plan, drives, None, run.settings_with(), None), plan.fits()[0]
    before = run.key_of(task, fit)
    assert run.key_of(task, fit) == before
    monkeypatch.setattr(run, changed, lambda *_: "another")
    assert run.key_of(task, fit) != before


def test_a_fit_with_too_little_data_is_left_out_with_a_note():
    few = cart_drives(5, drives=1)
    with pytest.warns(sidm.config.Notice, match="with 25% of the data: .*too few"):
        comparison = ownrobot.compare(few, methods=["mean", "least_squares"], repeats=1)
    assert comparison.methods and comparison.notes
    assert 0.25 not in set(comparison.curve.share)


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ({"methods": ["leest_squares"]}, "did you mean 'least_squares'"),
        ({"methods": ["sidm"]}, "learns from an expert's drives too"),
        ({"folds": 1}, "folds must be at least 2"),
        ({"repeats": 0}, "repeats must be at least 1"),
        ({"shares": [0.0]}, "shares are above 0"),
        ({"workers": 0}, "workers must be at least 1"),
        ({"novice": 0}, "a single drive leaves none to evaluate on"),
    ],
)
def test_what_cannot_be_compared_is_one_line(drives, how, words):
    novice = drives[:1] if "novice" in how else drives
    how = {name: value for name, value in how.items() if name != "novice"}
    with pytest.raises(ConfigError, match=words):
        ownrobot.compare(novice, **how)


def test_the_command_writes_tables_and_a_report(drives, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_drives("drives.csv", drives, "tests")
    body = "name: cart\npose: planar\ncolumns: {speed: m/s}\nactions: {throttle: 1}\n"
    (tmp_path / "robot.yaml").write_text(body)
    words = "compare drives.csv --body robot.yaml --methods mean least_squares"
    assert command_line.main([*words.split(), "--repeats", "1", "--workers", "2"]) == 0
    said = capsys.readouterr().out
    assert "Take least_squares" in said
    table = pd.read_csv("comparison/comparison.csv")
    assert table.method.tolist() == ["least_squares", "mean"]
    assert len(pd.read_csv("comparison/learning-curve.csv")) == 6
    page = (tmp_path / "comparison" / "report.html").read_text()
    assert "Take least_squares" in page and page.count("<svg") >= 3
    assert "<iframe" in page  # the replay of the worst drive
    for outside in ('src="http', 'href="http', "url(http", "@import"):
        assert outside not in page


def test_a_method_that_learns_nothing_has_a_level_learning_curve(drives):
    """The losses of all shares are weighted alike."""
    comparison = ownrobot.compare(
        drives, methods=["nothing_changes", "mean"], repeats=1
    )
    still = comparison.curve[comparison.curve.method == "nothing_changes"]
    assert still.loss.to_numpy() == pytest.approx(3 * [still.loss.iloc[0]], rel=1e-6)


def test_few_sessions_are_held_out_in_one_way():
    with pytest.warns(sidm.config.Notice, match="3 sessions .*: 1 repeat, not 2"):
        comparison = ownrobot.compare(cart_drives(3), **QUICK, shares=[1])
    assert comparison.plan.folds == 3 and comparison.plan.repeats == 1
    assert any("1 repeat, not 2" in note for note in comparison.notes)
    assert "3 fits are too few to compare methods: record more sessions" in str(
        comparison.verdict
    )


def test_pretrained_weights_are_those_of_the_settings(drives, monkeypatch):
    """Folds share them, other settings do not; a fit's seconds include them."""
    made = []

    def pretrained(learn, expert, method, settings, seed):
        made.append(settings.training.max_samples)
        return None

    monkeypatch.setattr(run, "pretrained", pretrained)
    monkeypatch.setattr(run, "_STARTS", {})
    plan = plan_for(drives, drives, ["expert_only"])
    found = []
    for samples in (200, 200, 6000):
        settings = run.settings_with(values={"max_samples": samples})
        task = run.Task(plan, drives, drives, settings, None)
        found.append(run._start(task, "expert_only", drives, 0))
    assert made == [200, 6000] and found[0] == found[1] and found[0][1] > 0


def test_files_may_move_while_a_comparison_is_interrupted(drives, tmp_path):
    first = ownrobot.compare(drives, folder=tmp_path, **QUICK)
    stored = {path: path.read_text() for path in (tmp_path / "fits").iterdir()}
    moved = [dataclasses.replace(d, name=f"moved/{d.name}") for d in drives]
    again = ownrobot.compare(moved, folder=tmp_path, **QUICK)
    assert {path: path.read_text() for path in stored} == stored  # no fit was done
    pd.testing.assert_frame_equal(again.table, first.table)
    assert again.drive_losses("mean").drive.str.startswith("moved/").all()
    again.report(tmp_path / "report.html")


def test_drives_without_names_are_told_apart(drives):
    unnamed = [dataclasses.replace(drive, name="") for drive in drives]
    comparison = ownrobot.compare(unnamed, methods=["mean"], repeats=1, shares=[1])
    assert comparison.drive_losses("mean").drive.nunique() == len(drives)


def test_other_ground_has_other_results(drives):
    def key(height):
        ground = sidm.Ground(np.full((4, 4), height), spacing=0.5)
        over = [dataclasses.replace(drive, ground=ground) for drive in drives]
        plan = plan_for(over, None, ["mean"])
        return run.key_of(run.Task(plan, over, None, run.settings_with(), None), fit)

    fit = Fit("mean", 0, 0, 1.0)
    assert key(0.0) == key(0.0) != key(0.1)


def test_no_method_with_all_fits_is_one_line():
    """One session is too short to learn from, the other is not."""
    short = cart_drives(1, drives=1, steps=15)
    long = [dataclasses.replace(d, session="b") for d in cart_drives(1, drives=8)]
    with (
        pytest.warns(sidm.config.Notice),
        pytest.raises(ConfigError, match="with 100% of the data"),
    ):
        ownrobot.compare([*short, *long], methods=["least_squares"], shares=[1])


def test_errors_after_a_second_are_not_those_of_another_horizon():
    """Drives of 8 steps are followed for less."""
    comparison = ownrobot.compare(
        cart_drives(8, drives=6, steps=10), methods=["mean"], repeats=1, shares=[1]
    )
    assert "position" not in comparison.table and len(comparison.errors("mean"))
    assert "after 1 s" not in comparison.text()
