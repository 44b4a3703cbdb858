"""Drives of any body from files and tables, `ownrobot check` and `ownrobot body`."""

import gzip
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from ownrobot.__main__ import main
from ownrobot.body_file import read_body
from ownrobot.fitting.arguments import drives_from
from ownrobot.recordings import (
    RecordingError,
    RecordingWarning,
    guess_body,
    read_drives,
    write_drives,
)
from sidm.config import ConfigError, Notice, replace
from tests.ownrobot.cart import planar

BODY = planar("cart", {"yaw_rate": "rad/s", "wheel": "rad/s"}, {"throttle": "%"})
NAMES = "x [m],y [m],yaw [rad],yaw_rate [rad/s],wheel [rad/s],throttle [%]"
RATE = "# rate: 20 Hz\n"


def circle(count: int = 41, rate: float = 20.0) -> np.ndarray:
    """Rows (R, 6) of a cart on a circle of 2 m that turns at 0.5 rad/s."""
    time = np.arange(count) / rate
    yaw = 0.5 * time
    place = [2 * np.sin(yaw), 2 - 2 * np.cos(yaw), yaw]
    rates = [0.5 + 0.01 * np.sin(time), 5 + np.sin(time)]
    return np.column_stack([*place, *rates, 100 * np.cos(3 * time)])


def text(rows: np.ndarray | None = None, names: str = NAMES, header: str = RATE) -> str:
    rows = circle() if rows is None else rows
    lines = [",".join(f"{value:.9g}" for value in row) for row in rows]
    return header + "\n".join([names, *lines]) + "\n"


def timed(time: np.ndarray, rows: np.ndarray) -> str:
    return text(np.column_stack([time, rows]), f"time [s],{NAMES}", "")


def put(line: int, cell: int, value: str) -> str:
    """The file with another text in one cell; lines count from 1."""
    lines = text().splitlines()
    cells = lines[line - 1].split(",")
    cells[cell] = value
    return "\n".join([*lines[: line - 1], ",".join(cells), *lines[line:]]) + "\n"


@pytest.fixture
def write(tmp_path):
    def write(content: str | bytes, name: str = "drive.csv"):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write


def test_columns_come_in_any_order_and_unit_and_others_are_left_out(write):
    rows = circle()
    other = np.column_stack([rows[:, ::-1], 50 * np.arange(len(rows)), 0 * rows[:, 0]])
    other[:, 0] /= 100
    other[:, 3] = np.degrees(other[:, 3])
    other[:, 5] *= 100
    names = "throttle,wheel [rad/s],yaw_rate [rad/s],yaw [deg],y [m],x [cm],time [ms],b"
    content = gzip.compress(text(other, names, "").encode())
    (drive,) = read_drives(write(content, "drive.csv.gz"), BODY)
    assert np.allclose(drive.states, rows[::2, :5], atol=1e-6)
    assert np.allclose(drive.actions[:, 0], (rows[:-1:2, 5] + rows[1::2, 5]) / 200)


def test_uneven_times_are_interpolated(write, rng):
    time = np.cumsum(rng.uniform(0.08, 0.13, 60))
    rows = circle(60)
    rows[:, :3] = np.stack([2 * np.sin(time / 2), 2 - 2 * np.cos(time / 2), time / 2]).T
    rows[:, 4] = 5 + time
    (drive,) = read_drives(write(timed(time, rows)), BODY)
    assert np.allclose(np.diff(drive.states[:, 2]), 0.05, atol=1e-9)
    assert np.allclose(np.diff(drive.states[:, 4]), 0.1, atol=1e-9)


def test_a_row_that_is_a_little_late_is_of_its_step(write, rng):
    rows, late = circle(), np.arange(41) / 20
    late[1:-1] += rng.uniform(0, 4e-3, 39)
    (exact,) = read_drives(write(text(rows)), BODY)
    (drive,) = read_drives(write(timed(late, rows)), BODY)
    assert np.allclose(drive.actions, exact.actions)


