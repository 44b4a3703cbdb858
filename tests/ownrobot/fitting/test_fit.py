"""A model of a user's robot: fitted, stored, evaluated and used."""

import contextlib
import gzip
import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch

import ownrobot
import sidm
from companion.pages.own_data import robot_drives
from ownrobot import __main__ as command_line
from ownrobot.body_file import read_body
from ownrobot.commands.tables import csv_text
from ownrobot.fitting import fit as fitting
from ownrobot.fitting import learning, single
from ownrobot.methods.registry import METHODS
from ownrobot.recordings import read_drives, write_drives
from sidm.body import ROVER
from sidm.config import ConfigError, Notice, replace
from sidm.drives import STEPS
from sidm.learning import Network, Training
from tests.ownrobot.cart import CART, cart_drive

RECORDINGS = Path(__file__).parents[3] / "recordings"
BODY = RECORDINGS / "skid_steer.yaml"
SKID = read_body(BODY)
HUNTER = read_body(RECORDINGS / "hunter.yaml")


@pytest.fixture(autouse=True)
def few_samples(monkeypatch):
    few = learning.SETTINGS.with_values({"max_samples": 2_000, "hidden": 16})
    monkeypatch.setattr(learning, "SETTINGS", few)


@pytest.fixture(scope="module")
def drives(tmp_path_factory):
    folder, found = tmp_path_factory.mktemp("drives"), {}
    for name, body in {"warthog": SKID, "husky": SKID, "hunter": HUNTER}.items():
        with gzip.open(RECORDINGS / f"{name}.csv.gz", "rt") as file:
            rows = [next(file) for _ in range(1700)]
        (folder / f"{name}.csv").write_text("".join(rows))
        read = read_drives(folder / f"{name}.csv", body, skip_bad=True)
        found[name] = read[:40]
    return found


#: one method for each kind of model on disk
KINDS = "mean", "least_squares", "trees", "gp_pooled", "ackermann", "corrected", "sidm"


@pytest.mark.parametrize(
    "method",
    [pytest.param(m, marks=() if m in KINDS else pytest.mark.more) for m in METHODS],
)
def test_a_model_is_the_same_after_it_was_kept(drives, tmp_path, method):
    """A bicycle needs a steering, which the Hunter has."""
    novice = drives["hunter" if method == "ackermann" else "warthog"]
    expert = drives["husky"] if METHODS[method].needs_expert else None
    model = ownrobot.fit(novice, expert, method, out=tmp_path / "model")
    back = ownrobot.load(tmp_path / "model")
    assert (back.method, back.steps, back.body) == (method, model.steps, model.body)
    assert sorted(path.name for path in (tmp_path / "model").iterdir()) == [
        "model.json",
        "model.safetensors",
    ]
    before, after = (some.evaluate(novice) for some in (model, back))
    pd.testing.assert_frame_equal(before, after)
    targets = list(novice[0].body.targets)
    assert list(before.quantity[: len(targets)]) == targets
    assert np.isfinite(before.select_dtypes("number").to_numpy()).all()


def test_training_may_be_ones_own_as_a_whole_or_by_single_values():
    """Otherwise the tuned values of each method hold."""
    few = learning.settings_with(values={"p_expert": 0.5})
    whole = learning.settings_with(training=Training(p_expert=0.9, weight_decay=0.3))
    for chosen, p_expert, decay in ((few, 0.5, 0.1), (whole, 0.9, 0.3)):
        alone = chosen.training_of(METHODS["novice_only"])
        assert (alone.p_expert, alone.weight_decay) == (0, decay)
        assert chosen.training_of(METHODS["sidm"]).p_expert == p_expert


def test_robots_of_two_bodies_are_learnt_together_but_not_copied(drives):
    pair = drives["warthog"], drives["hunter"]
    model = ownrobot.fit(*pair, "sidm", network=Network(layers=2, hidden=8))
    assert (model.network.layers, model.network.hidden) == (2, 8)
    assert model.predictor.encoders.keys() == {"novice", "expert"}


def test_what_cannot_be_fitted_is_one_line(drives):
    for how, words in (
        ({"method": "ackermann"}, "ackermann looks for a speed"),
        ({"novice": RECORDINGS / "warthog.csv.gz", "body": None}, "have no body"),
        ({"novice": []}, "novice has no drives"),
        (
            {"expert": drives["husky"][:1], "method": "core_frozen"},
            "the expert's motion is one piece",
        ),
        ({"test": drives["warthog"][:1]}, "which the model learns from"),
        ({"seed": -1}, "seed must be 0 or more, not -1"),
        ({"test": 1}, "a share below 1"),
        ({"out": " "}, "the model's folder has no name"),
        ({"body": HUNTER}, "skid-steered', which differs from body .* in its state"),
    ):
        with pytest.raises(ConfigError, match=words):
            ownrobot.fit(**{"novice": drives["warthog"], "body": SKID} | how)


