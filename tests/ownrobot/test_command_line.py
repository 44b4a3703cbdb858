"""The command line: names, help, pipes, and what is wrong is one line."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import ownrobot
import sidm
from ownrobot.__main__ import COMMANDS, main
from ownrobot.methods.registry import METHODS
from ownrobot.recordings import write_drives
from sidm.config import Notice, replace

ROOT = Path(__file__).parents[2]
RECORDINGS = ROOT / "recordings"
WARTHOG, SKID = RECORDINGS / "warthog.csv.gz", RECORDINGS / "skid_steer.yaml"
MODEL = RECORDINGS / "models" / "warthog"
FIT = f"fit --novice {WARTHOG} --body {SKID} --out model"


@pytest.fixture(autouse=True)
def empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("file", "drive.csv"):
        (tmp_path / name).write_text("")


def said_by(words, capsys):
    """Exit status of a command, and the last line of its errors."""
    try:
        status = main(words)
    except SystemExit as end:
        status = end.code
    return status, capsys.readouterr().err.splitlines()[-1]


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ("", "name a command, demo, check"),
        ("fti", "unknown command 'fti'; did you mean 'fit'?"),
        (f"{FIT} --method tres", "unknown method 'tres'; did you mean 'trees'?"),
        (f"{FIT} --set hiden=3", "unknown setting 'hiden'; did you mean 'hidden'?"),
        (f"{FIT} --set hidden", "--set takes NAME=VALUE"),
        (f"{FIT} --device qpu", "device 'qpu' cannot be used"),
        (f"{FIT} --method sidm", "learns from an expert's drives too"),
        (f"{FIT} --method ackermann", "ackermann"),
        (f"fit --novice {WARTHOG} --body {SKID} --out file", "file is a file"),
        (f"fit --novice nowhere --body {SKID} --out m", "nowhere: there is no such"),
        (f"fit --novice file --body {SKID} --out m", "file: drives are"),
        (f"fit --novice {WARTHOG} --body none.yaml --out m", "none.yaml: there is no"),
        (f"evaluate nowhere {WARTHOG}", "nowhere: no model is there"),
        (f"evaluate {MODEL} {WARTHOG} --figure a.foo", "a.foo: no kind of figure"),
        (f"evaluate {MODEL} {WARTHOG} --csv file/a.csv", "file/a.csv"),
        (f"predict {MODEL} {WARTHOG} --topics /a", "topics are of ROS bags"),
        (f"predict {MODEL} drive.csv --out drive.csv", "drive.csv is read, too"),
        (f"evaluate {MODEL} drive.csv --csv drive.csv", "drive.csv is read, too"),
        (f"replay drive.csv --body {SKID} --html drive.csv", "drive.csv is read, too"),
        (f"compare {WARTHOG} --body {SKID} --out file", "'file' is no folder"),
        (f"compare {WARTHOG} --body {SKID} --out {MODEL}", "has a model; name another"),
        (f"compare {WARTHOG} --body {SKID} --seed -1", "seed must be 0 or more"),
        (f"predict {MODEL} {WARTHOG} --horizon nans", "a time is as 3s"),
        (f"predict {MODEL} {WARTHOG} --horizon 0.001s", "below one step of 0.1 s"),
        (f"replay {WARTHOG} --body {SKID} --html a --drive 999", "drives 0 to 286"),
        (
            f"replay {WARTHOG} --body {SKID} --html a --shape roover",
            "or WHEELBASE,TRACK,RADIUS in m",
        ),
    ],
)
def test_what_cannot_be_done_is_one_line(words, line, capsys):
    status, said = said_by(words.split(), capsys)
    assert status in (1, 2) and line in said and said.startswith("ownrobot: ")
    assert not Path("model").exists() and not Path("m").exists()


@pytest.mark.parametrize("out", [" ", ""])
def test_a_folder_without_a_name_is_refused(out, capsys):
    words = [*FIT.split()[:-1], out]
    assert said_by(words, capsys)[0] == 2


def test_another_robots_model_is_not_replaced(capsys):
    body = RECORDINGS / "hunter.yaml"
    hunter = f"fit --novice {RECORDINGS / 'hunter.csv.gz'} --body {body} --out model"
    assert main([*FIT.split(), "--method", "mean"]) == 0
    status, said = said_by([*hunter.split(), "--method", "mean"], capsys)
    assert status == 2 and "--force" in said
    assert ownrobot.load("model").body.name == "skid-steered"
    assert main([*hunter.split(), "--method", "mean", "--force"]) == 0
    assert ownrobot.load("model").body.name == "hunter"


@pytest.mark.parametrize("command", COMMANDS)
def test_each_command_shows_examples(command, capsys):
    with pytest.raises(SystemExit):
        main([command, "--help"])
    said = capsys.readouterr().out
    if command != "demo":
        assert said.count(f"\n  ownrobot {command} ") == 2, said
    if command in ("fit", "compare"):
        assert all(f"\n  {method} " in said for method in METHODS)


def test_who_stops_reading_is_told_nothing():
    """The output is far longer than a pipe holds."""
    command = f"{sys.executable} -m ownrobot predict {MODEL} {WARTHOG} | head -1"
    result = subprocess.run(
        ["bash", "-c", f"set -o pipefail; {command}"], capture_output=True, text=True
    )
    assert result.returncode == 0
    assert result.stdout.startswith("drive,time [s],")
    assert all(line.startswith("note: ") for line in result.stderr.splitlines())


def test_evaluating_writes_nothing_into_the_model(tmp_path):
    """The folder of a model may be read-only."""
    before = sorted(MODEL.iterdir())
    assert main(["evaluate", str(MODEL), str(WARTHOG)]) == 0
    assert Path("evaluation.png").is_file() and sorted(MODEL.iterdir()) == before


def test_a_replay_shows_the_prediction_too():
    words = f"replay {WARTHOG} --model {MODEL} --shape warthog --drive 3 --html a.html"
    assert main(words.split()) == 0
    plain = f"replay {WARTHOG} --body {SKID} --shape warthog --drive 3 --html b.html"
    assert main(plain.split()) == 0
    pages = [Path(name).read_text() for name in ("a.html", "b.html")]
    assert '"model"' in pages[0] and '"model"' not in pages[1]


def ideal_drives():
    """An ideal differential drive: it never slips, but positions are rounded."""
    rng = np.random.default_rng(0)
    body = sidm.Body(
        name="ideal",
        pose="planar",
        columns=(("wheel_left", "rad/s"), ("wheel_right", "rad/s")),
        actions=(("command_left", "rad/s"), ("command_right", "rad/s")),
    )
    drives = []
    for number in range(24):
        commands = np.repeat(rng.uniform(-5, 5, (6, 2)), 5, axis=0)
        wheels = np.zeros((31, 2))
        for k in range(30):
            wheels[k + 1] = wheels[k] + 0.5 * (commands[k] - wheels[k])
        wheels += 0.05 * rng.standard_normal(wheels.shape)
        state = np.zeros((31, 3))
        for k in range(30):
            forward = 0.01 * wheels[k].mean()
            turn = 0.03 * (wheels[k, 1] - wheels[k, 0])
            heading = state[k, 2]
            step = forward * np.array([np.cos(heading), np.sin(heading)])
            state[k + 1] = [*(state[k, :2] + step), heading + turn]
        state[:, :2] += 1e-6 * rng.standard_normal((31, 2))
        states, session = np.hstack([state, wheels]), f"{number // 2}"
        name = f"{number}"
        drives.append(sidm.Drive(states, commands, body, name=name, session=session))
    return drives


def test_rounding_noise_has_no_weight_in_the_loss():
    """Without a resolution, noise of 1e-6 m would be most of what is left to learn."""
    drives = ideal_drives()
    with pytest.warns(Notice, match="^of body 'ideal', left: varies by less than the"):
        model = ownrobot.fit(drives, method="least_squares", test=0.25)
    targets = model.body.targets
    weights = dict(zip(targets, model.scale.tolist(), strict=True))
    assert weights["left"] == 0 and all(w for n, w in weights.items() if n != "left")
    fine = replace(drives[0].body, resolution=(("left", 0.0),))
    exact = [sidm.Drive(d.states, d.actions, fine, session=d.session) for d in drives]
    noisy = ownrobot.fit(exact, method="least_squares", test=0.25)
    assert noisy.held_out.loss > 2 * model.held_out.loss


def test_a_written_resolution_is_used():
    body = ideal_drives()[0].body
    coarse = replace(body, resolution=(("forward", 10.0),))
    drives = [
        sidm.Drive(d.states, d.actions, coarse, session=d.session)
        for d in ideal_drives()
    ]
    with pytest.warns(Notice, match="ideal', forward, left: varies"):
        model = ownrobot.fit(drives, method="mean")
    assert model.scale[:2].tolist() == [0, 0]


def test_drives_that_are_too_short_are_told(tmp_path):
    drives = ideal_drives()
    short = sidm.Drive(drives[0].states[:5], drives[0].actions[:4], drives[0].body)
    with pytest.warns(Notice, match="1 of 25 drives, 0.6% of the motion, are shorter"):
        model = ownrobot.fit([*drives, short], method="mean")
    assert model.steps == 30


def test_an_expert_that_is_not_used_is_told():
    drives = ideal_drives()
    with pytest.warns(Notice, match="mean does not learn from the expert's drives"):
        ownrobot.fit(drives[:12], drives[12:], method="mean")


def test_a_model_with_numbers_that_are_not_finite_is_refused(tmp_path):
    drives = ideal_drives()
    large = [
        sidm.Drive(d.states * 1e25, d.actions, d.body, session=d.session)
        for d in drives
    ]
    with pytest.raises(sidm.config.ConfigError, match="not finite"):
        ownrobot.fit(large, method="mean", out=tmp_path / "model")
    assert not (tmp_path / "model").exists()


def test_several_paths_are_read_together(tmp_path):
    drives = ideal_drives()
    for number in (0, 1):
        write_drives(tmp_path / f"{number}.csv", drives[number::2], "tests")
    (tmp_path / "body.yaml").write_text(
        "pose: planar\ncolumns: {wheel_left: rad/s, wheel_right: rad/s}\n"
        "actions: {command_left: rad/s, command_right: rad/s}\n"
    )
    words = "fit --novice 0.csv 1.csv --body body.yaml --out model --method mean"
    assert main(words.split()) == 0
    assert ownrobot.load("model").minutes == pytest.approx(18 * 3 / 60)


def test_drives_that_are_given_twice_count_once():
    drives = ideal_drives()
    with pytest.warns(Notice, match="novice has 24 drives that are given twice"):
        twice = ownrobot.fit([*drives, *drives], method="least_squares")
    once = ownrobot.fit(drives, method="least_squares")
    assert twice.minutes == once.minutes
    assert twice.loss(drives) == once.loss(drives)


def test_a_body_without_any_weight_is_refused():
    names = ("forward", "left", "turn", "wheel_left", "wheel_right")
    blind = replace(ideal_drives()[0].body, resolution=tuple((n, 1e6) for n in names))
    drives = [
        sidm.Drive(d.states, d.actions, blind, session=d.session)
        for d in ideal_drives()
    ]
    with pytest.raises(sidm.config.ConfigError, match="nothing of body 'ideal' varies"):
        ownrobot.fit(drives, method="least_squares")


def test_a_link_stays_a_link():
    Path("target.csv").write_text("old")
    Path("link.csv").symlink_to("target.csv")
    assert main(["predict", str(MODEL), str(WARTHOG), "--out", "link.csv"]) == 0
    assert Path("link.csv").is_symlink()
    assert Path("target.csv").read_text().startswith("drive,")


def test_replacing_a_model_is_told():
    drives = ideal_drives()
    ownrobot.fit(drives, method="mean", out="m")
    with pytest.warns(Notice, match="m: the model there is replaced"):
        ownrobot.fit(drives, method="least_squares", out="m")


def test_one_bad_cell_leaves_out_one_drive(tmp_path):
    drives = ideal_drives()
    write_drives(tmp_path / "a.csv", drives, "tests")
    lines = (tmp_path / "a.csv").read_text().splitlines()
    cells = lines[40].split(",")
    lines[40] = ",".join([*cells[:-1], "nan"])
    (tmp_path / "a.csv").write_text("\n".join(lines))
    with pytest.warns(Notice, match="left out: a.csv: drive .* is not finite"):
        left = ownrobot.read_drives("a.csv", drives[0].body, skip_bad=True)
    assert len(left) == 23