def test_commands_of_an_angle_are_averaged_around_the_circle(write):
    rows = circle()
    rows[:, 5] = np.where(np.arange(41) % 2, 3.1, -3.1) + 0.02 * np.sin(np.arange(41))
    turning = replace(BODY, actions=(("heading", "rad"),))
    names = NAMES.replace("throttle [%]", "heading [rad]")
    (drive,) = read_drives(write(text(rows, names)), turning)
    assert np.abs(np.cos(drive.actions) + 1).max() < 1e-2


def slow_pose(every: int, first: int = 1, count: int = 41, rate=20.0) -> np.ndarray:
    """Rows of the circle whose pose is new in each row of number first + k * every."""
    rows = circle(count, rate)
    new = np.maximum((np.arange(count) - first) // every * every + first, 0)
    rows[:, :3] = rows[new, :3]
    return rows


@pytest.mark.parametrize(
    ("rows", "rate"), [(slow_pose(2), 20), (slow_pose(10, 4, 401, 100.0), 100)]
)
def test_a_slow_sensors_pose_is_interpolated(write, rows, rate):
    (drive,) = read_drives(write(text(rows, header=f"# rate: {rate} Hz\n")), BODY)
    assert np.allclose(np.diff(drive.states[1:-1, 2]), 0.05, atol=1e-6)


def test_a_robot_that_stands_still_is_left_where_it_is(write):
    rows = circle()
    rows[10:20, :3] = rows[10, :3]
    (drive,) = read_drives(write(text(rows)), BODY)
    assert np.allclose(drive.states[5:10, :3], rows[10, :3])


def test_a_rate_that_the_rows_do_not_have_is_refused(write):
    for rows, rate, words in (
        (circle(), 100.0, "rows come at 20 Hz, but body 'cart' has steps at 100 Hz; "),
        (slow_pose(2), 20.0, "its pose is new at 10 Hz, but body 'cart' has steps"),
        (slow_pose(5, count=101), 10.0, "its pose is new at 4 Hz, but body 'cart'"),
    ):
        path = write(text(rows))
        with pytest.raises(RecordingError, match=f"^{path}: {words}") as error:
            read_drives(path, replace(BODY, rate=rate))
        right = str(error.value).rpartition("write 'rate: ")[2].partition(" Hz")[0]
        assert len(read_drives(path, replace(BODY, rate=float(right)))) == 1


def paused(*pauses: float, count: int = 81) -> str:
    time = np.arange(count) / 20
    later = time + sum((time > pause).astype(float) for pause in pauses)
    return timed(later, circle(count))


def test_a_pause_makes_two_drives_of_one_session(write):
    path = write(paused(1.5))
    with pytest.warns(
        RecordingWarning, match=f"{path}: 1 pause .1.5 s after its start.: 2 drives"
    ):
        first, second = read_drives(path, BODY)
    assert (len(first), len(second)) == (15, 24)
    assert first.session == second.session and first.name != second.name
    assert np.allclose(second.states, circle(81)[31::2, :5], atol=1e-8)


def test_short_pieces_are_left_out_and_short_gaps_are_no_pause(write):
    with pytest.warns(RecordingWarning, match="2 pauses .*; 1 shorter than 8 steps"):
        assert len(read_drives(write(paused(1.5, 1.9)), BODY)) == 2
    path = write(paused(0.5, 1.0, 1.5, count=41))
    with pytest.raises(RecordingError, match="between its 3 pauses, 5 steps of 0.1 s"):
        read_drives(path, BODY)
    time = np.arange(81) / 50
    time[40:] += 0.1  # hardly longer than a step
    assert len(read_drives(write(timed(time, circle(81, 50.0))), BODY)) == 1


def test_what_is_written_in_si_units_reads_back(write, tmp_path):
    """A session may have a comma in its name."""
    body = replace(BODY, columns=(("yaw_rate", "deg/s"), ("wheel", "rad/s")))
    (drive,) = read_drives(write(text()), body)
    for name in ("again.csv.gz", "again.csv.xz", "again.npz"):
        drives = [replace(drive, session=session) for session in ("a, b", "a, b", "c")]
        write_drives(tmp_path / name, drives, "a test")
        again = read_drives(tmp_path / name, body)
        assert [one.session for one in again] == ["a, b", "a, b", "c"]
        assert np.allclose(again[2].states, drive.states, rtol=1e-6)


@pytest.mark.parametrize("rate", [12.0, 12.5, 15.0, 25.0])
def test_an_action_is_the_mean_of_what_is_commanded_in_its_step(write, rng, rate):
    """Rows whose rate is no multiple of the body's count by their share of the step."""
    body = replace(BODY, pose="none", columns=(("wheel", "rad/s"),))
    values, time = rng.uniform(-1, 1, 80), np.arange(80) / rate
    lines = [f"{wheel:.9g},{u:.9g}" for wheel, u in zip(time, values, strict=True)]
    header = f"# rate: {rate} Hz\nwheel [rad/s],throttle [1]\n"
    (drive,) = read_drives(write(header + "\n".join(lines)), body)
    fine = 0.1 * (np.arange(len(drive))[:, None] + (np.arange(1000) + 0.5) / 1000)
    commanded = values[np.searchsorted(time, fine, side="right") - 1].mean(1)
    assert drive.actions[:, 0] == pytest.approx(commanded, abs=2e-3)


def test_a_motors_turns_add_up_and_a_heading_wraps(write):
    """A motor turns by 5 rad between two rows; the heading crosses 180 degrees."""
    body = replace(BODY, columns=(("yaw_rate", "rad/s"), ("wheel", "rad")))
    rows = circle()
    rows[:, 2] = np.mod(rows[:, 2] + 3, 2 * np.pi)
    rows[:, 4] = 5 * np.arange(len(rows))
    (drive,) = read_drives(
        write(text(rows, NAMES.replace("rad/s],th", "rad],th"))), body
    )
    assert np.allclose(np.diff(drive.states[:, 4]), 10)
    assert np.allclose(np.diff(drive.states[:, 2]), 0.05)


def test_drives_in_map_coordinates_come_back(write, tmp_path):
    (drive,) = read_drives(write(text()), BODY)
    far = replace(drive, states=drive.states + [5e5, 4.5e6, 0, 0, 0])
    write_drives(tmp_path / "far.csv", [far], "a test")
    (again,) = read_drives(tmp_path / "far.csv", BODY)
    assert np.abs(again.states - far.states).max() < 1e-4


def test_drives_with_one_label_are_told_apart(write):
    rows = circle(123)
    lines = text(rows).splitlines()
    labels = ["1"] * 41 + ["#2"] * 41 + ["1"] * 41
    body = [f"{label},{line}" for label, line in zip(labels, lines[2:], strict=True)]
    drives = read_drives(write("\n".join([lines[0], f"drive,{lines[1]}", *body])), BODY)
    assert [drive.name.rpartition("drive ")[2] for drive in drives] == [
        "1",
        "#2",
        "1.2",
    ]
    assert len({drive.session for drive in drives}) == 3


def test_a_rate_keeps_all_its_digits(write, tmp_path):
    body = replace(BODY, rate=20 / 3)
    (drive,) = read_drives(write(text(circle(121))), body)
    write_drives(tmp_path / "again.csv", [drive], "a test")
    (again,) = read_drives(tmp_path / "again.csv", body)
    assert np.allclose(again.states, drive.states, rtol=1e-6)


TIMES = np.arange(41) / 20
#: What the one line of a fault says -> the content of the file.
BAD_CONTENT = {
    "no rows of numbers: the file is empty": "\n\n",
    "no rows of numbers: after its header": RATE,
    "no rows of numbers; a drive has many": text(circle(0)),
    "it has a single row of numbers": text(circle(1)),
    "4 steps of 0.1 s; a drive has 8": text(circle(9)),
    "line 2 has numbers; write the names": text().replace(NAMES + "\n", ""),
    "line 44 has 2 cells, not 6": text() + "1,2\n" + text().splitlines()[-1],
    "Use points, or semicolons between cells": text(circle()[1:]).replace(".", ","),
    "separated by semicolons: use commas, and": text()
    + "1;2;3;4;5;6\n"
    + text().splitlines()[-1],
    "line 10: '1e300' of 'wheel' is beyond 1e15": put(10, 4, "1e300"),
    "line 10: 'fast' of 'wheel' is no finite number; leave": put(10, 4, "fast"),
    "'wheel' of body 'cart' is missing; did you mean 'whel'": text(
        names=NAMES.replace("wheel", "whel")
    ),
    "an angular velocity is in rad/s or deg/s or rpm": text(
        names=NAMES.replace("wheel [rad", "wheel [m")
    ),
    "'x' without a unit; a length is in m or cm or mm": text(
        names=NAMES.replace("x [m]", "x")
    ),
    "neither a line '# rate: 10 Hz' nor a column 'time [s]'": text(header=""),
    "is a quotation mark left open?": text() + '"' + "9," * 70_000,
    "not a positive number in Hz": text(header="# rate: fast\n"),
    "did you mean 'rate'": text(header="# rat: 20 Hz\n"),
    "the header has two lines '# rate: ...'": text(header=RATE + RATE),
    "m farther within one step": put(23, 0, "30"),
    "'wheel' never changes": text(circle() * [1, 1, 1, 1, 0, 1]),
    "of the other sign": text(circle() * [1, 1, 1, -1, 1, 1]),
    "in another unit or frame": text(circle() * [1, 1, 1, 57.3, 1, 1]),
    "cut the file there, or name the parts": timed(TIMES[::-1], circle()),
    "the same time": timed(np.r_[TIMES[:20], TIMES[19:40]], circle()),
}
ARCHIVE = gzip.compress(text().encode())
#: Name of a file -> its content, and what the one line of its fault says.
BAD_FILES = {
    "noise.csv": (b"\x93\xff\xfe\x00\x81" * 100, "cannot be read as text"),
    "noise.csv.gz": (b"no archive", "cannot be read as text"),
    "cut-off.csv.gz": (ARCHIVE[:-30], "cannot be read as text"),
    "damaged.csv.gz": (
        ARCHIVE[:300] + bytes(40) + ARCHIVE[340:],
        "cannot be read as text",
    ),
    "noise.npz": (
        b"no archive" * 30,
        "cannot be read as .npz (it is no archive); copy it again",
    ),
    "noise.bag": (b"no bag" * 30, "the bag cannot be read"),
    "drive_0.db3": (b"", "a file inside a ROS 2 bag; give the bag's folder, "),
    "drive.xlsx": (b"", "drives are .csv, .csv.gz, .csv.xz, .npz or ROS bags"),
    "none.csv": (None, "there is no such file"),
}


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        *(("drive.csv", content, words) for words, content in BAD_CONTENT.items()),
        *((name, *fault) for name, fault in BAD_FILES.items()),
    ],
)
def test_a_fault_is_one_line_that_names_file_place_and_mend(
    write, tmp_path, name, content, words
):
    path = tmp_path / name if content is None else write(content, name)
    with pytest.raises(RecordingError) as error:
        read_drives(path, BODY)
    assert words in str(error.value)
    assert str(error.value).startswith(str(path)) and "\n" not in str(error.value)


