"""A model of a user's robot: fitted, stored, evaluated and used.

Functions and commands are tested.
"""

import contextlib
import dataclasses
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch

import ownrobot
from ownrobot import __main__ as command_line
from ownrobot.body_file import read_body
from ownrobot.fitting import settings, single
from ownrobot.methods.registry import METHODS
from ownrobot.recordings import read_drives, write_drives
from sidm.body import ROVER
from sidm.config import ConfigError, replace
from sidm.learning import Network, Training, trainer

RECORDINGS = Path(__file__).parents[3] / "recordings"
BODY = RECORDINGS / "skid_steer.yaml"
SKID = read_body(BODY)
HUNTER = read_body(RECORDINGS / "hunter.yaml")


@pytest.fixture(autouse=True)
def few_samples(monkeypatch):
    monkeypatch.setattr(
        settings,
        "SETTINGS",
        settings.SETTINGS.with_values({"max_samples": 4_000, "hidden": 16}),
    )


@pytest.fixture(scope="module")
def drives():
    robots = {"warthog": SKID, "husky": SKID, "hunter": HUNTER}
    return {
        name: read_drives(RECORDINGS / f"{name}.csv.gz", body)[:40]
        for name, body in robots.items()
    }


def test_a_test_is_computed_once(drives, monkeypatch):
    """There is no validation set while a model is fitted, and while it is pretrained.

    The trainer computes test losses by a default argument, validation losses by name.
    """
    monkeypatch.setattr(trainer, "mean_loss", None)
    monkeypatch.setattr(trainer, "validation_loss", None)
    few = {"max_samples": 500}
    pair = drives["warthog"], drives["husky"]
    assert ownrobot.fit(*pair, "pretrain_finetune", settings=few).test_loss > 0


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
    numbers = before.select_dtypes("number").to_numpy()
    assert numbers.size and np.isfinite(numbers).all()


def settings_of(with_sidm, alone):
    return (
        with_sidm.p_expert,
        with_sidm.matching_iterations,
        alone.p_expert,
        alone.weight_decay,
    )


def test_networks_and_training_may_be_ones_own(drives):
    """Networks and training are given whole or by single values.

    Otherwise the tuned values of each method hold.
    """
    used = []
    for how in (
        {},
        {"settings": {"hidden": 8, "p_expert": 0.5}},
        {"training": Training(max_samples=2_000, batch=4)},
        {"network": Network(layers=2, hidden=8)},
    ):
        model = ownrobot.fit(drives["warthog"], drives["husky"], "sidm", **how)
        used.append((model.network.layers, model.network.hidden))
    assert used == [(1, 16), (1, 8), (1, 16), (2, 8)]
    chosen = settings.settings_with(values={"p_expert": 0.5})
    with_sidm, alone = (
        chosen.training_of(METHODS[name]) for name in ("sidm", "novice_only")
    )
    assert settings_of(with_sidm, alone) == (0.5, 5, 0.0, 0.1)
    chosen = settings.settings_with(
        training=Training(p_expert=0.9, matching_iterations=20, weight_decay=0.01)
    )
    with_sidm, alone = (
        chosen.training_of(METHODS[name]) for name in ("sidm", "novice_only")
    )
    assert settings_of(with_sidm, alone) == (0.9, 20, 0.0, 0.01)
    with pytest.raises(ConfigError, match="did you mean 'hidden'"):
        ownrobot.fit(drives["warthog"], drives["husky"], "sidm", settings={"hiden": 8})


def test_predictions_stand_beside_what_was_recorded(drives):
    model = ownrobot.fit(drives["warthog"], body=SKID, method="least_squares")
    table = model.predict(drives["warthog"])
    assert len(table) == 40 * 19 and table.drive.nunique() == 40
    predicted, actual = (
        table[f"{kind} yaw_rate [rad/s]"] for kind in ("predicted", "actual")
    )
    assert np.allclose(actual[:19], drives["warthog"][0].states[1:, 3], atol=1e-5)
    assert np.corrcoef(predicted, actual)[0, 1] > 0.9


def test_robots_of_two_bodies_are_learnt_together(drives):
    expert = [replace(drive, body=HUNTER) for drive in drives["husky"]]
    model = ownrobot.fit(drives["warthog"], expert, "sidm")
    assert model.predictor.encoders.keys() == {"novice", "expert"}


