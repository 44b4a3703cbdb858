"""Drives as users give them: unequal, unnamed, far away, given twice, not finite."""

import numpy as np
import pandas as pd
import pytest

import ownrobot
import sidm
from ownrobot.commands.tables import csv_text
from ownrobot.demo import bundled_drives
from ownrobot.fitting import fit as fitting
from ownrobot.fitting.report import figure
from ownrobot.recordings import RecordingError, read_drives, write_drives
from sidm.body import Body
from sidm.config import ConfigError, Notice, replace
from sidm.drives import Drive
from tests.ownrobot.cart import CART, cart_drive


def drive_of(session, steps, seed, name="a", **turning):
    return cart_drive(np.random.default_rng(seed), steps, session, name, **turning)


def sessions(lengths):
    return [drive_of(f"{n}", steps, n, f"{n}") for n, steps in enumerate(lengths)]


@pytest.mark.parametrize("seed", range(8))
def test_a_short_session_does_not_stop_a_fit(seed):
    model = ownrobot.fit(sessions([640, 640, 640, 30]), test=0.25, seed=seed)
    assert model.steps == 64 and model.held_out.drives == 4


def test_drives_without_names_count_each():
    unnamed = [drive_of("", 60, n, name="") for n in range(12)]
    named = [replace(drive, name=f"{n}") for n, drive in enumerate(unnamed)]
    found, expected = (ownrobot.fit(d, test=0.25).held_out for d in (unnamed, named))
    assert found == expected and found.drives == 3 and found.standard_error > 0


def test_the_demonstrations_drives_have_names_of_their_own():
    drives = bundled_drives()
    assert len({drive.name for drive in drives}) == len(drives)
    assert drives[0].name.startswith("warthog.csv.gz drive ")


def test_a_test_that_shares_sessions_is_noted():
    drives = [drive_of(f"{n // 2}", 80, n, f"{n}") for n in range(12)]
    with pytest.warns(Notice, match="test has sessions that the model learns from"):
        ownrobot.fit(drives[::2], test=drives[1::2])


def test_an_expert_that_has_the_drives_held_out_is_noted():
    drives = sessions(12 * [80])
    with pytest.warns(Notice, match="3 of 3 drives held out are among the expert's"):
        ownrobot.fit(drives, drives, "least_squares_pooled", test=0.25)


def test_settings_of_a_network_are_noted_where_there_is_none():
    settings = {"hidden": 8, "pixels": 8, "batch": 4}
    with pytest.warns(Notice, match="trains no network; without effect: hidden, batch"):
        ownrobot.fit(sessions([80, 80]), method="least_squares", settings=settings)


def test_a_number_that_is_not_finite_is_one_line():
    drives = sessions([80, 80])
    drives[1].states[7, 3] = np.nan
    with pytest.raises(ConfigError, match="'speed' of step 7 is not finite") as caught:
        ownrobot.fit(drives)
    assert "\n" not in str(caught.value) and "Drive('1'" in str(caught.value)


def test_a_drive_may_be_made_of_lists():
    drives = sessions(4 * [80])
    lists = [
        Drive(d.states.tolist(), d.actions.tolist(), CART, session=d.session)
        for d in drives
    ]
    assert ownrobot.fit(lists).loss(drives) == ownrobot.fit(drives).loss(drives)


def test_a_table_is_checked_like_a_file():
    one = drive_of("a", 640, 0)
    columns = [name for name, _ in (*CART.state, *CART.actions)]
    rows = np.hstack([one.states, np.vstack([one.actions, one.actions[-1:]])])
    table = pd.DataFrame(rows, columns=columns).assign(time=0.1 * np.arange(641))
    with pytest.raises(RecordingError, match="the table: 'throttle' never changes"):
        ownrobot.fit(table.assign(throttle=0.5), body=CART)
    twice = pd.concat([table.assign(drive="a"), table.assign(drive="b")])
    with pytest.warns(Notice, match="1 drives that are given twice"):
        ownrobot.fit(twice, body=CART)