def test_what_a_folder_does_not_have_and_what_is_not_read_is_said(write, tmp_path):
    with pytest.raises(RecordingError, match="the list of paths is empty"):
        read_drives([], BODY)
    with pytest.raises(RecordingError, match="no file of drives .* folder that has"):
        read_drives(tmp_path, BODY)
    write("", "drive_0.db3")
    with pytest.raises(RecordingError, match="no metadata.yaml, which 'ros2 bag rein"):
        read_drives(tmp_path, BODY)
    (tmp_path / "day1").mkdir()
    for name in ("a.csv", "B.CSV", "day1/a.csv", "b.tsv", "notes.txt"):
        write(text(), name)
    with pytest.warns(RecordingWarning, match=": 2 files are not read, as .*b.tsv"):
        assert len(read_drives(tmp_path, BODY)) == 2


def test_an_unknown_unit_is_kept_and_told(write):
    body = replace(BODY, columns=(("yaw_rate", "rad/s"), ("wheel", "rads/s")))
    path = write(text(names=NAMES.replace("wheel [rad/s]", "wheel [rads/s]")))
    for source in (path, table(circle())):
        with pytest.warns(RecordingWarning, match="in 'rads/s', an unknown .*rad/s'"):
            (drive,) = read_drives(source, body)
        assert drive.states[0, 4] == 5
    with pytest.raises(RecordingError, match="'rad/s'; the body has it in rads/s"):
        read_drives(write(text()), body)