@pytest.mark.parametrize(
    "how, words",
    [
        ({"method": "sidm"}, "learns from an expert's drives too"),
        ({"method": "sdim"}, "did you mean 'sidm'"),
        (
            {"novice": BODY.with_name("warthog.csv.gz"), "body": None},
            "the drives of novice have no body: pass body=",
        ),
        ({"novice": []}, "novice has no drives"),
        ({"expert_body": SKID}, "but there is no expert"),
        ({"seed": -1}, "seed must be 0 or more, not -1"),
    ],
)
def test_what_cannot_be_fitted_is_one_line(drives, how, words):
    with pytest.raises(ConfigError, match=words):
        ownrobot.fit(**{"novice": drives["warthog"], "body": SKID} | how)


def test_an_expert_of_one_piece_cannot_be_pretrained_on(drives):
    with pytest.raises(ConfigError, match="the expert's motion is one piece"):
        ownrobot.fit(drives["warthog"], drives["husky"][:1], method="core_frozen")


def test_without_weights_the_loss_is_in_raw_units(drives, tmp_path):
    """The model keeps the units of its fit.

    The loss of predicting the mean uses the same units.
    """
    plain = dataclasses.replace(SKID, weights="ones")
    model = ownrobot.fit(
        drives["warthog"], body=plain, method="least_squares", test=0.3, out=tmp_path
    )
    back = ownrobot.load(tmp_path)
    assert model.scale is back.scale is back.predictor.loss_weights("novice") is None
    assert 0 < model.held_out.loss < model.held_out.mean_loss
    assert back.held_out == model.held_out
    scaled = ownrobot.fit(
        drives["warthog"], body=SKID, method="least_squares", test=0.3
    )
    assert scaled.held_out.mean_loss == pytest.approx(len(SKID.targets), rel=0.5)
    assert not scaled.held_out.mean_loss == pytest.approx(
        model.held_out.mean_loss, rel=0.5
    )


def test_errors_are_in_the_units_that_drives_are_read_in(drives):
    columns = (("yaw_rate", "deg/s"), *SKID.columns[1:])
    body = dataclasses.replace(SKID, columns=columns)
    model = ownrobot.fit(drives["warthog"], body=body, method="least_squares")
    assert model.evaluate(drives["warthog"]).unit[3] == "rad/s"


def test_copying_between_two_bodies_is_refused(drives):
    expert = [replace(drive, body=HUNTER) for drive in drives["husky"]]
    with pytest.raises(ConfigError, match="needs robots of one body"):
        ownrobot.fit(drives["warthog"], expert, "pretrain_finetune")


def test_drives_keep_the_body_that_they_were_read_with(drives):
    """Another body would name a drive's columns differently.

    The same body with other weights only changes the weights of the loss.
    """
    with pytest.raises(
        ConfigError,
        match="expert has drives of body 'skid-steered', "
        "whose actions differ from those of",
    ):
        ownrobot.fit(drives["warthog"], drives["husky"], expert_body=HUNTER)


def test_a_damaged_model_is_named(drives, tmp_path):
    ownrobot.fit(drives["warthog"], body=SKID, method="least_squares", out=tmp_path)
    (tmp_path / "model.safetensors").write_bytes(b"no weights")
    with pytest.raises(ConfigError, match="the model is damaged"):
        ownrobot.load(tmp_path)
    with pytest.raises(ConfigError, match="no model is there"):
        ownrobot.load(tmp_path / "other")