def test_positions_far_from_the_origin_keep_their_millimetres(tmp_path):
    far = drive_of("a", 80, 0)
    far.states[:, :2] += [500_000.0, 5_180_000.0]
    model = ownrobot.fit(sessions([640, 640]))
    table = model.predict([far], horizon=1.5)
    text = csv_text(table).splitlines()[-1].split(",")
    assert float(text[list(table).index("actual y [m]")]) == pytest.approx(
        table["actual y [m]"].iloc[-1], abs=1e-4
    )
    assert csv_text(pd.DataFrame({"a": [0.5, 1e-9, 1500.0, 12.3456789]})).split() == [
        "a",
        "0.5",
        "1e-09",
        "1500",
        "12.3457",
    ]
    write_drives(tmp_path / "far.npz", [far, far], "a test")
    (back, _) = read_drives(tmp_path / "far.npz", CART)
    assert back.states == pytest.approx(far.states, abs=1e-6)


def test_a_predicted_yaw_is_within_half_a_turn_of_the_actual():
    round_and_round = [drive_of(f"{n}", 200, n, turn=0.1, spin=0.1) for n in range(4)]
    assert round_and_round[0].states[-1, 2] > 3 * np.pi
    model = ownrobot.fit(round_and_round)
    table = model.predict(round_and_round, horizon=1.5, every=15)
    difference = table["predicted yaw [rad]"] - table["actual yaw [rad]"]
    assert difference.abs().max() < np.pi
    path = model.rollout([0.0, 0.0, 7.0, 0.0], round_and_round[0].actions)
    assert path[0, 2] == 7 and np.abs(np.diff(path[:, 2])).max() < 1


def test_an_unfinished_training_of_another_method_stays(tmp_path):
    kept = tmp_path / "model" / fitting.UNFINISHED / "sidm" / "training" / "state"
    kept.parent.mkdir(parents=True)
    kept.write_text("hours of work")
    ownrobot.fit(sessions([640, 640]), out=tmp_path / "model")
    assert kept.read_text() == "hours of work"


def test_a_column_called_position_is_no_error_of_the_position():
    """A lever without a pose has no panels for errors open loop of its place."""
    body = Body(
        name="lever",
        pose="none",
        columns=(("position", "rad"),),
        actions=(("throttle", "1"),),
    )
    drives = [
        Drive(d.states[:, 3:], d.actions, body, session=d.session)
        for d in sessions(4 * [80])
    ]
    table = ownrobot.fit(drives).evaluate(drives)
    titles = [axes.get_title() for axes in figure(table).axes]
    assert len(table) > 1 and "heading, open loop" not in titles


def test_the_middle_of_the_ground_may_be_anywhere():
    """A model sees the same ground if robot and ground are moved alike."""
    body = replace(CART, map_size=2.0, map_pixels=8)
    heights = 0.1 * np.random.default_rng(0).standard_normal((81, 81))
    here, there = (
        sidm.Ground(heights, 0.5, centre) for centre in ((0.0, 0.0), (30.0, -20.0))
    )
    drives = [replace(d, body=body, ground=here) for d in sessions([640, 640])]
    moved = [
        replace(d, states=d.states + [30.0, -20.0, 0.0, 0.0], ground=there)
        for d in drives
    ]
    settings = {"max_samples": 500, "hidden": 8}
    models = [
        ownrobot.fit(d, method="novice_only", settings=settings)
        for d in (drives, moved)
    ]
    paths = [
        models[0].rollout(d[0].states[0], d[0].actions[:20], ground=d[0].ground)
        for d in (drives, moved)
    ]
    assert paths[1] == pytest.approx(paths[0] + [30.0, -20.0, 0.0, 0.0], abs=1e-6)
    losses = [model.loss(d) for model, d in zip(models, (drives, moved), strict=True)]
    assert losses[0] == pytest.approx(losses[1], rel=1e-4)