def test_a_bad_drive_of_a_file_is_left_out_when_asked(write):
    for bad, words in (
        (put(23, 0, "99"), "drive 1: .* m farther within one step"),
        (put(40, 5, "nan"), "'throttle' .* no.* finite"),
    ):
        parts = [whole.splitlines()[2:] for whole in (text(), bad, text())]
        lines = [f"{n},{line}" for n, part in enumerate(parts) for line in part]
        path = write("\n".join([f"{RATE}drive,{NAMES}", *lines]))
        with pytest.raises(RecordingError, match=words):
            read_drives(path, BODY)
        with pytest.warns(RecordingWarning, match="left out: .*drive 1: "):
            kept = read_drives(path, BODY, skip_bad=True)
        assert [drive.name[-1] for drive in kept] == ["0", "2"]


def table(rows: np.ndarray) -> pd.DataFrame:
    names = [name for name, _ in (*BODY.state, *BODY.actions)]
    return pd.DataFrame(rows, columns=names).assign(time=np.arange(len(rows)) / 20)


def test_a_table_in_memory_is_read_and_checked_like_a_file(write):
    both = [table(circle()).assign(drive=number) for number in range(2)]
    (same,) = read_drives(write(text()), BODY)
    for drive in read_drives(pd.concat(both), BODY):
        assert drive.states == pytest.approx(same.states, abs=1e-5)
        in_percent = 100 * same.actions  # a table has no units
        assert drive.actions == pytest.approx(in_percent, abs=1e-5)
    with pytest.warns(Notice, match="novice has 1 drive given twice"):
        assert len(drives_from(pd.concat(both), BODY, "novice")) == 1
    with pytest.raises(RecordingError, match="the table: .* of the other sign"):
        read_drives(table(circle() * [1, 1, 1, -1, 1, 1]), BODY)
    with pytest.raises(RecordingError, match="the table has no column 'wheel'"):
        read_drives(table(circle()).drop(columns="wheel"), BODY)


