"""Files that cannot be read: one line names the file, the place and what to do."""

from pathlib import Path

import numpy as np
import pytest

from ownrobot.body_file import read_body
from ownrobot.recordings import RecordingError, RecordingWarning, read_drives
from sidm.body import Body
from sidm.config import ConfigError

BODY = Body(
    name="cart",
    pose="planar",
    columns=(("wheel", "rad/s"),),
    actions=(("throttle", "%"),),
)
NAMES = "x [m],y [m],yaw [rad],wheel [rad/s],throttle [%]"


def rows(count: int = 41) -> list[list[float]]:
    """A cart on a circle of 2 m at 20 Hz, with a throttle in per cent."""
    time = np.arange(count) / 20
    yaw = 0.5 * time
    columns = [2 * np.sin(yaw), 2 - 2 * np.cos(yaw), yaw, 5 + np.sin(time)]
    return np.column_stack([*columns, 50 * np.cos(3 * time)]).tolist()


def text(names: str = NAMES, count: int = 41, header: str = "# rate: 20 Hz\n") -> str:
    lines = [",".join(f"{value:.9g}" for value in row) for row in rows(count)]
    return header + "\n".join([names, *lines]) + "\n"


def put(line: int, cell: int, value: str) -> str:
    """The file with another text in one cell; lines count from 1."""
    lines = text().splitlines()
    cells = lines[line - 1].split(",")
    cells[cell] = value
    return "\n".join([*lines[: line - 1], ",".join(cells), *lines[line:]]) + "\n"


#: Name of the file -> its content, the place and the mend that its line names.
BAD = {
    "empty.csv": ("", "the file is empty", ""),
    "blank.csv": ("\n\n\n", "the file is empty", ""),
    "header-alone.csv": ("# rate: 20 Hz\n", "no rows of numbers", "after its header"),
    "names-alone.csv": (text(count=0), "it has no rows of numbers", "a drive has many"),
    "one-row.csv": (text(count=1), "a single row of numbers", "a drive has many"),
    "no-names.csv": (
        text().replace(NAMES + "\n", ""),
        "line 2 has numbers",
        "write the names and units of the columns there, as 'x [m]'",
    ),
    "short-line.csv": (
        text() + "1,2\n",
        "line 44 has 2 cells, not 5",
        "write a cell for each name",
    ),
    "decimal-commas.csv": (
        text().replace(".", ","),
        "line 4 has 10 cells, not 5",
        "Use points, or semicolons between cells",
    ),
    "mixed-separators.csv": (
        text() + "1;2;3;4;5\n",
        "line 44 has 1 cells, not 5; it seems to be separated by semicolons",
        "use commas, and points in numbers",
    ),
    "huge.csv": (put(10, 3, "1e300"), "line 10: '1e300' of 'wheel'", "leave the line"),
    "infinite.csv": (put(10, 3, "inf"), "line 10: 'inf' of 'wheel'", "leave the line"),
    "word.csv": (put(10, 3, "fast"), "line 10: 'fast' of 'wheel'", "leave the line"),
    "gap.csv": (put(10, 3, ""), "line 10: '' of 'wheel' is no finite number", "leave"),
    "two-columns.csv": (
        text(NAMES.replace("throttle [%]", "wheel [rad/s]")),
        "'throttle' of body 'cart' is missing",
        "known: x, y, yaw, wheel",
    ),
    "unit.csv": (
        text(NAMES.replace("rad/s", "m/s")),
        "'wheel' in 'm/s'",
        "an angular velocity is in rad/s or deg/s or rpm",
    ),
    "no-unit.csv": (text(NAMES.replace(" [m]", "")), "'x' without a unit", "m or cm"),
    "no-rate.csv": (text(header=""), "neither a line '# rate", "nor a column 'time"),
    "noise.csv": (b"\x93\xff\xfe\x00\x81" * 100, "cannot be read as text", ""),
    "noise.csv.gz": (b"no archive", "cannot be read as text", ""),
    "noise.npz": (
        b"no archive" * 30,
        "cannot be read as .npz (it is no archive)",
        "copy it again, or write it with numpy.savez",
    ),
    "noise.bag": (b"no bag" * 30, "the bag cannot be read", "is it cut off?"),
    "drive_0.db3": (b"", "a file inside a ROS 2 bag", "give the bag's folder, "),
    "drive_0.mcap": (b"", "a file inside a ROS 2 bag", "give the bag's folder, "),
    "drive.xlsx": (b"", "drives are .csv, .csv.gz, .npz or ROS bags", ""),
}


def line_of(error: pytest.ExceptionInfo[ValueError], path: Path) -> str:
    """The error's message, which is one line that begins with the file's path."""
    message = str(error.value)
    assert "\n" not in message and message.startswith(str(path))
    return message


@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_is_refused_in_one_line(tmp_path, name):
    content, place, mend = BAD[name]
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(RecordingError) as error:
        read_drives(path, BODY)
    message = line_of(error, path)
    assert place in message and mend in message


def test_a_folder_without_drives_says_what_is_missing(tmp_path):
    with pytest.raises(RecordingError) as error:
        read_drives(tmp_path, BODY)
    message = line_of(error, tmp_path)
    assert "no file of drives" in message and "the folder that has them" in message
    (tmp_path / "drive_0.mcap").write_bytes(b"")
    with pytest.raises(RecordingError) as error:
        read_drives(tmp_path, BODY)
    assert "drive_0.mcap has no metadata.yaml" in line_of(error, tmp_path)
    assert "ros2 bag reindex" in str(error.value)


