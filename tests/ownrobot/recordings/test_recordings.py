"""Recordings of the paper's robots with their ground, and each fault by its line."""

import json
from pathlib import Path

import numpy as np
import pytest

from ownrobot.recordings import RecordingError, read_drives, write_drives
from sidm.body import ROVER, SI
from sidm.drives import Drive, Ground
from sidm.terrain import height_at

ROOT = Path(__file__).parents[3]
COLUMNS = dict((*ROVER.state, *ROVER.actions))
NAMES, PLAIN = list(COLUMNS), [SI[unit] for unit in COLUMNS.values()]


def circle(rate: float = 10.0, seconds: float = 7.0) -> np.ndarray:
    """Rows (R, 15) of a robot on a circle about the origin, at 1 m/s and 0.5 rad/s.

    Its body is 0.17 m above flat ground.
    """
    time = np.arange(round(rate * seconds) + 1) / rate
    yaw = 0.5 * time
    rows = np.zeros((len(time), 15))
    rows[:, :3] = np.stack(
        [2 * np.sin(yaw), 2 - 2 * np.cos(yaw), np.full_like(yaw, 0.17)], axis=1
    )
    rows[:, 5], rows[:, 6] = np.sin(yaw / 2), np.cos(yaw / 2)
    rows[:, 7], rows[:, 12] = 1.0, 0.5
    rows[:, 13], rows[:, 14] = 0.4, np.sin(time)
    return rows


def ground() -> Ground:
    """A flat square of 8 m with its middle at the circle's."""
    return Ground(np.zeros((81, 81)), 0.1, (0.0, 2.0))


@pytest.fixture
def made(tmp_path):
    """A drive around the circle, or of other rows, as it is read from an .npz file."""

    def make(
        rows: np.ndarray | None = None,
        columns=NAMES,
        units=PLAIN,
        rate: float = 10.0,
        where=None,
    ) -> Drive:
        rows, where = circle() if rows is None else rows, where or ground()
        header = dict(
            columns=list(columns),
            units=list(units),
            rate=rate,
            spacing=where.spacing,
            height_unit="m",
            origin="here",
            centres=[list(where.centre)],
        )
        np.savez(
            tmp_path / "drive.npz",
            rows=rows,
            lengths=np.array([len(rows)]),
            ground=np.array([0]),
            heights=where.heights[None],
            header=np.array(json.dumps(header)),
        )
        (found,) = read_drives(tmp_path / "drive.npz", ROVER)
        return found

    return make


def changed(row: int, column: str, value: float) -> np.ndarray:
    """Rows of the circle with one number replaced."""
    rows = circle()
    rows[row, NAMES.index(column)] = value
    return rows


def test_positions_are_relative_to_the_middle_of_the_ground(made):
    drive = made()
    assert drive.states.shape == (71, 13) and drive.actions.shape == (70, 2)
    assert drive.states[0, :3] == pytest.approx((0, -2, 0.17))
    assert drive.ground.centre == (0, 0)
    assert np.linalg.norm(drive.states[:, :2], axis=1) == pytest.approx(2)


def test_a_faster_rate_is_brought_to_10_hz(made):
    """Every fifth row is kept, with the mean action of five rows."""
    fast, slow = made(circle(50.0), rate=50.0), made()
    assert np.allclose(fast.states, slow.states)
    assert fast.actions[:, 1] == pytest.approx(
        circle(50.0)[:350, 14].reshape(70, 5).mean(1)
    )


def test_units_are_those_of_the_header(made):
    """Units are mm, km/h and deg/s, in another order of columns, with times."""
    rows = circle()
    rows[:, :3] *= 1000
    rows[:, 7:10] *= 3.6
    rows[:, 10:13] = np.degrees(rows[:, 10:13])
    order = [*range(14, -1, -1)]
    units = ["mm"] * 3 + ["1"] * 4 + ["km/h"] * 3 + ["deg/s"] * 3 + ["1"] * 2
    time = 100.0 * np.arange(len(rows))[:, None]
    drive = made(
        np.hstack([rows[:, order], time]), [*NAMES[::-1], "time"], [*units[::-1], "ms"]
    )
    assert np.allclose(drive.states, made().states)
    assert np.allclose(drive.actions, made().actions)


def no(column: str) -> dict:
    """Rows of the circle without a column."""
    kept = [name for name in NAMES if name != column]
    units = [PLAIN[NAMES.index(name)] for name in kept]
    return dict(
        columns=kept, units=units, rows=np.delete(circle(), NAMES.index(column), 1)
    )


def turned() -> np.ndarray:
    """Rows of the circle with velocities in the world's frame."""
    rows, yaw = circle(seconds=30.0), 0.05 * np.arange(301)
    rows[:, 7:9] = np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
    return rows


