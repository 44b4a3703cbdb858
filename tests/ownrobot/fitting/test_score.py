"""The loss that `ownrobot fit` prints is that of drives the model has not seen."""

from pathlib import Path

import numpy as np
import pytest

import ownrobot
from ownrobot import __main__ as command_line
from ownrobot.fitting.score import DriveLosses, standard_error
from ownrobot.fitting.splits import evaluation_splits
from ownrobot.recordings import read_drives, write_drives
from sidm.config import ConfigError

RECORDINGS = Path(__file__).parents[3] / "recordings"
BODY, WARTHOG = RECORDINGS / "skid_steer.yaml", RECORDINGS / "warthog.csv.gz"
QUICK = dict(method="least_squares")


@pytest.fixture(scope="module")
def drives():
    return read_drives(WARTHOG, BODY)


def sessions(drives):
    return {drive.session for drive in drives}


def names(drives):
    return {drive.name for drive in drives}


def test_held_out_sessions_are_never_learnt(drives):
    ((learnt, held_out),) = evaluation_splits(drives, 0.25, seed=0)
    assert not sessions(learnt) & sessions(held_out)
    assert names(learnt) | names(held_out) == names(drives)
    assert len(sessions(held_out)) == 24  # of 96
    ((_, other),) = evaluation_splits(drives, 0.25, seed=1)
    assert sessions(other) != sessions(held_out)


def test_few_sessions_are_each_held_out_once(drives):
    few = drives[:20]
    splits = evaluation_splits(few, 0.25, seed=0)
    assert len(sessions(few)) == 7 and len(splits) == 4
    held_out = [name for _, part in splits for name in names(part)]
    assert sorted(held_out) == sorted(names(few))
    assert not any(sessions(learnt) & sessions(part) for learnt, part in splits)
    assert evaluation_splits(drives[:1], 0.25, seed=0) == []


def test_what_fit_says_is_what_evaluate_says(drives, tmp_path):
    """The score belongs to drives that do not change the model."""
    ((learnt, held_out),) = evaluation_splits(drives, 0.25, seed=0)
    model = ownrobot.fit(drives, test=0.25, out=tmp_path, **QUICK)
    assert ownrobot.load(tmp_path).score(held_out) == model.held_out
    assert model.held_out.loss == model.loss(held_out)
    given = ownrobot.fit(learnt, test=held_out, **QUICK)
    assert given.held_out == model.held_out
    assert ownrobot.fit(learnt, **QUICK).held_out is None
    assert model.held_out.loss < model.held_out.mean_loss


def test_folds_judge_models_and_the_model_learns_from_all(drives):
    few = drives[:20]
    model = ownrobot.fit(few, test=0.25, **QUICK)
    assert (model.held_out.folds, model.held_out.drives) == (4, 20)
    losses = [
        ownrobot.fit(learnt, **QUICK).losses(held_out)
        for learnt, held_out in evaluation_splits(few, 0.25, seed=0)
    ]
    assert DriveLosses.joined(losses).score(4) == model.held_out
    assert model.loss(few) == ownrobot.fit(few, **QUICK).loss(few)


def test_the_standard_error_covers_the_loss_of_many_sessions():
    """Windows of a session are alike: the error is that of the sessions' number."""
    rng = np.random.default_rng(0)
    groups = np.repeat(np.arange(30), rng.integers(1, 9, 30))
    within = 0
    for _ in range(400):
        values = rng.normal(0, 1, 30)[groups] + rng.normal(0, 0.1, len(groups))
        within += abs(values.mean()) < 2 * standard_error(values, groups)
    assert 0.9 < within / 400 < 0.97
    assert standard_error(np.ones(3), np.array(["a", "a", "a"])) is None


def test_a_long_drive_counts_by_its_steps():
    """The score is the mean over steps, as if each step stood for itself."""
    rng = np.random.default_rng(1)
    steps = rng.integers(1, 9, 6)
    components = rng.random((6, 3))
    names = np.array([f"drive {number}" for number in range(6)])
    sessions = np.array(list("aabbcc"))
    score = DriveLosses(components, 2 * components, steps, names, sessions).score()
    single = np.repeat(components.sum(1), steps)
    assert score.loss == pytest.approx(single.mean())
    assert score.mean_loss == pytest.approx(2 * single.mean())
    error = standard_error(single, np.repeat(sessions, steps))
    assert score.standard_error == pytest.approx(error)
    assert (score.drives, score.sessions) == (6, 3)


@pytest.mark.parametrize("method", ["novice_only", "least_squares"])
def test_a_loaded_model_scores_as_before(drives, tmp_path, method):
    settings = {"max_samples": 4_000, "hidden": 8}
    model = ownrobot.fit(drives[:60], method=method, settings=settings, out=tmp_path)
    again = ownrobot.load(tmp_path).score(drives[60:])
    assert again == model.score(drives[60:])
    assert 0.1 < again.loss / again.mean_loss < 2


def test_the_command_names_its_drives(drives, tmp_path, capsys):
    out, other = str(tmp_path / "model"), tmp_path / "other.csv"
    write_drives(other, drives[200:], "tests")
    write_drives(tmp_path / "novice.csv", drives[:200], "tests")
    fit = f"fit --novice {tmp_path}/novice.csv --body {BODY} --out {out}"
    fit += " --method least_squares"
    assert command_line.main([*fit.split(), "--test", str(other)]) == 0
    said = capsys.readouterr().out
    picture = str(tmp_path / "picture.png")
    words = ["evaluate", out, str(other), "--figure", picture]
    assert command_line.main(words) == 0
    again = capsys.readouterr().out
    line = said.splitlines()[1].removeprefix("held out from learning: ")
    assert line.startswith("loss ") and "on 87 drives of" in line
    assert f"{out}: {line}\n" in again
    same = f"{fit} --test {tmp_path}/novice.csv"
    assert command_line.main(same.split()) == 2
    assert "which the model learns from" in capsys.readouterr().err


def test_a_single_drive_judges_nothing(tmp_path, capsys):
    body = RECORDINGS / "hunter.yaml"
    drive = max(read_drives(RECORDINGS / "hunter.csv.gz", body), key=len)
    write_drives(tmp_path / "one.csv", [drive], "tests")
    fit = f"fit --novice {tmp_path}/one.csv --body {body} --method least_squares"
    assert command_line.main([*fit.split(), "--out", str(tmp_path / "model")]) == 0
    assert "judge the model by others, with --test" in capsys.readouterr().out


@pytest.mark.parametrize("share", [0, 1, -0.5, 2.0])
def test_a_share_is_below_one(drives, share):
    with pytest.raises(ConfigError, match="a share below 1"):
        ownrobot.fit(drives, test=share, **QUICK)