def test_without_weights_the_loss_is_in_raw_units(drives, tmp_path):
    """The loss of predicting the mean uses the same units."""
    plain = replace(SKID, weights="ones")
    model = ownrobot.fit(drives["warthog"], body=plain, test=0.3, out=tmp_path)
    back = ownrobot.load(tmp_path)
    assert model.scale is back.scale is back.predictor.loss_weights("novice") is None
    assert 0 < model.held_out.loss < model.held_out.mean_loss
    assert back.held_out == model.held_out
    scaled = ownrobot.fit(drives["warthog"], body=SKID, test=0.3).held_out
    assert scaled.mean_loss == pytest.approx(len(SKID.targets), rel=0.5)
    assert scaled.mean_loss != pytest.approx(model.held_out.mean_loss, rel=0.5)


def test_the_commands_lead_from_file_to_predictions(
    drives, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    write_drives("drives.csv", drives["warthog"], "some")

    def run(words: str) -> int:
        return command_line.main(words.split())

    assert run(f"fit --novice drives.csv --body {BODY} --out model") == 0
    assert run("evaluate model drives.csv --csv errors.csv --drives-csv loss.csv") == 0
    assert Path("evaluation.png").stat().st_size > 10_000
    said = capsys.readouterr().out
    for words in ("wheel_left", "nothing changes", "drives with the largest loss of"):
        assert words in said
    errors, by_drive = (pd.read_csv(name) for name in ("errors.csv", "loss.csv"))
    assert {"one step", "open loop"} == set(errors.prediction)
    assert len(by_drive) == 40 and by_drive.loss[0] == by_drive.loss.max()
    assert run("predict model drives.csv --out found.csv") == 0
    found = pd.read_csv("found.csv")
    assert len(found) == sum(map(len, drives["warthog"]))
    predicted, actual = (
        found[f"{kind} yaw_rate [rad/s]"] for kind in ("predicted", "actual")
    )
    assert np.corrcoef(predicted, actual)[0, 1] > 0.9
    assert run("predict model drives.csv --horizon 1s --every 5 --out ahead.csv") == 0
    ahead = pd.read_csv("ahead.csv")
    assert len(ahead) > len(found) and ahead.columns[3] == "predicted x [m]"
    assert run("predict model drives.csv --every 5") == 2
    assert "--every is of open-loop predictions" in capsys.readouterr().err
    write_drives("hunter.csv", drives["hunter"], "another robot")
    assert run("evaluate model hunter.csv") == 1
    assert "column 'command_left' of body" in capsys.readouterr().err


class Killed(Exception):
    """Stands for the end of a process."""


def test_an_unfinished_fit_goes_on_where_it_was(drives, tmp_path, monkeypatch):
    """The model is that of an undisturbed fit, and no test is run twice."""
    values = {"max_samples": 30_000, "test_interval": 5, "prediction_iterations": 20}
    how = {"method": "novice_only", "settings": values}
    whole = ownrobot.fit(drives["warthog"], **how)
    seen: list[int] = []

    @contextlib.contextmanager
    def watched(title, most, shown):
        def tell(tested):
            seen.append(tested.samples)
            if len(seen) == 6:
                raise Killed

        yield tell

    monkeypatch.setattr(single, "_progress", watched)
    out = tmp_path / "model"
    with pytest.raises(Killed):
        ownrobot.fit(drives["warthog"], out=out, **how)
    assert (out / "unfinished").is_dir() and not (out / "model.json").exists()
    model = ownrobot.fit(drives["warthog"], out=out, **how)
    assert model.test_loss == whole.test_loss
    assert not (out / "unfinished").exists()
    weights, expected = model.predictor.state_dict(), whole.predictor.state_dict()
    assert all(torch.equal(weights[name], expected[name]) for name in expected)
    assert seen[6] > seen[3]  # resumed after the last stored phase


@pytest.fixture(scope="module")
def small_model(drives):
    return ownrobot.fit(drives["warthog"], method="nothing_changes")


def test_damage_and_changes_of_a_models_files_are_found(small_model, tmp_path):
    """Models of older versions have no checksum."""
    small_model.save(tmp_path)
    path, text = tmp_path / "model.safetensors", tmp_path / "model.json"
    whole, about = path.read_bytes(), json.loads(text.read_text())
    for place in range(0, len(whole), 5):  # in the names, the shapes or the numbers
        changed = bytearray(whole)
        changed[place] ^= 1 << place % 8
        path.write_bytes(changed)
        with pytest.raises(ConfigError, match="the model is damaged .*fit it again"):
            ownrobot.load(tmp_path)
    path.write_bytes(whole)
    text.write_text(json.dumps(about | {"scale": [0, -1]}))
    with pytest.raises(ConfigError, match="model.json was changed"):
        ownrobot.load(tmp_path)
    del about["sha256"], about["checksum"]
    text.write_text(json.dumps(about))
    assert ownrobot.load(tmp_path).body == SKID


def test_another_robots_model_is_not_replaced_by_mistake(small_model, tmp_path):
    """How the loss is weighed does not make another robot; damage may be replaced."""
    (tmp_path / "model.json").write_text("{")
    small_model.save(tmp_path)
    other = replace(small_model, body=replace(SKID, name="tractor"))
    with pytest.raises(ConfigError, match="model of another body, 'skid-steered'"):
        other.save(tmp_path)
    replace(small_model, body=replace(SKID, weights="ones"), minutes=99.0).save(
        tmp_path
    )
    assert ownrobot.load(tmp_path).minutes == 99.0
    other.save(tmp_path, force=True)
    assert ownrobot.load(tmp_path).body.name == "tractor"


def drive_of(session, steps, seed, name="a", **turning):
    return cart_drive(np.random.default_rng(seed), steps, session, name, **turning)


def sessions(lengths, **turning):
    return [
        drive_of(f"{n}", steps, n, f"{n}", **turning) for n, steps in enumerate(lengths)
    ]


def test_drives_without_names_count_each_and_a_short_one_stops_no_fit():
    for seed in range(8):
        drives = sessions([640, 640, 640, 30])
        assert ownrobot.fit(drives, test=0.25, seed=seed).steps == 64
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
            "hidden, pixels, batch: without effect on least_squares",
        ),
        (
            [FEW, None, "novice_only"],
            {"settings": {"max_samples": 0, "p_expert": 0.5, "kernel": 3}},
            "p_expert, kernel: without effect on novice_only",
        ),
        ([MANY[:6], MANY[6:], "mean"], {}, "mean does not learn from the expert's"),
        (
            [[*MANY, drive_of("z", 4, 0)]],
            {},
            "1 of 13 drives, 0.4% of the motion, are shorter",
        ),
        ([[*FEW, *FEW]], {}, "novice has 2 drives given twice"),
    ],
)
def test_what_may_surprise_is_noted(arguments, how, words):
    with pytest.warns(Notice, match=words):
        ownrobot.fit(*arguments, **how)