def with_rates(turning: float) -> np.ndarray:
    """Rows of the circle with another rate of turning."""
    rows = circle()
    rows[:, 12] = turning
    return rows


def jumped() -> np.ndarray:
    """Rows of the circle, moved aside by a metre from the 31st row on."""
    rows = circle()
    rows[31:, 0] += 1.0
    return rows


def hill() -> Ground:
    """A slope that rises with x, and more with y, and is not straight."""
    x = np.linspace(-4, 4, 81)
    return Ground(
        0.05 * x[None] + 0.1 * x[:, None] + 0.02 * x[None] ** 2, 0.1, (0.0, 2.0)
    )


def over(where: Ground) -> np.ndarray:
    """Rows of the circle at 0.17 m above a ground."""
    rows = circle()
    rows[:, 2] += height_at(where.heights, rows[:, 0], rows[:, 1] - 2.0)
    rows[1:, 9] = np.diff(rows[:, 2]) * 10
    return rows


def test_a_hilly_drive_with_noise_is_taken(made):
    """Noise of three centimetres and ten milliseconds on every row is no fault."""
    rng, rows = np.random.default_rng(0), over(hill())
    rows[:, :3] += rng.normal(0, 0.03, (len(rows), 3))
    time = 0.1 * np.arange(len(rows)) + rng.normal(0, 0.01, len(rows))
    drive = made(
        np.hstack([rows, time[:, None]]), [*NAMES, "time"], [*PLAIN, "s"], where=hill()
    )
    assert len(drive.actions) >= 69


def test_attitudes_of_either_sign_are_one(made):
    """q and -q are the same attitude; no value is interpolated between them."""
    rows = circle(30.0)
    rows[40:, 3:7] *= -1
    assert np.allclose(
        made(rows, rate=30.0).states, made(circle(30.0), rate=30.0).states
    )


FAULTS = {
    "column 'qw' of body 'rover' is missing": no("qw"),
    "two columns 'x'": {
        "columns": [*NAMES, "x"],
        "units": [*PLAIN, "m"],
        "rows": np.hstack([circle(), circle()[:, :1]]),
    },
    "'x' in 'feet'; a length is in m or cm or mm": {"units": ["feet", *PLAIN[1:]]},
    "15 columns, 14 units": {"units": PLAIN[1:]},
    "a rate of nan Hz": {"rate": float("nan")},
    "a rate of -10 Hz": {"rate": -10.0},
    "'vx' in row 4 is not finite": {"rows": changed(3, "vx", np.nan)},
    "the quaternion in row 1 has length 0.5, not 1": {"rows": changed(0, "qw", 0.5)},
    "steering in step 8 is 35, not in [-1, 1]; scale it": {
        "rows": changed(7, "steering", 35.0)
    },
    "0 rows are no drive": {"rows": circle()[:0]},
    "drive 0: 0 rows are no drive": {
        "rows": np.zeros((0, 16)),
        "columns": [*NAMES, "time"],
        "units": [*PLAIN, "s"],
    },
    "a spacing of 0": {"where": ground()._replace(spacing=0.0)},
    "not a grid of heights": {"where": ground()._replace(heights=np.zeros((1, 5)))},
    "the height in row 3, column 5 is not finite": {
        "where": ground()._replace(
            heights=np.where(
                np.arange(81 * 81).reshape(81, 81) == 2 * 81 + 4, np.inf, 0.0
            )
        )
    },
    "from the middle of its ground, which ends at 4.00 m, 4.00 m": {
        "where": ground()._replace(centre=(9.0, 2.0))
    },
    "the robot is -9.83 m above the ground": {
        "where": ground()._replace(heights=np.full((81, 81), 10.0))
    },
    "velocities do not lead where the robot was": {"rows": turned()},
    "it turned by 0.5 rad a second by its attitudes, by 29 by 'wz'; "
    "is it in the unit that the header names?": {"rows": with_rates(np.degrees(0.5))},
    "3 s after its start the position jumps": {"rows": jumped()},
    "the map of the ground seems to be upside down": {
        "rows": over(hill()),
        "where": hill()._replace(heights=hill().heights[::-1]),
    },
    "the map of the ground seems to be the wrong way round": {
        "rows": over(hill()),
        "where": hill()._replace(heights=hill().heights[:, ::-1]),
    },
    "the map of the ground seems to be transposed": {
        "rows": over(hill()),
        "where": hill()._replace(heights=hill().heights.T),
    },
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_named_in_one_line(made, fault):
    with pytest.raises(RecordingError) as error:
        made(**FAULTS[fault])
    assert "drive.npz" in str(error.value)
    assert fault in str(error.value)
    assert "\n" not in str(error.value)


def write_csv(
    folder: Path, header: str = "", names: str = "", rows: np.ndarray | None = None
) -> Path:
    """Write the circle and its ground, by default as in the documentation."""
    np.savetxt(folder / "meadow.csv", ground().heights, delimiter=",")
    lines = [
        header
        or "# rate: 10 Hz\n# heights: meadow.csv\n# spacing: 0.1 m\n"
        "# centre: 0 2 m\n# origin: a meadow",
        names
        or ",".join(
            f"{name} [{unit}]" if unit != "1" else name
            for name, unit in zip(NAMES, PLAIN, strict=True)
        ),
        *(
            ",".join(f"{number:.9g}" for number in row)
            for row in (circle() if rows is None else rows)
        ),
    ]
    path = folder / "drive.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


def test_a_csv_file_is_read_with_its_ground(tmp_path, made):
    (tmp_path / "csv").mkdir()
    (found,) = read_drives(write_csv(tmp_path / "csv"), ROVER)
    assert np.allclose(found.states, made().states, atol=1e-8)
    assert np.allclose(found.actions, made().actions, atol=1e-8)
    # the file of the ground is not read as a drive
    (again,) = read_drives(tmp_path / "csv", ROVER)
    assert again.name == found.name
    assert np.array_equal(again.ground.heights, ground().heights)


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        (
            {"header": "# rate: 10 Hz\n# spacing: 0.1 m"},
            "the header has no line '# heights: ...'",
        ),
        (
            {"header": "# rate: 10\n# heights: x.npy\n# spacing: 1"},
            "x.npy: there is no such file of heights",
        ),
        (
            {"header": "# rate: 10\n# heights: meadow.csv\n# spacing: 1\n# centre: 3"},
            "'centre: 3' is not an x and a y",
        ),
        (
            {"header": "# rate: 10 Hz\n# rate: 20 Hz"},
            "the header has two lines '# rate: ...'",
        ),
    ],
)
def test_a_fault_of_a_csv_file_is_named_in_one_line(tmp_path, changes, fault):
    path = write_csv(tmp_path, **changes)
    with pytest.raises(RecordingError) as error:
        read_drives(path, ROVER)
    assert fault in str(error.value)
    assert str(tmp_path) in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(("sign", "words"), [(";", "semicolons"), ("\t", "tabs")])
