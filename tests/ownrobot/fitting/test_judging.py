"""What judges a model: splits of drives, their windows, losses and errors."""

import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

import ownrobot
from ownrobot.fitting.errors import ONE_STEP, OPEN_LOOP, score_of, standard_error
from ownrobot.fitting.model import WARM_UP, Model
from ownrobot.fitting.splits import (
    divided,
    evaluation_splits,
    folds,
    session_order,
    split,
    train_test_split,
)
from ownrobot.fitting.windows import common_length, cut
from ownrobot.methods.closed_form import Trivial
from ownrobot.recordings import read_drives
from sidm.config import ConfigError, replace
from sidm.drives import STEPS, Drive, Ground
from sidm.learning import windows_of
from sidm.settings import Network
from tests.ownrobot.cart import CART, cart_drive


def drive(session: str = "", steps: int = 10, name: str = "") -> Drive:
    actions = np.stack([np.arange(steps) / 1000, np.zeros(steps)], 1)
    return Drive(np.zeros((steps + 1, 13)), actions, session=session, name=name)


def names(drives) -> set[str]:
    return {one.name for one in drives}


@given(
    st.lists(st.sampled_from("abcdef"), min_size=2, max_size=20),
    st.floats(0.01, 1.0),
    st.integers(0, 99),
)
def test_no_split_divides_a_session(sessions, share, seed):
    """Of a single session, drives are held out."""
    drives = [drive(one, name=f"{n}") for n, one in enumerate(sessions)]
    parts = folds(drives, 3, seed)
    for learn, held_out in (split(drives, share, seed), *parts):
        assert learn and held_out and not names(learn) & names(held_out)
        assert names(learn) | names(held_out) == names(drives)
        if len(set(sessions)) > 1:
            assert not {one.session for one in learn} & {d.session for d in held_out}
    assert sum(len(part.held_out) for part in parts) == len(drives)
    order = session_order(drives, seed)
    if len(order) > 1:  # every fourth session stops the training, from the second on
        train, test = train_test_split(drives, order)
        assert {one.session for one in test} == set(order[1::4])
        assert len(train) + len(test) == len(drives)


def test_a_few_drives_of_one_session_are_divided():
    """A single long drive is parted, and no step of it is lost or used twice."""
    long = drive(steps=130)
    parts = divided([long], 20)
    steps = np.concatenate([part.actions for part in parts])
    assert np.array_equal(steps, long.actions)
    assert all(20 <= len(part) < 40 for part in parts)
    train, test = train_test_split(parts, session_order(parts, 0))
    assert (len(train), len(test)) == (4, 2)
    enough = [drive("a") for _ in range(4)]
    assert divided(enough, 5) == enough


def test_windows_are_those_that_a_simulated_robot_would_have(
    make_trajectories, small_terrain
):
    drives = make_trajectories(3, steps=STEPS)
    recorded = [
        replace(one, ground=Ground(one.ground.heights, small_terrain.spacing))
        for one in drives
    ]
    found, expected = windows_of(cut(recorded), 8), windows_of(drives, 8)
    assert torch.allclose(found.inputs, expected.inputs, atol=1e-6)  # float32
    assert torch.allclose(found.targets, expected.targets, atol=1e-6)
    maps = found.maps.float(), expected.maps.float()
    assert torch.allclose(*maps, atol=2e-3)  # float16


def test_short_drives_shorten_the_windows_only_if_they_are_many():
    for lengths, steps in (
        ([500, 12], 64),  # 12 of 512 steps are 2 %
        ([100, 12], 12),  # 12 of 112 steps are 11 %
        ([40, 40, 30, 2], 30),  # 2 of 112 steps are 2 %, 32 are 29 %
    ):
        drives = [drive(steps=length) for length in lengths]
        assert common_length(drives) == steps
        assert common_length([drive(steps=50)], drives) == min(50, steps)