def test_a_file_that_is_not_there_is_named(tmp_path):
    path = tmp_path / "none.csv"
    with pytest.raises(RecordingError, match="there is no such file") as error:
        read_drives(path, BODY)
    line_of(error, path)


def test_topics_are_refused_beside_files_that_are_no_bags(tmp_path):
    path = tmp_path / "drive.csv"
    path.write_text(text())
    with pytest.raises(RecordingError, match="leave --topics out") as error:
        read_drives(path, BODY, ["/odom"])
    line_of(error, path)


def test_a_number_in_an_array_that_no_sensor_measures_is_named(tmp_path):
    """Numbers of an .npz file have no lines; the message counts rows."""
    columns = ["x", "y", "yaw", "wheel", "throttle"]
    units = '["m", "m", "rad", "rad/s", "%"]'
    names = ", ".join(f'"{name}"' for name in columns)
    numbers = np.array(rows())
    numbers[4, 3] = -1e30
    np.savez(
        tmp_path / "drive.npz",
        rows=numbers,
        lengths=[41],
        header=f'{{"columns": [{names}], "units": {units}, "rate": 20, "origin": ""}}',
    )
    with pytest.raises(
        RecordingError, match="'wheel' in row 5 is -1e.30, beyond 1e15; leave the row"
    ) as error:
        read_drives(tmp_path / "drive.npz", BODY)
    line_of(error, tmp_path / "drive.npz")


def test_a_key_of_a_body_that_is_given_twice_is_refused(tmp_path):
    path = tmp_path / "robot.yaml"
    path.write_text("pose: none\ncolumns: {v: m/s}\nactions: {u: 1}\npose: planar\n")
    with pytest.raises(
        ConfigError, match="line 4: 'pose' is given twice; leave one"
    ) as error:
        read_body(path)
    line_of(error, path)


@pytest.mark.parametrize(("sign", "point"), [(";", "."), (";", ","), ("\t", ",")])
def test_semicolons_tabs_and_decimal_commas_are_read(tmp_path, sign, point):
    path, other = tmp_path / "drive.csv", tmp_path / "other.csv"
    path.write_text(text())
    header, *lines = text().splitlines()
    changed = [line.replace(",", sign).replace(".", point) for line in lines]
    other.write_text("\n".join([header, *changed, "", ""]))
    (expected,), (drive,) = read_drives(path, BODY), read_drives(other, BODY)
    assert np.array_equal(drive.states, expected.states)
    assert np.array_equal(drive.actions, expected.actions)
    assert np.abs(drive.actions).max() == pytest.approx(0.5, abs=0.01)  # from per cent


def test_an_unknown_unit_is_kept_and_told(tmp_path):
    body = Body(
        name="nose",
        pose="planar",
        columns=(("wheel", "rads/s"),),
        actions=BODY.actions,
    )
    path = tmp_path / "drive.csv"
    path.write_text(text(NAMES.replace("rad/s", "rads/s")))
    with pytest.warns(
        RecordingWarning, match="'wheel' is in 'rads/s', an unknown .*rad/s'"
    ):
        (drive,) = read_drives(path, body)
    assert drive.states[0, 3] == 5
    path.write_text(text())
    with pytest.raises(
        RecordingError, match="'wheel' in 'rad/s'; the body has it in rads/s"
    ):
        read_drives(path, body)


def test_bad_files_are_left_out_when_asked(tmp_path):
    (tmp_path / "a.csv").write_text(text())
    (tmp_path / "b.csv").write_text(put(10, 3, "fast"))
    (tmp_path / "c.csv").write_text(text(count=9))
    with pytest.raises(RecordingError, match="b.csv"):
        read_drives(tmp_path, BODY)
    with pytest.warns(RecordingWarning) as notes:
        (drive,) = read_drives(tmp_path, BODY, skip_bad=True)
    assert "a.csv" in drive.name
    first, second = (str(note.message) for note in notes)
    assert first.startswith(f"left out: {tmp_path / 'b.csv'}: line 10")
    assert second.startswith(f"left out: {tmp_path / 'c.csv'}: 4 steps of 0.1 s")
    (tmp_path / "a.csv").unlink()
    with (
        pytest.raises(RecordingError, match="b.csv: line 10: 'fast'"),
        pytest.warns(RecordingWarning),
    ):
        read_drives(tmp_path, BODY, skip_bad=True)


def test_a_bad_drive_of_a_file_is_left_out_when_asked(tmp_path):
    lines = text().splitlines()
    jumped = put(2 + 21, 0, "99").splitlines()
    parts = [lines[2:], jumped[2:], lines[2:]]
    drives = [f"{number},{line}" for number, part in enumerate(parts) for line in part]
    path = tmp_path / "drives.csv"
    path.write_text("\n".join([lines[0], "drive," + lines[1], *drives]) + "\n")
    with pytest.raises(RecordingError, match="drive 1: .* m farther within one step"):
        read_drives(path, BODY)
    with pytest.warns(RecordingWarning, match="left out: .*drive 1: 1 s after its"):
        kept = read_drives(path, BODY, skip_bad=True)
    assert [drive.name[-1] for drive in kept] == ["0", "2"]