def test_another_separator_is_named(tmp_path, sign, words):
    path = write_csv(tmp_path)
    lines = path.read_text().splitlines()
    path.write_text(
        "\n".join([*lines[:6], *(line.replace(",", sign) for line in lines[6:])]) + "\n"
    )
    with pytest.raises(
        RecordingError,
        match=f"line 7.* it seems to be separated by {words}: use commas, and points",
    ):
        read_drives(path, ROVER)


def test_drives_are_packed_and_come_back(tmp_path, made):
    """Numbers keep float32's seven digits, heights half a millimetre.

    A shared ground is stored once.
    """
    rough = made(
        where=ground()._replace(
            heights=np.random.default_rng(0).uniform(0, 0.1, (81, 81))
        )
    )
    write_drives(tmp_path / "a.npz", [made(), rough, made()], "two circles")
    back = read_drives(tmp_path / "a.npz", ROVER)
    for drive, original in zip(back, (made(), rough, made()), strict=True):
        assert np.allclose(drive.states, original.states, atol=1e-6)
        assert np.allclose(drive.actions, original.actions, atol=1e-6)
        assert np.abs(drive.ground.heights - original.ground.heights).max() <= 0.0005001
    with np.load(tmp_path / "a.npz") as file:
        assert len(file["heights"]) == 2
        assert json.loads(str(file["header"]))["origin"] == "two circles"