def test_the_last_window_may_overlap_so_that_no_step_is_lost():
    windows = cut([drive(steps=150)], 64, overlap=True)
    starts = [round(1000 * window.actions[0, 0]) for window in windows]
    assert starts == [0, 64, 86] and {len(window) for window in windows} == {64}
    for steps, overlap in ((64, False), (75, True)):  # 75: no overlap is needed
        assert len(cut([drive(steps=150)], steps, overlap=overlap)) == 2
    with pytest.raises(ConfigError, match="no drive of .* has 65 steps"):
        cut(windows, 65)


RECORDINGS = Path(__file__).parents[3] / "recordings"
BODY, WARTHOG = RECORDINGS / "skid_steer.yaml", RECORDINGS / "warthog.csv.gz"


@pytest.fixture(scope="module")
def warthog():
    return read_drives(WARTHOG, BODY)


def test_what_fit_says_is_what_evaluate_says(warthog, tmp_path):
    """The score belongs to drives that do not change the model."""
    ((learnt, held_out),) = evaluation_splits(warthog, 0.25, seed=0)
    sessions, others = ({d.session for d in part} for part in (held_out, learnt))
    assert len(sessions) == 24 and len(others) == 72 and not sessions & others
    model = ownrobot.fit(warthog, test=0.25, out=tmp_path)
    assert ownrobot.load(tmp_path).score(held_out) == model.held_out
    assert model.held_out.loss == model.loss(held_out)
    given = ownrobot.fit(learnt, test=held_out)
    assert given.held_out == model.held_out
    assert ownrobot.fit(learnt).held_out is None
    assert model.held_out.loss < model.held_out.mean_loss


def test_few_sessions_judge_in_folds_and_the_model_learns_from_all(warthog):
    few = warthog[:20]  # of seven sessions
    splits = evaluation_splits(few, 0.25, seed=0)
    model = ownrobot.fit(few, test=0.25)
    assert (model.held_out.folds, model.held_out.drives) == (len(splits), 20) == (4, 20)
    losses = [ownrobot.fit(learnt).losses(held_out) for learnt, held_out in splits]
    assert score_of(pd.concat(losses, ignore_index=True), 4) == model.held_out
    assert model.loss(few) == ownrobot.fit(few).loss(few)
    assert evaluation_splits(warthog[:1], 0.25, seed=0) == []


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
    steps, losses, sessions = rng.integers(1, 9, 6), rng.random(6), list("aabbcc")
    table = {"session": sessions, "steps": steps, "loss": losses, "mean": 2 * losses}
    score = score_of(pd.DataFrame(table))
    single = np.repeat(losses, steps)
    assert score.loss == pytest.approx(single.mean())
    assert score.mean_loss == pytest.approx(2 * single.mean())
    error = standard_error(single, np.repeat(sessions, steps))
    assert score.standard_error == pytest.approx(error)
    assert (score.drives, score.sessions) == (6, 3)


IN_KMH = replace(CART, columns=(("speed", "km/h"),))


def model_of(transition):
    """A model that predicts the same transition (4,) always."""
    predictor = Trivial("mean", IN_KMH)
    predictor.transition.copy_(torch.tensor(transition))
    return Model(
        predictor=predictor,
        body=IN_KMH,
        network=Network(novice_body=IN_KMH, expert_body=IN_KMH),
        target_mean=torch.zeros(4),
        method="mean",
        steps=20,
        minutes=1.0,
        test_loss=0.0,
        scale=None,
    )


@pytest.fixture
def carts(rng):
    return [
        replace(
            cart_drive(rng, steps, "ab"[number % 2], f"{number}", turn=0.5, spin=0.1),
            body=IN_KMH,
        )
        for number, steps in enumerate((20, 20, 31))
    ]


def moved(before, after):
    dx, dy = after[:2] - before[:2]
    cos, sin = math.cos(before[2]), math.sin(before[2])
    return [cos * dx + sin * dy, cos * dy - sin * dx, after[2] - before[2]]


def rms(values):
    return math.sqrt(np.mean(np.square(values)))


def near(value):
    return pytest.approx(value, rel=1e-5)  # y is float32


