"""The public face: its names, their examples, and values that users pass."""

import doctest
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import ownrobot
import sidm
from ownrobot.recordings import RecordingError
from sidm.config import ConfigError

ROOT = Path(__file__).parents[1]
WARTHOG = ROOT / "recordings" / "warthog.csv.gz"
SKID = ROOT / "recordings" / "skid_steer.yaml"
QUICK = {"method": "least_squares"}
PLANER = {"pose": "planer", "actions": {"u": "1"}}


@pytest.fixture(scope="module")
def drives():
    return ownrobot.read_drives(WARTHOG, SKID)[:40]


FACE = [(package, name) for package in (sidm, ownrobot) for name in package.__all__]


@pytest.mark.parametrize("package, name", FACE, ids=[name for _, name in FACE])
def test_every_public_name_has_a_docstring_with_an_example_that_runs(
    package, name, monkeypatch
):
    monkeypatch.chdir(ROOT)
    thing = getattr(package, name)
    text = (sidm.systems.__doc__ or "") if name == "SYSTEMS" else thing.__doc__
    assert ">>>" in text, name
    known = {"sidm": sidm, "ownrobot": ownrobot, "np": np}
    finder = doctest.DocTestParser().get_doctest(text, known, name, None, None)
    said: list[str] = []
    runner = doctest.DocTestRunner(
        optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
    )
    assert runner.run(finder, out=said.append).failed == 0, "".join(said)


@pytest.mark.more
@pytest.mark.parametrize("package", [sidm, ownrobot])
def test_the_example_of_the_package_runs(package, monkeypatch):
    monkeypatch.chdir(ROOT)
    assert doctest.testmod(package).failed == 0


def test_the_face_is_what_is_listed():
    assert [*sidm.__all__, *ownrobot.__all__] == (
        "SYSTEMS System Robot Terrain Body Drive Ground Network Training simulate "
        "train read_drives fit compare load Model"
    ).split()
    assert set(sidm.__all__) <= set(dir(sidm)) and not hasattr(sidm, "numpy")
    with pytest.raises(
        AttributeError, match="module 'sidm' has no attribute 'simulat'"
    ):
        _ = sidm.simulat


@pytest.mark.parametrize(
    "form", [WARTHOG, str(WARTHOG), [WARTHOG]], ids=["path", "text", "paths"]
)
def test_paths_may_stand_for_drives(form):
    read = ownrobot.read_drives(WARTHOG, SKID)
    assert (
        ownrobot.fit(form, body=SKID, **QUICK).test_loss
        == ownrobot.fit(read, **QUICK).test_loss
    )


@pytest.mark.parametrize(
    "wrong, error, words",
    [
        ({"novice": "drivse/", "body": SKID}, RecordingError, "there is no such file"),
        ({"novice": 3}, TypeError, "novice must be drives, .* not int"),
        ({"novice": [np.zeros(3)]}, TypeError, "novice must be drives, .* not list"),
        (
            {"novice": pd.DataFrame({"time": [0.0]}), "body": SKID},
            RecordingError,
            "the table has no column 'x'",
        ),
        ({"body": 3}, TypeError, "a body is a sidm.Body, .* not int"),
        ({"body": PLANER}, ConfigError, "did you mean 'planar'"),
        ({"settings": {"hiden": 3}}, ConfigError, "did you mean 'hidden'"),
        ({"method": "sdim"}, ConfigError, "did you mean 'sidm'"),
    ],
)
def test_wrong_arguments_are_refused_in_one_line_of_python(drives, wrong, error, words):
    with pytest.raises(error, match=words) as caught:
        ownrobot.fit(**({"novice": drives} | QUICK | wrong))
    assert "\n" not in str(caught.value) and "--" not in str(caught.value)


def test_swapped_robots_are_seen():
    pair = {role: sidm.simulate("system1", role, 0.2) for role in ("novice", "expert")}
    with pytest.raises(
        ConfigError,
        match="novice has the drives of 'system1 expert': "
        "are novice and expert swapped",
    ):
        ownrobot.fit(pair["expert"], pair["novice"])
    same = sidm.simulate("system1", "novice", 0.2, seed=np.int64(0), progress=False)
    assert np.array_equal(same[0].states, pair["novice"][0].states)
    slow = sidm.systems.Physics(time_step=1 / 1000)
    for changes in ({"name": "my-robot"}, {"name": "mine", "physics": slow}):
        with pytest.raises(ConfigError, match="plain name|must be 0.1 s"):
            sidm.SYSTEMS["system1"].replace(**changes)
    for wrong, error in (("system3", ConfigError), (3, TypeError)):
        with pytest.raises(error):
            sidm.simulate(wrong, "novice", 0.2)
    with pytest.raises(ConfigError, match="role 'novise'; did you mean 'novice'"):
        sidm.simulate("system1", "novise", 0.2)


def test_a_model_is_one_line_and_asks_for_the_ground_it_sees():
    drives = sidm.simulate("system1", "novice", 1.0)
    model = ownrobot.fit(drives, **QUICK)
    assert re.fullmatch(
        r"Model\('least_squares' of body 'rover', from 0.96 min\)", repr(model)
    )
    path = model.rollout(
        drives[0].states[0], drives[0].actions, ground=drives[0].ground
    )
    assert path.shape == (65, 13) and np.array_equal(path[0], drives[0].states[0])
    with pytest.raises(
        ConfigError, match="sees a height map: pass the ground under it"
    ):
        model.rollout(drives[0].states[0], drives[0].actions)


def test_simulated_motion_may_be_kept_on_disk(tmp_path):
    kept, free = (
        sidm.simulate("system2", "expert", 0.2, seed=4, folder=folder)
        for folder in (tmp_path, None)
    )
    assert all(
        np.array_equal(a.states, b.states) for a, b in zip(kept, free, strict=True)
    )
    assert list(tmp_path.rglob("shard-*.npz"))


def test_a_drive_has_its_bodys_shape():
    with pytest.raises(
        ValueError, match=r"\(K, 2\) of at least one step, not \(5, 13\)"
    ):
        sidm.Drive(np.zeros((5, 13)), np.zeros((5, 2)))


TWO_ROBOTS = ["--minutes", "1", "--expert-minutes", "1"]


@pytest.mark.more
@pytest.mark.parametrize(
    "script, words, said",
    [
        ("two_robots.py", TWO_ROBOTS, "SIDM: loss on unseen"),
        ("own_robot.py", [str(WARTHOG), "--body", str(SKID)], "least_squares"),
    ],
)
def test_an_example_runs_in_an_empty_folder(script, words, said, tmp_path):
    program = [sys.executable, str(ROOT / "examples" / script), "--samples", "4000"]
    result = subprocess.run(
        [*program, *words], cwd=tmp_path, capture_output=True, text=True
    )
    assert result.returncode == 0 and said in result.stdout, result.stderr
    assert list(tmp_path.rglob("model.safetensors"))
