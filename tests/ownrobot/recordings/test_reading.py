"""Drives of any body: contents of a file, resampling, and faults in one line."""

import gzip

import numpy as np
import pandas as pd
import pytest

from ownrobot.recordings import (
    RecordingError,
    RecordingWarning,
    read_drives,
    write_drives,
)
from sidm.body import DRIVE, ROVER, TWIST, Body
from sidm.config import replace

BODY = Body(
    name="cart",
    pose="planar",
    columns=(("yaw_rate", "rad/s"), ("wheel", "rad/s")),
    actions=(("left", "1"),),
)
NAMES = "x [m],y [m],yaw [rad],yaw_rate [rad/s],wheel [rad/s],left [1]"


def circle(count: int = 41, rate: float = 20.0) -> np.ndarray:
    """Rows (R, 6) of a cart on a circle of 2 m that turns at 0.5 rad/s."""
    time = np.arange(count) / rate
    yaw = 0.5 * time
    return np.column_stack(
        [
            2 * np.sin(yaw),
            2 - 2 * np.cos(yaw),
            yaw,
            0.5 + 0.01 * np.sin(time),
            5 + np.sin(time),
            np.cos(3 * time),
        ]
    )


def text(rows: np.ndarray, names: str = NAMES, header: str = "# rate: 20 Hz\n") -> str:
    return (
        header
        + names
        + "\n"
        + "\n".join(",".join(f"{value:.9g}" for value in row) for row in rows)
        + "\n"
    )


@pytest.fixture
def write(tmp_path):
    def write(content: str, name: str = "drive.csv"):
        path = tmp_path / name
        path.write_bytes(
            gzip.compress(content.encode())
            if name.endswith(".gz")
            else content.encode()
        )
        return path

    return write


@pytest.mark.parametrize("name", ["drive.csv", "drive.csv.gz"])
def test_a_file_is_read_at_the_bodys_rate(write, name):
    rows = circle()
    (drive,) = read_drives(write(text(rows), name), BODY)
    assert drive.states.shape == (21, 5) and drive.actions.shape == (20, 1)
    assert np.allclose(drive.states, rows[::2, :5], atol=1e-8)
    assert np.allclose(drive.actions[:, 0], (rows[:-1:2, 5] + rows[1::2, 5]) / 2)


def test_columns_come_in_any_order_and_unit_and_others_are_left_out(write):
    rows = circle()
    other = np.column_stack([rows[:, ::-1], np.zeros(len(rows))])
    other[:, 3] = np.degrees(other[:, 3])
    other[:, 5] *= 100
    names = "left,wheel [rad/s],yaw_rate [rad/s],yaw [deg],y [m],x [cm],battery [V]"
    (drive,) = read_drives(write(text(other, names)), BODY)
    assert np.allclose(drive.states, rows[::2, :5], atol=1e-6)


def test_uneven_times_are_interpolated(write, rng):
    time = np.cumsum(rng.uniform(0.08, 0.13, 60))
    yaw = 0.5 * time
    place = [2 * np.sin(yaw), 2 - 2 * np.cos(yaw), yaw]
    rows = np.column_stack(
        [time, *place, 0.5 + 0.01 * np.sin(time), 5 + time, np.sin(time)]
    )
    (drive,) = read_drives(write(text(rows, "time [s]," + NAMES, "")), BODY)
    assert np.allclose(np.diff(drive.states[:, 2]), 0.05, atol=1e-9)
    assert np.allclose(np.diff(drive.states[:, 4]), 0.1, atol=1e-9)