def test_one_step_stands_beside_nothing_changes_and_the_mean(carts):
    table = model_of([0.1, 0.0, 0.02, 1.5]).evaluate(carts)
    table = table[table.prediction == ONE_STEP].set_index("quantity")
    pairs = [pair for d in carts for pair in zip(d.states, d.states[1:], strict=False)]
    actual = np.array([[*moved(a, b), b[3]] for a, b in pairs])
    before = np.array([a[3] for a, _ in pairs])
    forward, speed = table.loc["forward"], table.loc["speed"]
    assert forward.rmse == near(rms(0.1 - actual[:, 0]))
    assert forward["nothing_changes"] == near(rms(actual[:, 0]))
    assert forward["mean"] == near(actual[:, 0].std())
    assert speed["nothing_changes"] == near(rms(actual[:, 3] - before))
    sizes = np.sort(abs(1.5 - actual[:, 3]))
    assert speed.average == near(sizes.mean())
    assert speed["median"] == near(sizes[(len(sizes) - 1) // 2])
    assert (speed.unit, forward.unit, forward.horizon) == ("m/s", "m", 0.1)


def test_open_loop_errors_are_those_of_each_horizon(carts):
    """All windows have 20 steps; the longest drive has two, which overlap."""
    table = model_of([0.1, 0.0, 0.02, 1.5]).evaluate(carts)
    ahead = table[(table.prediction == OPEN_LOOP) & (table.horizon.round(3) == 0.5)]
    ahead = ahead.set_index("quantity")
    starts = [(d.states, WARM_UP) for d in carts] + [(carts[2].states, 11 + WARM_UP)]
    first, last = (np.array([x[k + n] for x, k in starts]) for n in (0, 5))
    path = first.copy()
    for _ in range(5):
        path[:, :2] += 0.1 * np.stack([np.cos(path[:, 2]), np.sin(path[:, 2])], 1)
        path[:, 2] += 0.02
    ends = np.array([moved(a, b) for a, b in zip(first, last, strict=True)])
    position, heading, speed = (ahead.loc[n] for n in ("position", "heading", "speed"))
    assert position.rmse == near(rms(np.hypot(*(path - last)[:, :2].T)))
    assert position["nothing_changes"] == near(rms(np.hypot(*ends[:, :2].T)))
    off = ends[:, :2] - ends[:, :2].mean(0)
    assert position["mean"] == near(rms(np.hypot(*off.T)))
    assert heading["nothing_changes"] == near(rms(ends[:, 2]))
    assert heading.rmse == pytest.approx(rms(0.1 - ends[:, 2]), rel=1e-4)
    assert speed["nothing_changes"] == near(rms(last[:, 3] - first[:, 3]))


def test_predictions_have_units_and_go_over_a_horizon(carts):
    model = model_of([0.1, 0.0, 0.02, 1.5])
    one = model.predict(carts)
    assert list(one.columns[:3]) == ["drive", "time [s]", "predicted forward [m]"]
    speeds = np.concatenate([drive.states[1:, 3] for drive in carts])
    assert np.allclose(one["actual speed [m/s]"], speeds)
    ahead = model.predict(carts, horizon=0.5, every=10)
    assert len(ahead) == 5 * (2 + 2 + 3) + 1  # the last start has one step
    rows = ahead[(ahead.drive == "2") & (ahead["start [s]"] == 1.0)]
    path = model.rollout(carts[2].states[10], carts[2].actions[10:15])
    assert np.allclose(rows["predicted x [m]"], path[1:, 0])
    assert np.allclose(rows["actual yaw [rad]"], carts[2].states[11:16, 2])
    assert np.allclose(rows["time [s]"], [1.1, 1.2, 1.3, 1.4, 1.5])
    from_start = model.predict(carts, horizon=9.0)
    assert len(from_start) == 71  # up to the end of each drive
    for wrong in ({"horizon": 0.01}, {"horizon": 1.0, "every": 0}):
        with pytest.raises(ConfigError, match="horizon|every"):
            model.predict(carts, **wrong)
