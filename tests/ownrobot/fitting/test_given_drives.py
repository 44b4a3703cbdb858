"""Drives as users give them: unequal, unnamed, far away, given twice, not finite."""

import numpy as np
import pandas as pd
import pytest

import ownrobot
import sidm
from companion.pages.own_data import robot_drives
from ownrobot.commands.tables import csv_text
from ownrobot.fitting import fit as fitting
from ownrobot.recordings import read_drives, write_drives
from sidm.body import ROVER
from sidm.config import ConfigError, Notice, replace
from sidm.drives import STEPS
from tests.ownrobot.cart import CART, cart_drive


def drive_of(session, steps, seed, name="a", **turning):
    return cart_drive(np.random.default_rng(seed), steps, session, name, **turning)


def sessions(lengths, **turning):
    return [
        drive_of(f"{n}", steps, n, f"{n}", **turning) for n, steps in enumerate(lengths)
    ]


def test_drives_without_names_count_each_and_a_short_one_stops_no_fit():
    assert ownrobot.fit(sessions([640, 640, 640, 30]), test=0.25).steps == 64
    unnamed = [drive_of("", 60, n, name="") for n in range(12)]
    named = [replace(drive, name=f"{n}") for n, drive in enumerate(unnamed)]
    found, expected = (ownrobot.fit(d, test=0.25).held_out for d in (unnamed, named))
    assert found == expected and found.drives == 3 and found.standard_error > 0


FEW, MANY = sessions([80, 80]), sessions(12 * [80])
PAIRS = [drive_of(f"{n // 2}", 80, n, f"{n}") for n in range(12)]


@pytest.mark.parametrize(
    ("arguments", "how", "words"),
    [
        ([PAIRS[::2]], {"test": PAIRS[1::2]}, "test has sessions that the model"),
        (
            [MANY, MANY, "least_squares_pooled"],
            {"test": 0.25},
            "3 of 3 drives held out are among the expert's",
        ),
        (
            [FEW],
            {"settings": {"hidden": 8, "pixels": 8, "batch": 4}},
            "trains no network; without effect: hidden, batch",
        ),
        ([MANY[:6], MANY[6:], "mean"], {}, "mean does not learn from the expert's"),
        (
            [[*MANY, drive_of("z", 4, 0)]],
            {},
            "1 of 13 drives, 0.4% of the motion, are shorter",
        ),
        ([[*FEW, *FEW]], {}, "novice has 2 drives that are given twice"),
    ],
)
def test_what_may_surprise_is_noted(arguments, how, words):
    with pytest.warns(Notice, match=words):
        ownrobot.fit(*arguments, **how)


def test_a_model_that_is_replaced_is_noted_and_another_methods_state_stays(tmp_path):
    kept = tmp_path / fitting.UNFINISHED / "sidm" / "training" / "state"
    kept.parent.mkdir(parents=True)
    kept.write_text("hours of work")
    ownrobot.fit(FEW, out=tmp_path)
    with pytest.warns(Notice, match="the model there is replaced"):
        ownrobot.fit(FEW, method="mean", out=tmp_path)
    assert kept.read_text() == "hours of work"


def with_resolution(drives, **resolution):
    body = replace(CART, resolution=tuple(resolution.items()))
    return [replace(drive, body=body) for drive in drives]


def test_rounding_noise_has_no_weight_in_the_loss(rng):
    """Without a resolution, noise of 1e-6 m would be most of what is left to learn."""
    straight = sessions(12 * [80], turn=0.0)
    for drive in straight:
        drive.states[:, 1] += 1e-6 * rng.standard_normal(81)
    with pytest.warns(Notice, match="^of body 'cart', left: varies by less than"):
        model = ownrobot.fit(straight, test=0.25)
    assert model.scale[1] == 0 and all(model.scale[[0, 3]])
    noisy = ownrobot.fit(with_resolution(straight, left=0.0), test=0.25)
    assert noisy.held_out.loss > 2 * model.held_out.loss
    with pytest.warns(Notice, match="cart', forward"):
        coarse = ownrobot.fit(with_resolution(straight, forward=10.0), method="mean")
    assert coarse.scale[0] == 0
    with pytest.raises(ConfigError, match="nothing of body 'cart' varies"):
        ownrobot.fit(with_resolution(straight, forward=1e6, turn=1e6, speed=1e6))


def test_a_number_that_is_not_finite_is_one_line(tmp_path):
    drives = sessions([80, 80])
    drives[1].states[7, 3] = np.nan
    with pytest.raises(ConfigError, match="'speed' of step 7 is not finite") as caught:
        ownrobot.fit(drives)
    assert "\n" not in str(caught.value) and "Drive('1'" in str(caught.value)
    large = [replace(drive, states=drive.states * 1e25) for drive in FEW]
    with pytest.raises(ConfigError, match="not finite"):
        ownrobot.fit(large, method="mean", out=tmp_path / "model")
    assert not (tmp_path / "model").exists()


def test_positions_far_from_the_origin_keep_their_millimetres(tmp_path):
    far = drive_of("a", 80, 0)
    far.states[:, :2] += [500_000.0, 5_180_000.0]
    table = ownrobot.fit(FEW).predict([far], horizon=1.5)
    y = csv_text(table).splitlines()[-1].split(",")[list(table).index("actual y [m]")]
    assert float(y) == pytest.approx(table["actual y [m]"].iloc[-1], abs=1e-4)
    numbers = csv_text(pd.DataFrame({"a": [0.5, 1e-9, 1500.0, 12.3456789]})).split()
    assert numbers == ["a", "0.5", "1e-09", "1500", "12.3457"]
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


def test_robot_and_ground_may_be_anywhere_and_the_map_is_the_same():
    body, shift = replace(CART, map_size=2.0, map_pixels=8), [30.0, -20.0, 0.0, 0.0]
    heights = 0.1 * np.random.default_rng(0).standard_normal((81, 81))
    here, there = (sidm.Ground(heights, 0.5, at) for at in ((0.0, 0.0), (30.0, -20.0)))
    drives = [replace(d, body=body, ground=here) for d in sessions([640, 640])]
    moved = [replace(d, states=d.states + shift, ground=there) for d in drives]
    settings = {"max_samples": 500, "hidden": 8}
    models = [
        ownrobot.fit(d, method="novice_only", settings=settings)
        for d in (drives, moved)
    ]
    paths = [
        models[0].rollout(d[0].states[0], d[0].actions[:20], ground=d[0].ground)
        for d in (drives, moved)
    ]
    assert paths[1] == pytest.approx(paths[0] + shift, abs=1e-6)
    losses = [model.loss(d) for model, d in zip(models, (drives, moved), strict=True)]
    assert losses[0] == pytest.approx(losses[1], rel=1e-4)
    errors = [models[0].evaluate(part).rmse for part in (drives, moved)]
    assert errors[0].to_numpy() == pytest.approx(errors[1].to_numpy(), rel=1e-3)


def test_a_simulated_robot_goes_by_its_name(tmp_path):
    drives = robot_drives("system1 expert", ROVER, 0.2, tmp_path)
    assert [len(drive) for drive in drives] == 2 * [STEPS]
    write_drives(tmp_path / "its.npz", drives, "simulated")
    back = robot_drives(str(tmp_path / "its.npz"), ROVER)
    assert np.allclose(back[1].states, drives[1].states, atol=1e-6)
    with pytest.raises(ConfigError, match="is no file.* mean 'system1 expert'?"):
        robot_drives("system1 exprt", ROVER)
