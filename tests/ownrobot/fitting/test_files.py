"""A model's folder: what is written there is read as it was, or refused in a line."""

import json
from pathlib import Path

import pytest

import ownrobot
from ownrobot.body_file import read_body
from ownrobot.fitting.files import refuse_folder
from ownrobot.recordings import read_drives
from sidm.config import ConfigError, replace

RECORDINGS = Path(__file__).parents[3] / "recordings"
SKID = read_body(RECORDINGS / "skid_steer.yaml")


@pytest.fixture(scope="module")
def model():
    drives = read_drives(RECORDINGS / "warthog.csv.gz", SKID)[:20]
    return ownrobot.fit(drives, method="nothing_changes")


def test_a_flipped_bit_is_found(model, tmp_path):
    """Wherever the bit is: in the names, the shapes or the numbers."""
    model.save(tmp_path)
    path = tmp_path / "model.safetensors"
    whole = path.read_bytes()
    for place in range(0, len(whole), 5):
        changed = bytearray(whole)
        changed[place] ^= 1 << place % 8
        path.write_bytes(changed)
        with pytest.raises(ConfigError, match="the model is damaged .*fit it again"):
            ownrobot.load(tmp_path)
    path.write_bytes(whole)
    assert ownrobot.load(tmp_path).method == "nothing_changes"


def test_models_of_older_versions_have_no_checksum(model, tmp_path):
    model.save(tmp_path)
    about = json.loads((tmp_path / "model.json").read_text())
    assert len(about.pop("sha256")) == len(about.pop("checksum")) == 64
    (tmp_path / "model.json").write_text(json.dumps(about))
    assert ownrobot.load(tmp_path).body == SKID


def test_another_robots_model_is_not_replaced_by_mistake(model, tmp_path):
    model.save(tmp_path)
    other = replace(model, body=replace(SKID, name="tractor"))
    with pytest.raises(ConfigError, match="model of another body, 'skid-steered'"):
        other.save(tmp_path)
    assert ownrobot.load(tmp_path).body.name == "skid-steered"
    other.save(tmp_path, force=True)
    assert ownrobot.load(tmp_path).body.name == "tractor"


def test_a_model_of_the_same_robot_is_replaced(model, tmp_path):
    """How the loss is weighed does not make another robot."""
    model.save(tmp_path)
    plain = replace(SKID, weights="ones")
    replace(model, body=plain, minutes=99.0).save(tmp_path)
    assert ownrobot.load(tmp_path).minutes == 99.0


def test_a_damaged_model_may_be_replaced(model, tmp_path):
    (tmp_path / "model.json").write_text("{")
    model.save(tmp_path)
    assert ownrobot.load(tmp_path).body == SKID


@pytest.mark.parametrize("name", ["", "  "])
def test_a_folder_has_a_name(model, name):
    with pytest.raises(ConfigError, match="the model's folder has no name"):
        model.save(name)


def test_a_file_is_no_folder(model, tmp_path):
    path = tmp_path / "model.txt"
    path.write_text("mine")
    for folder in (path, path / "model"):
        with pytest.raises(ConfigError, match="model.txt is a file; name a folder"):
            model.save(folder, force=True)
    assert path.read_text() == "mine"
    refuse_folder(tmp_path / "new" / "folder", SKID)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("held_out", 5),
        ("scale", [0, 0, 0, 0, 0, -1]),
        ("steps", "a"),
        ("method", "foo"),
    ],
)
def test_a_changed_file_of_a_model_is_found(model, tmp_path, name, value):
    model.save(tmp_path)
    about = json.loads((tmp_path / "model.json").read_text())
    (tmp_path / "model.json").write_text(json.dumps(about | {name: value}))
    with pytest.raises(ConfigError, match="model.json was changed"):
        ownrobot.load(tmp_path)