def test_a_long_drive_is_divided_though_short_ones_lie_beside_it():
    long, short = sessions([2000]), [drive_of(f"short {n}", 24, n) for n in range(3)]
    assert ownrobot.fit([*long, *short]).steps == ownrobot.fit(long).steps == 64


def test_an_expert_that_a_method_does_not_learn_from_changes_nothing():
    """The expert's drives are too short for the windows of the novice's drives."""
    short = [drive_of(f"{n}", 24, 50 + n) for n in range(12)]
    with pytest.warns(Notice, match="does not learn from the expert's"):
        model = ownrobot.fit(MANY, short, "least_squares")
    alone = ownrobot.fit(MANY, method="least_squares")
    assert (model.steps, model.test_loss) == (alone.steps, alone.test_loss)


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
    with pytest.warns(Notice, match="^of body 'cart', left, turn: varies by less"):
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


def test_robot_and_ground_may_be_anywhere_and_the_map_is_the_same(tmp_path):
    body, shift = replace(CART, map_size=2.0, map_pixels=8), [30.0, -20.0, 0.0, 0.0]
    heights = 0.1 * np.random.default_rng(0).standard_normal((81, 81))
    here, there = (sidm.Ground(heights, 0.5, at) for at in ((0.0, 0.0), (30.0, -20.0)))
    drives = [replace(d, body=body, ground=here) for d in sessions([640, 640])]
    moved = [replace(d, states=d.states + shift, ground=there) for d in drives]
    settings = {"max_samples": 500, "hidden": 8}
    models = [
        ownrobot.fit(d, method="novice_only", settings=settings, out=tmp_path)
        for d in (drives, moved)
    ]
    assert ownrobot.load(tmp_path).body == body
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
