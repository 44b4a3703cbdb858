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
from ownrobot import __main__ as command_line
from ownrobot.body_file import read_body
from ownrobot.fitting import settings, single
from ownrobot.methods.registry import METHODS
from ownrobot.recordings import read_drives, write_drives
from sidm.config import ConfigError, replace
from sidm.learning import Network, Training, trainer

RECORDINGS = Path(__file__).parents[3] / "recordings"
BODY = RECORDINGS / "skid_steer.yaml"
SKID = read_body(BODY)
HUNTER = read_body(RECORDINGS / "hunter.yaml")


@pytest.fixture(autouse=True)
def few_samples(monkeypatch):
    few = settings.SETTINGS.with_values({"max_samples": 2_000, "hidden": 16})
    monkeypatch.setattr(settings, "SETTINGS", few)


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


def test_no_validation_is_computed_while_a_model_is_fitted(drives, monkeypatch):
    """The trainer computes test losses by a default argument, validations by name."""
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
    assert np.isfinite(before.select_dtypes("number").to_numpy()).all()


def test_training_may_be_ones_own_as_a_whole_or_by_single_values():
    """Otherwise the tuned values of each method hold."""
    few = settings.settings_with(values={"p_expert": 0.5})
    whole = settings.settings_with(training=Training(p_expert=0.9, weight_decay=0.3))
    for chosen, p_expert, weight_decay in ((few, 0.5, 0.1), (whole, 0.9, 0.3)):
        with_sidm, alone = (
            chosen.training_of(METHODS[name]) for name in ("sidm", "novice_only")
        )
        assert with_sidm.p_expert == p_expert and alone.p_expert == 0
        assert alone.weight_decay == weight_decay


def test_robots_of_two_bodies_are_learnt_together_but_not_copied(drives):
    pair = drives["warthog"], drives["hunter"]
    model = ownrobot.fit(*pair, "sidm", network=Network(layers=2, hidden=8))
    assert (model.network.layers, model.network.hidden) == (2, 8)
    assert model.predictor.encoders.keys() == {"novice", "expert"}
    with pytest.raises(ConfigError, match="needs robots of one body"):
        ownrobot.fit(*pair, "pretrain_finetune")


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ({"method": "sidm"}, "learns from an expert's drives too"),
        ({"method": "ackermann"}, "ackermann looks for a speed"),
        ({"novice": RECORDINGS / "warthog.csv.gz", "body": None}, "have no body"),
        ({"novice": []}, "novice has no drives"),
        ({"expert_body": SKID}, "but there is no expert"),
        ({"seed": -1}, "seed must be 0 or more, not -1"),
        ({"test": 1}, "a share below 1"),
        ({"body": HUNTER}, "skid-steered', whose actions differ from those of"),
    ],
)
def test_what_cannot_be_fitted_is_one_line(drives, how, words):
    with pytest.raises(ConfigError, match=words):
        ownrobot.fit(**{"novice": drives["warthog"], "body": SKID} | how)


def test_drives_that_are_learnt_or_of_one_piece_are_refused(drives):
    with pytest.raises(ConfigError, match="which the model learns from"):
        ownrobot.fit(drives["warthog"], test=drives["warthog"][:1])
    with pytest.raises(ConfigError, match="the expert's motion is one piece"):
        ownrobot.fit(drives["warthog"], drives["husky"][:1], method="core_frozen")


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
def small_model():
    drives = read_drives(RECORDINGS / "warthog.csv.gz", SKID)[:20]
    return ownrobot.fit(drives, method="nothing_changes")


def test_a_flipped_bit_is_found(small_model, tmp_path):
    """Wherever the bit is: in the names, the shapes or the numbers."""
    small_model.save(tmp_path)
    path = tmp_path / "model.safetensors"
    whole = path.read_bytes()
    for place in range(0, len(whole), 5):
        changed = bytearray(whole)
        changed[place] ^= 1 << place % 8
        path.write_bytes(changed)
        with pytest.raises(ConfigError, match="the model is damaged .*fit it again"):
            ownrobot.load(tmp_path)


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


def test_a_changed_file_of_a_model_is_found(small_model, tmp_path):
    """Models of older versions have no checksum."""
    small_model.save(tmp_path)
    path = tmp_path / "model.json"
    about = json.loads(path.read_text())
    path.write_text(json.dumps(about | {"scale": [0, -1]}))
    with pytest.raises(ConfigError, match="model.json was changed"):
        ownrobot.load(tmp_path)
    del about["sha256"], about["checksum"]
    path.write_text(json.dumps(about))
    assert ownrobot.load(tmp_path).body == SKID