def slow_pose(every: int, count: int = 41) -> np.ndarray:
    """Rows of the circle whose pose is new in each row of number 1 + k * `every`."""
    rows = circle(count)
    new = np.maximum((np.arange(count) - 1) // every * every + 1, 0)
    rows[:, :3] = rows[new, :3]
    return rows


def test_a_slow_sensors_pose_is_interpolated(write):
    """At the times of the control steps the rows repeat an older pose."""
    (drive,) = read_drives(write(text(slow_pose(2))), BODY)
    assert np.allclose(np.diff(drive.states[1:-1, 2]), 0.05, atol=1e-6)


def test_a_sensor_far_slower_than_the_rows_is_interpolated(write):
    """Rows come at 100 Hz, and the pose at 10 Hz."""
    rows = circle(401, rate=100.0)
    new = np.maximum((np.arange(401) - 4) // 10 * 10 + 4, 0)
    rows[:, :3] = rows[new, :3]
    (drive,) = read_drives(write(text(rows, header="# rate: 100 Hz\n")), BODY)
    assert np.allclose(np.diff(drive.states[1:-1, 2]), 0.05, atol=1e-6)


@pytest.mark.parametrize(
    ("rows", "rate", "words"),
    [
        (circle(), 100.0, "rows come at 20 Hz, but body 'cart' has steps at 100 Hz; "),
        (slow_pose(2), 20.0, "its pose is new at 10 Hz, but body 'cart' has steps at"),
        (
            slow_pose(5, 101),
            10.0,
            "its pose is new at 4 Hz, but body 'cart' has steps at",
        ),
    ],
)
def test_a_rate_that_the_rows_do_not_have_is_refused(write, rows, rate, words):
    path = write(text(rows))
    with pytest.raises(RecordingError, match=f"^{path}: {words}") as error:
        read_drives(path, replace(BODY, rate=rate))
    right = (
        str(error.value).rpartition("write 'rate: ")[2].removesuffix(" Hz' in the body")
    )
    assert len(read_drives(path, replace(BODY, rate=float(right)))) == 1


def paused(*pauses: float, count: int = 81) -> str:
    """A file of the circle whose time stands still for a second at some times, s."""
    time = np.arange(count) / 20
    later = time + sum((time > pause).astype(float) for pause in pauses)
    return text(np.column_stack([later, circle(count)]), "time [s]," + NAMES, "")


def test_a_pause_makes_two_drives_of_one_session(write):
    path = write(paused(1.5))
    with pytest.warns(RecordingWarning) as notes:
        first, second = read_drives(path, BODY)
    assert [str(note.message) for note in notes] == [
        f"{path}: 1 pause (1.5 s after its start): 2 drives are made of it"
    ]
    assert (len(first), len(second)) == (15, 24)
    assert first.session == second.session and first.name != second.name
    assert np.allclose(second.states, circle(81)[31::2, :5], atol=1e-8)


def test_pieces_that_are_too_short_are_left_out(write):
    with pytest.warns(
        RecordingWarning, match="2 pauses .* 3 drives .*; 1 shorter than 8"
    ):
        assert len(read_drives(write(paused(1.5, 1.9)), BODY)) == 2
    path = write(paused(0.5, 1.0, 1.5, count=41))
    with pytest.raises(
        RecordingError, match="between its 3 pauses, 5 steps of 0.1 s; a drive has 8"
    ):
        read_drives(path, BODY)


def test_a_time_hardly_longer_than_a_step_is_no_pause(write):
    time = np.arange(81) / 50
    time[40:] += 0.1
    rows = np.column_stack([time, circle(81, 50.0)])
    path = write(text(rows, "time [s]," + NAMES, ""))
    assert len(read_drives(path, BODY)) == 1


def test_a_robot_that_stands_still_is_left_where_it_is(write):
    rows = circle()
    rows[10:20, :3] = rows[10, :3]
    (drive,) = read_drives(write(text(rows)), BODY)
    assert np.allclose(drive.states[5:10, :3], rows[10, :3])


def test_drives_and_sessions_are_told_apart(write):
    rows = np.vstack([circle(), circle(), circle()])
    lines = text(rows).splitlines()
    labels = ["a,0"] * 41 + ["a,1"] * 41 + ["b,0"] * 41
    body = [
        lines[0],
        "session,drive," + lines[1],
        *(f"{k},{line}" for k, line in zip(labels, lines[2:], strict=True)),
    ]
    drives = read_drives(write("\n".join(body) + "\n"), BODY)
    assert [drive.session for drive in drives] == ["a", "a", "b"]


def test_a_folder_is_read_file_by_file(write, tmp_path):
    (
        write(text(circle()), "a.csv"),
        write(text(circle()), "b.csv.gz"),
        write("notes", "readme.txt"),
    )
    assert len(read_drives(tmp_path, BODY)) == 2


def test_what_is_written_reads_back(write, tmp_path):
    drives = read_drives(write(text(circle())), BODY)
    write_drives(tmp_path / "again.csv.gz", drives, "a test")
    (again,) = read_drives(tmp_path / "again.csv.gz", BODY)
    assert np.allclose(again.states, drives[0].states, rtol=1e-8)
    assert again.session == drives[0].session


def test_numbers_are_written_in_the_unit_that_stands_above_them(write, tmp_path):
    """Files have SI units, whatever the body's units are.

    A session may have a comma in its name.
    """
    body = Body(
        name="cart",
        pose="planar",
        columns=(("yaw_rate", "deg/s"), ("wheel", "rad/s")),
        actions=BODY.actions,
    )
    drives = [
        replace(drive, session="a, b")
        for drive in read_drives(write(text(circle())), body)
    ]
    write_drives(tmp_path / "again.csv", drives, "a test")
    (again,) = read_drives(tmp_path / "again.csv", body)
    assert again.session == "a, b"
    assert np.allclose(again.states, drives[0].states, rtol=1e-8)


def test_a_command_may_be_held_where_nothing_is_learnt(write):
    path = write(text(circle() * [1, 1, 1, 1, 1, 0]))
    assert len(read_drives(path, BODY, held=True)) == 1


def test_slow_drives_with_velocities_are_read(write):
    """The rate is 1 Hz; the drive is straight at 1 m/s."""
    names = ",".join(
        f"{name} [{unit}]" for name, unit in (*ROVER.state, *ROVER.actions)
    )
    rows = np.zeros((20, len(names.split(","))))
    rows[:, 0], rows[:, 6], rows[:, 7], rows[:, 13] = np.arange(20), 1, 1, 0.5
    slow = Body(name="slow", pose="spatial", columns=TWIST, actions=DRIVE, rate=1.0)
    assert len(read_drives(write(text(rows, names, "# rate: 1 Hz\n")), slow)) == 1


def test_a_file_of_many_drives_keeps_their_sessions(write, tmp_path):
    (drive,) = read_drives(write(text(circle())), BODY)
    write_drives(
        tmp_path / "many.npz",
        [replace(drive, session=name) for name in "aab"],
        "a test",
    )
    drives = read_drives(tmp_path / "many.npz", BODY)
    assert [one.session for one in drives] == ["a", "a", "b"]
    assert all(
        np.allclose(one.states, drive.states, atol=1e-5) and one.ground is None
        for one in drives
    )


def test_drives_are_not_written_as_what_cannot_hold_them(tmp_path):
    with pytest.raises(ValueError, match="there are no drives to write"):
        write_drives(tmp_path / "none.csv", [], "nobody")


def with_value(column: int, row: int, value: float) -> np.ndarray:
    rows = circle()
    rows[row, column] = value
    return rows


TIMES = np.arange(41) / 20


@pytest.mark.parametrize(
    "content, words",
    [
        (
            text(circle()[:, 1:], NAMES.partition(",")[2]),
            "column 'x' of body 'cart' is missing",
        ),
        (text(circle(), NAMES.replace("wheel", "whel")), "did you mean 'whel'"),
        (
            text(circle(), NAMES.replace("yaw [rad]", "yaw [grad]")),
            "'yaw' in 'grad'; an angle is in rad or deg",
        ),
        (
            text(circle(), NAMES.replace("x [m]", "x")),
            "'x' without a unit; a length is in",
        ),
        (
            text(circle(), header=""),
            "it has neither a line '# rate: 10 Hz' nor a column 'time [s]'",
        ),
        (text(circle()) + '"' + "9," * 70_000, "is a quotation mark left open?"),
        (text(circle(), header="# rate: fast\n"), "not a positive number in Hz"),
        (text(circle(), header="# rat: 20 Hz\n"), "did you mean 'rate'"),
        (text(circle(), header="# 20 Hz\n"), "is not '# name: value'"),
        (
            text(with_value(3, 7, np.nan)),
            "line 10: 'nan' of 'yaw_rate' is no finite number",
        ),
        (
            text(circle()).replace(",0.5,", ",half,", 1),
            "line 3: 'half' of 'yaw_rate' is no finite number",
        ),
        (text(circle()) + "1,2\n", "line 44 has 2 cells, not 6"),
        (text(with_value(0, 20, 30.0)), "m farther within one step"),
        (text(circle() * [1, 1, 1, 1, 0, 1]), "'wheel' never changes"),
        (text(circle() * [1, 1, 1, 1, 1, 0]), "'left' never changes"),
        (text(circle() * [1, 1, 1, -1, 1, 1]), "of the other sign"),
        (text(circle() * [1, 1, 1, 57.3, 1, 1]), "in another unit or frame"),
        (text(circle(9)), "4 steps of 0.1 s; a drive has 8"),
        (text(circle()[:1]), "it has a single row of numbers"),
        ("", "it has no rows of numbers"),
        (
            text(
                circle(), "x [m]," + NAMES.partition(",")[2].replace("y [m]", "x [m]")
            ),
            "'y' of body 'cart' is missing",
        ),
        (
            text(np.column_stack([TIMES[::-1], circle()]), "time [s]," + NAMES, ""),
            "sort the rows",
        ),
        (
            text(
                np.column_stack([np.r_[TIMES[:20], TIMES[19:40]], circle()]),
                "time [s]," + NAMES,
                "",
            ),
            "the same time",
        ),
    ],
)
def test_a_fault_is_one_line_that_names_file_place_and_fault(write, content, words):
    path = write(content)
    with pytest.raises(RecordingError) as error:
        read_drives(path, BODY)
    assert words in str(error.value)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)


def test_a_file_that_is_cut_off_is_named(write, tmp_path):
    path = write(text(circle()), "drive.csv.gz")
    path.write_bytes(path.read_bytes()[:-30])
    with pytest.raises(RecordingError, match="cannot be read as text"):
        read_drives(path, BODY)


def test_the_recorded_robots_are_read():
    """Recordings have minutes of motion at 10 Hz.

    They are windows of 2 s, and runs of about two minutes.
    """
    from pathlib import Path

    from ownrobot.body_file import read_body

    folder = Path(__file__).parents[3] / "recordings"
    for robot, body, count, minutes in (
        ("warthog", "skid_steer", 287, 9.1),
        ("husky", "skid_steer", 480, 15.2),
        ("hunter", "hunter", 80, 149.0),
    ):
        drives = read_drives(
            folder / f"{robot}.csv.gz", read_body(folder / f"{body}.yaml")
        )
        assert len(drives) == count
        assert sum(len(drive.actions) for drive in drives) / 600 == pytest.approx(
            minutes, abs=0.1
        )


def table(rows: np.ndarray, body: Body = BODY) -> pd.DataFrame:
    """Rows (R, 6) at 20 Hz as a table in memory."""
    names = [name for name, _ in (*body.state, *body.actions)]
    return pd.DataFrame(rows, columns=names).assign(time=np.arange(len(rows)) / 20)


def test_a_table_in_memory_is_read_and_checked_like_a_file(write):
    (drive,) = read_drives(table(circle()), BODY)
    (same,) = read_drives(write(text(circle())), BODY)
    assert drive.states == pytest.approx(same.states, abs=1e-5)
    for factors, fault in (
        ([1, 1, 1, -1, 1, 1], "the table: .* of the other sign"),
        ([1, 1, 1, 57.3, 1, 1], "in another unit or frame"),
        ([1, 1, 1, 1, 0, 1], "'wheel' never changes"),
    ):
        with pytest.raises(RecordingError, match=fault):
            read_drives(table(circle() * factors), BODY)
    with pytest.raises(RecordingError, match="the table has no column 'wheel'"):
        read_drives(table(circle()).drop(columns="wheel"), BODY)


def test_a_unit_of_a_table_that_is_not_known_is_told():
    body = replace(BODY, columns=(("yaw_rate", "rad/s"), ("wheel", "furlong")))
    with pytest.warns(RecordingWarning, match="'wheel' is in 'furlong', an unknown"):
        read_drives(table(circle(), body), body)