def members(**changes) -> dict:
    """Arrays of a file of one circle."""
    header = dict(
        columns=NAMES,
        units=PLAIN,
        rate=10,
        spacing=0.1,
        height_unit="m",
        origin="here",
        centres=[[0, 2]],
    )
    header |= changes.pop("header", {})
    header = {name: value for name, value in header.items() if value is not None}
    plain = dict(
        rows=circle(),
        lengths=np.array([71]),
        ground=np.array([0]),
        heights=np.zeros((1, 81, 81)),
    )
    return plain | {"header": np.array(json.dumps(header))} | changes


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        ({"lengths": np.array([70])}, "do not belong together"),
        (
            {"lengths": np.array([71.0])},
            "'lengths' of shape (1,) and float64, not a row of whole numbers",
        ),
        ({"ground": np.array([1])}, "1 heights, but 'ground' of 1 drives goes up to 1"),
        ({"header": {"rate": None}}, "the header has no 'rate'"),
        ({"header": {"rate": "fast"}}, "'rate' of the header is 'fast'"),
        ({"header": {"rate": 10**400}}, "'rate' of the header is 1000"),
        (
            {"header": {"centres": [[10**400, 0]]}},
            "centres of the header are not an x and a y",
        ),
        (
            {"header": {"ratte": 10}},
            "unknown name 'ratte' in the header; did you mean 'rate'?",
        ),
        (
            {"header": {"height_unit": "feet"}},
            "height_unit 'feet'; heights are in m or cm or mm",
        ),
        ({"header": np.array("{")}, "the header is not JSON"),
        ({"rows": circle().astype(str)}, "not of numbers"),
        ({"heights": np.full((1, 81, 81), "high")}, "of <U4, not of numbers"),
        (
            {"header": {"centres": [["a", "b"]]}},
            "centres of the header are not an x and a y",
        ),
        (
            {"header": {"columns": list(range(15))}},
            "columns and units of the header are not all text",
        ),
    ],
)
def test_a_fault_of_an_npz_file_is_named_in_one_line(tmp_path, changes, fault):
    changes = dict(changes)
    given = (
        changes.pop("header") if isinstance(changes.get("header"), np.ndarray) else None
    )
    np.savez(
        tmp_path / "a.npz",
        **(members(**changes) | ({} if given is None else {"header": given})),
    )
    with pytest.raises(RecordingError) as error:
        read_drives(tmp_path / "a.npz", ROVER)
    assert fault in str(error.value) and "\n" not in str(error.value)


def test_a_whole_npz_file_is_read_and_a_member_missed(tmp_path, made):
    np.savez(tmp_path / "a.npz", **members())
    (found,) = read_drives(tmp_path / "a.npz", ROVER)
    assert np.allclose(found.states, made().states)
    np.savez(
        tmp_path / "a.npz",
        **{name: value for name, value in members().items() if name != "heights"},
    )
    with pytest.raises(RecordingError, match="member 'heights' is missing"):
        read_drives(tmp_path / "a.npz", ROVER)


def test_an_npy_file_by_another_name_is_named(tmp_path):
    with open(tmp_path / "a.npz", "wb") as file:
        np.save(file, circle())
    with pytest.raises(
        RecordingError,
        match="cannot be read as .npz .it holds one array, as .npy files do",
    ):
        read_drives(tmp_path / "a.npz", ROVER)


@pytest.mark.parametrize(
    ("name", "content", "fault"),
    [
        ("a.npz", b"no archive", "cannot be read as .npz"),
        ("a.npz", None, "there is no such file"),
        ("a.txt", b"", "drives are .csv, .csv.gz, .npz or ROS bags"),
        ("a.csv", b"\xff\xfe\x00", "cannot be read as text"),
        (
            "a.csv",
            b"# rate: 10\n# heights: x\n# spacing: 1\n",
            "it has no rows of numbers",
        ),
    ],
)
def test_a_file_that_is_none_is_named(tmp_path, name, content, fault):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(RecordingError, match=fault):
        read_drives(tmp_path / name, ROVER)


def test_a_file_with_a_mark_of_byte_order_is_read(tmp_path):
    """Some spreadsheets write such a mark."""
    path = write_csv(tmp_path)
    path.write_text("\ufeff" + path.read_text(), encoding="utf-8")
    assert len(read_drives(tmp_path, ROVER)) == 1


def test_a_file_that_is_no_recording_is_not_passed_over(tmp_path):
    write_csv(tmp_path)
    (tmp_path / "notes.csv").write_text("monday,rain\n")
    with pytest.raises(RecordingError, match="notes.csv: it has no rows of numbers"):
        read_drives(tmp_path, ROVER)


def test_high_mountains_are_packed(tmp_path, made):
    """A height of forty metres does not overflow."""
    high = Ground(np.full((81, 81), 40.0), 0.1, (0.0, 2.0))
    rows = circle()
    rows[:, 2] += 40.0
    write_drives(tmp_path / "a.npz", [made(rows, where=high)], "up")
    assert read_drives(tmp_path / "a.npz", ROVER)[
        0
    ].ground.heights.max() == pytest.approx(40)


def test_a_folder_without_recordings_is_named(tmp_path):
    with pytest.raises(RecordingError, match="no file of drives"):
        read_drives(tmp_path, ROVER)


@pytest.mark.parametrize(("system", "count"), [("system1", 99), ("system2", 94)])
def test_the_recordings_kept_here_are_whole(system, count):
    """Recordings are of 25 terrains, in 64 steps each, within the repository's size."""
    path = ROOT / "recordings" / f"{system}.npz"
    drives = read_drives(path, ROVER)
    assert len(drives) == count
    assert {len(drive.actions) for drive in drives} == {64}
    assert path.stat().st_size < 5e6
    assert len({one.ground.heights.tobytes() for one in drives}) == 25