def test_the_commands_lead_from_file_to_predictions(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    path, out = str(RECORDINGS / "warthog.csv.gz"), str(tmp_path / "model")
    arguments = (
        f"fit --novice {path} --body {BODY} --method least_squares --out {out}"
    ).split()
    assert command_line.main(arguments) == 0
    assert command_line.main(["evaluate", out, path]) == 0
    assert (tmp_path / "evaluation.png").stat().st_size > 10_000
    said = capsys.readouterr().out
    for words in ("wheel_left", "nothing changes", "drives with the largest loss of"):
        assert words in said
    csv = ["--csv", "errors.csv", "--drives-csv", "drives.csv"]
    assert command_line.main(["evaluate", out, path, *csv]) == 0
    errors, by_drive = (pd.read_csv(name) for name in ("errors.csv", "drives.csv"))
    assert {"one step", "open loop"} == set(errors.prediction)
    assert len(by_drive) == 287 and by_drive.loss[0] == by_drive.loss.max()
    assert (
        command_line.main(
            ["evaluate", out, path, "--figure", str(tmp_path / "found.foo")]
        )
        == 2
    )
    assert "found.foo: no kind of figure" in capsys.readouterr().err
    assert (
        command_line.main(["predict", out, path, "--out", str(tmp_path / "found.csv")])
        == 0
    )
    assert len(pd.read_csv(tmp_path / "found.csv")) == 287 * 19
    ahead = ["--horizon", "1s", "--every", "5", "--out", "ahead.csv"]
    assert command_line.main(["predict", out, path, *ahead]) == 0
    table = pd.read_csv("ahead.csv")
    assert len(table) == 287 * (10 + 10 + 9 + 4)
    assert table.columns[3] == "predicted x [m]"
    capsys.readouterr()
    for wrong, words in (
        (["--horizon", "3 m"], "a time is as 3s, not '3 m'"),
        (["--every", "5"], "--every is of open-loop predictions"),
    ):
        with contextlib.suppress(SystemExit):
            assert command_line.main(["predict", out, path, *wrong]) == 2
        assert words in capsys.readouterr().err
    assert command_line.main(["evaluate", out, str(RECORDINGS / "hunter.csv.gz")]) == 1
    assert (
        "column 'command_left' of body 'skid-steered' is missing"
        in capsys.readouterr().err
    )


def test_a_robot_on_rough_ground_is_learnt_with_its_map(tmp_path):
    """The paper's body, from an .npz with grounds, is rolled out over the map."""
    some = read_drives(RECORDINGS / "system1.npz", ROVER)[:12]
    write_drives(tmp_path / "mine.npz", some, "some")
    model = ownrobot.fit(
        tmp_path / "mine.npz",
        method="novice_only",
        body=RECORDINGS / "rover.yaml",
        out=tmp_path / "model",
    )
    table = ownrobot.load(tmp_path / "model").evaluate(tmp_path / "mine.npz")
    assert model.body == ROVER and model.steps == 64
    assert np.isfinite(table.rmse).all()
    assert table[table.quantity == "position"].horizon.max() == pytest.approx(6.0)
    assert len(model.predict(tmp_path / "mine.npz")) == 12 * 64


@pytest.mark.more
@pytest.mark.parametrize("name", ["warthog", "husky", "hunter"])
def test_the_models_kept_here_predict_their_robots(name):
    """Models that learnt from these drives are far better than the mean."""
    model = ownrobot.load(RECORDINGS / "models" / name)
    drives = read_drives(RECORDINGS / f"{name}.csv.gz", model.body)
    last = model.evaluate(drives[:50]).iloc[len(model.body.targets) - 1]
    assert last.rmse < 0.3 * last["mean"]


class Killed(Exception):
    """Stands for the end of a process."""


def test_an_unfinished_fit_goes_on_where_it_was(drives, tmp_path, monkeypatch):
    """The model is that of an undisturbed fit, and no test is run twice."""
    settings = {"max_samples": 30_000, "test_interval": 5, "prediction_iterations": 20}
    whole = ownrobot.fit(drives["warthog"], method="novice_only", settings=settings)
    seen: list[int] = []

    @contextlib.contextmanager
    def watched(title, most, shown):
        def tell(tested):
            seen.append(tested.samples)
            if len(seen) == 6:
                raise Killed

        yield tell

    monkeypatch.setattr(single, "_progress", watched)
    with pytest.raises(Killed):
        ownrobot.fit(
            drives["warthog"],
            method="novice_only",
            settings=settings,
            out=tmp_path / "model",
        )
    assert (tmp_path / "model" / "unfinished").is_dir()
    assert not (tmp_path / "model" / "model.json").exists()
    model = ownrobot.fit(
        drives["warthog"],
        method="novice_only",
        settings=settings,
        out=tmp_path / "model",
    )
    assert model.test_loss == whole.test_loss
    assert not (tmp_path / "model" / "unfinished").exists()
    weights, expected = model.predictor.state_dict(), whole.predictor.state_dict()
    assert all(torch.equal(weights[name], expected[name]) for name in expected)
    assert seen[6] > seen[3]  # resumed after the last stored phase