RECORDINGS = Path(__file__).parents[3] / "recordings"
HELD = text(circle() * [1, 1, 1, 1, 1, 0])  # the command never changes


@pytest.fixture
def warthog(tmp_path, monkeypatch):
    shutil.copy(RECORDINGS / "warthog.csv.gz", tmp_path)
    shutil.copy(RECORDINGS / "skid_steer.yaml", tmp_path / "robot.yaml")
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "drives").mkdir()
    contents = {"a": text(), "b": put(10, 4, "fast"), "c": text(circle(9))}
    for name, content in contents.items():
        (tmp_path / "drives" / f"{name}.csv").write_text(content)
    (tmp_path / "cart.yaml").write_text(
        "pose: planar\ncolumns: {yaw_rate: rad/s, wheel: rad/s}\n"
        "actions: {throttle: '%'}\n"
    )
    monkeypatch.chdir(tmp_path)


def test_check_says_what_is_there_and_what_is_wrong(warthog, capsys):
    assert main(["check", "warthog.csv.gz", "--body", "robot.yaml"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == (
        "warthog.csv.gz: 287 drives without a fault of 96 sessions, 9.09 min"
    )
    assert "rows come at 20 Hz, and the body has 10 Hz" in lines[1]
    assert lines[6].split()[:2] == ["yaw_rate", "rad/s"]
    assert lines[11].startswith("note: warthog.csv.gz: 2 of 167 drives do not move")
    assert lines[12].startswith("nothing would be refused")
    assert main(["check", "warthog.csv.gz", "--body", "robot.yaml", "--skip-bad"]) == 0
    out = capsys.readouterr().out
    assert out.startswith("warthog.csv.gz: 285 drives")
    assert "left out: warthog.csv.gz drive 22/0: it moves 79 degrees off" in out


def test_check_fails_where_fit_would_and_names_all_faults(folder, capsys):
    options = ["drives", "--body", "cart.yaml"]
    assert main(["check", *options]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[-3].startswith("wrong: drives/b.csv: line 10: 'fast'")
    assert lines[-2].startswith("wrong: drives/c.csv: 4 steps of 0.1 s")
    assert lines[-1] == "--skip-bad leaves out each drive or file that is wrong"
    assert main(["check", *options, "--skip-bad"]) == 0
    assert "left out: drives/b.csv" in capsys.readouterr().out
    with pytest.warns(RecordingWarning, match="left out: .*b.csv: line 10"):
        (drive,) = read_drives("drives", BODY, skip_bad=True)
    assert "a.csv" in drive.name
    Path("drives/a.csv").unlink()
    with pytest.raises(RecordingError, match="b.csv: line 10"):
        read_drives("drives", BODY, skip_bad=True)
    assert main(["check", *options]) == 1


def test_a_guessed_body_reads_the_recording(warthog, capsys):
    assert main(["body", "warthog.csv.gz", "--out", "guess.yaml"]) == 0
    assert "guess.yaml: check it, then run" in capsys.readouterr().out
    guess, body = read_body("guess.yaml"), read_body("robot.yaml")
    assert (guess.state, guess.actions) == (body.state, body.actions)
    assert (guess.pose, guess.rate, guess.name) == ("planar", 10, "warthog")
    assert main(["body", "warthog.csv.gz"]) == 0
    assert capsys.readouterr().out == Path("guess.yaml").read_text()
    assert main(["body", "warthog.csv.gz", "--out", "guess.yaml"]) == 2
    assert "guess.yaml: there is such a file" in capsys.readouterr().err


def test_a_guess_says_what_it_leaves_out(tmp_path):
    path = tmp_path / "my drive.csv"
    names = "stamp,x [m],y [m],yaw [deg],battery [%],no,label,2nd,motor [A],cmd_a [V]"
    rows = [
        f"{t},{t},{t / 100},{t},50,{1 + t % 1},on,1,{t % 3},{np.sin(t)}"
        for t in np.arange(60) / 4
    ]
    path.write_text("\n".join(["# rate: 4 Hz", names, *rows]) + "\n")
    guess = guess_body(path)
    (tmp_path / "robot.yaml").write_text(guess.text)
    assert read_body(tmp_path / "robot.yaml") == guess.body
    assert guess.body.columns == (("no", "1"), ("motor", "A"))
    assert guess.body.actions == (("cmd_a", "V"),)
    assert (guess.body.name, guess.body.rate) == ("my drive", 4)
    assert guess.left_out == {
        "stamp": "it seems to count rows or time",
        "battery": "it never changes",
        "label": "60 of its 60 cells are no numbers",
        "2nd": "rename it: each name once, of letters, digits and _",
    }
    assert len(read_drives(path, tmp_path / "robot.yaml")) == 1


def test_a_file_that_gives_no_body_is_one_line(folder, capsys):
    time = 0.1 * np.arange(41)
    for content, words in (
        (HELD, "no command changes; record drives"),
        (text().replace("throttle", "gas"), "no column seems to be a command"),
        (timed(time // 0.2, circle()), "the same time as the row before it"),
        (timed(-time, circle()), "s before the row before it"),
    ):
        Path("odd.csv").write_text(content)
        assert main(["body", "odd.csv"]) == 1
        said = capsys.readouterr().err
        assert words in said and said.count("\n") == 1


def test_a_percent_sign_of_a_body_needs_quotation_marks(folder):
    lines = Path("cart.yaml").read_text()
    assert read_body("cart.yaml").actions[0] == ("throttle", "%")
    Path("cart.yaml").write_text(lines.replace("'%'", "%"))
    with pytest.raises(ConfigError, match="write a unit of % as '%'"):
        read_body("cart.yaml")


def test_several_files_are_read_together(folder, capsys):
    """A command that changes in one file alone is no fault of the other."""
    Path("held.csv").write_text(HELD)
    paths = ["drives/a.csv", "held.csv"]
    drives = drives_from(paths, BODY, "novice")
    assert [drive.name for drive in drives] == [f"{path} drive 0" for path in paths]
    with pytest.raises(RecordingError, match="held.csv: 'throttle' never changes"):
        read_drives("held.csv", BODY)
    assert len(read_drives("held.csv", BODY, allow_constant=True)) == 1
    assert main(["check", "held.csv", "--body", "cart.yaml"]) == 1
    out = capsys.readouterr().out
    assert "\nwrong: held.csv: 'throttle' never changes; mend it" in out
    assert len(drives_from(paths, BODY, "expert", topics=["/odom"])) == 2
