"""Recordings of the paper's robots with their ground, and each fault by its line."""

import json
from pathlib import Path

import numpy as np
import pytest

from ownrobot.recordings import RecordingError, read_drives, write_drives
from sidm.body import DRIVE, ROVER, SI, TWIST, Body
from sidm.drives import Drive, Ground
from sidm.terrain import height_at

COLUMNS = dict((*ROVER.state, *ROVER.actions))
NAMES, PLAIN = list(COLUMNS), [SI[unit] for unit in COLUMNS.values()]
TIMED = {"columns": [*NAMES, "time"], "units": [*PLAIN, "s"]}


def circle(rate: float = 10.0, seconds: float = 7.0) -> np.ndarray:
    """Rows (R, 15) of a robot that turns left at 1 m/s, 0.17 m above flat ground."""
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


def changed(column: str, value: float, rows: slice | int = slice(None)) -> dict:
    numbers = circle()
    numbers[rows, NAMES.index(column)] = value
    return {"rows": numbers}


def ground(**changes) -> Ground:
    return Ground(np.zeros((81, 81)), 0.1, (0.0, 2.0))._replace(**changes)


def hill() -> Ground:
    """A slope that rises with x, and more with y, and is not straight."""
    x = np.linspace(-4, 4, 81)
    return ground(heights=0.05 * x[None] + 0.1 * x[:, None] + 0.02 * x[None] ** 2)


def uphill() -> np.ndarray:
    rows = circle()
    rows[:, 2] += height_at(hill().heights, rows[:, 0], rows[:, 1] - 2.0)
    rows[1:, 9] = np.diff(rows[:, 2]) * 10
    return rows


def members(rows=None, where=None, header=None, **changes) -> dict:
    """Arrays of a file of one drive; a value None of the header is left out."""
    rows, where = circle() if rows is None else rows, where or ground()
    about = dict(
        columns=NAMES,
        units=PLAIN,
        rate=10,
        spacing=where.spacing,
        height_unit="m",
        origin="here",
        centres=[list(where.centre)],
    ) | (header or {})
    about = {name: value for name, value in about.items() if value is not None}
    arrays = dict(
        rows=rows,
        lengths=np.array([len(rows)]),
        ground=np.array([0]),
        heights=where.heights[None],
        header=np.array(json.dumps(about)),
    )
    return arrays | changes


@pytest.fixture
def made(tmp_path):

    def make(**changes) -> Drive:
        np.savez(tmp_path / "drive.npz", **members(**changes))
        (found,) = read_drives(tmp_path / "drive.npz", ROVER)
        return found

    return make


def test_positions_are_relative_to_the_middle_of_the_ground(made):
    drive = made()
    assert drive.states.shape == (71, 13) and drive.actions.shape == (70, 2)
    assert drive.states[0, :3] == pytest.approx((0, -2, 0.17))
    assert drive.ground.centre == (0, 0)
    assert np.linalg.norm(drive.states[:, :2], axis=1) == pytest.approx(2)


def test_a_faster_rate_is_brought_to_10_hz(made):
    """Attitudes q and -q are the same; nothing is interpolated between them."""
    rows = circle(50.0)
    rows[40:, 3:7] *= -1
    fast = made(rows=rows, header={"rate": 50})
    assert np.allclose(fast.states, made().states)
    means = rows[:350, 14].reshape(70, 5).mean(1)
    assert fast.actions[:, 1] == pytest.approx(means)


def test_a_hilly_drive_with_noise_is_taken(made, rng):
    """Noise of three centimetres and ten milliseconds on every row is no fault."""
    rows = uphill()
    rows[:, :3] += rng.normal(0, 0.03, (len(rows), 3))
    time = 0.1 * np.arange(len(rows)) + rng.normal(0, 0.01, len(rows))
    rows = np.hstack([rows, time[:, None]])
    assert len(made(rows=rows, header=TIMED, where=hill())) >= 69


def turned() -> np.ndarray:
    rows, yaw = circle(seconds=30.0), 0.05 * np.arange(301)
    rows[:, 7:9] = np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
    return rows


def endless() -> np.ndarray:
    heights = np.zeros((81, 81))
    heights[2, 4] = np.inf
    return heights


#: What the one line of a fault says -> the members that have it.
FAULTS = {
    "two columns 'x'": {
        "header": {"columns": [*NAMES, "x"], "units": [*PLAIN, "m"]},
        "rows": np.hstack([circle(), circle()[:, :1]]),
    },
    "15 columns, 14 units": {"header": {"units": PLAIN[1:]}},
    "a rate of nan Hz": {"header": {"rate": float("nan")}},
    "'vx' in row 4 is not finite": changed("vx", np.nan, 3),
    "'vx' in row 5 is -1e+30, beyond 1e15; leave the row": changed("vx", -1e30, 4),
    "the quaternion in row 1 has length 0.5, not 1": changed("qw", 0.5, 0),
    "steering in step 8 is 35, not in [-1, 1]; scale": changed("steering", 35.0, 7),
    "drive 0: 0 rows are no drive": {"rows": np.zeros((0, 16)), "header": TIMED},
    "a spacing of 0": {"where": ground(spacing=0.0)},
    "not a grid of heights": {"where": ground(heights=np.zeros((1, 5)))},
    "the height in row 3, column 5 is not finite": {"where": ground(heights=endless())},
    "its ground, which ends at 4.00 m, 4.00 m": {"where": ground(centre=(9.0, 2.0))},
    "the robot is -9.83 m above": {"where": ground(heights=np.full((81, 81), 10.0))},
    "velocities do not lead where the robot was": {"rows": turned()},
    "by its attitudes, by 29 by 'wz'; is it in the unit": changed(
        "wz", np.degrees(0.5)
    ),
    "3 s after its start the position jumps": changed("x", 3.0, slice(31, None)),
    "'lengths' of shape (1,) and float64": {"lengths": np.array([71.0])},
    "1 heights, but 'ground' of 1 drives goes up to 1": {"ground": np.array([1])},
    "(Header.rate is missing); write JSON": {"header": {"rate": None}},
    "a rate of inf Hz; it must be positive": {"header": {"rate": 10**400}},
    "'Header.centres' must be float, not str": {"header": {"centres": [["a", 0]]}},
    "unknown name 'ratte' in Header; did you mean 'rate'": {"header": {"ratte": 10}},
    "height_unit 'feet', not one of m, cm, mm": {"header": {"height_unit": "feet"}},
    "height_unit '', not one of m, cm, mm": {"header": {"height_unit": ""}},
    "rows of <U32, not of numbers": {"rows": circle().astype(str)},
    "of <U4, not of numbers": {"heights": np.full((1, 81, 81), "high")},
    "'Header.columns' must be str, not": {"header": {"columns": list(range(15))}},
}
for words, turn in (
    ("upside down", np.flipud),
    ("the wrong way round", np.fliplr),
    ("transposed", np.transpose),
):
    other = {"rows": uphill(), "where": ground(heights=turn(hill().heights))}
    FAULTS[f"the map of the ground seems to be {words}"] = other


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_named_in_one_line(tmp_path, fault):
    np.savez(tmp_path / "drive.npz", **members(**FAULTS[fault]))
    with pytest.raises(RecordingError) as error:
        read_drives(tmp_path / "drive.npz", ROVER)
    assert "drive.npz" in str(error.value) and fault in str(error.value)
    assert "\n" not in str(error.value)


def test_a_member_that_is_missing_and_an_npy_file_are_named(tmp_path):
    arrays, path = members(), tmp_path / "a.npz"
    without = {name: arrays[name] for name in arrays if name != "heights"}
    for write, words in (
        (lambda file: np.savez(file, **without), "member 'heights' is missing"),
        (
            lambda file: np.savez(file, **arrays | {"header": np.array("{")}),
            "the header cannot be read .Expecting property name",
        ),
        (lambda file: np.save(file, circle()), "it holds one array, as .npy files do"),
    ):
        with path.open("wb") as file:
            write(file)
        with pytest.raises(RecordingError, match=words):
            read_drives(path, ROVER)


class Opened:
    def __reduce__(self):
        return Path.touch, (Path("opened"),)


def test_no_pickle_is_opened(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    np.savez("a.npz", **members(sessions=np.array([Opened()], object)))
    with pytest.raises(RecordingError, match="cannot be read as .npz"):
        read_drives("a.npz", ROVER)
    assert not Path("opened").exists()


def write_csv(folder: Path, header: str) -> Path:
    np.savetxt(folder / "meadow.csv", ground().heights, delimiter=",")
    pairs = zip(NAMES, PLAIN, strict=True)
    titles = [name if unit == "1" else f"{name} [{unit}]" for name, unit in pairs]
    lines = [",".join(f"{number:.9g}" for number in row) for row in circle()]
    path = folder / "drive.csv"
    path.write_text("\n".join([header, ",".join(titles), *lines]) + "\n")
    return path


def test_a_csv_file_is_read_with_its_ground(tmp_path, made):
    folder = tmp_path / "csv"
    folder.mkdir()
    path = write_csv(
        folder,
        "# rate: 10 Hz\n# heights: meadow.csv\n# spacing: 0.1 m\n"
        "# centre: 0 2 m\n# origin: a meadow",
    )
    for source in (path, folder):
        (found,) = read_drives(source, ROVER)
        assert np.allclose(found.states, made().states, atol=1e-8)
        assert np.allclose(found.actions, made().actions, atol=1e-8)
        assert np.array_equal(found.ground.heights, ground().heights)
    (folder / "notes.csv").write_text("monday,rain\n")
    with pytest.raises(RecordingError, match="notes.csv: it has no rows of numbers"):
        read_drives(folder, ROVER)
    for header, fault in (
        ("# spacing: 0.1 m", "the header has no line '# heights: ...'"),
        ("# heights: x.npy\n# spacing: 1", "x.npy: there is no such file of heights"),
        ("# heights: meadow.csv\n# spacing: 1\n# centre: 3", "is not an x and a y"),
    ):
        with pytest.raises(RecordingError, match=fault):
            read_drives(write_csv(folder, f"# rate: 10 Hz\n{header}"), ROVER)


def test_drives_are_packed_and_come_back(tmp_path, made, rng):
    """A shared ground is stored once, in whole millimetres; none overflows."""
    rough = made(where=ground(heights=rng.uniform(0, 0.1, (81, 81))))
    rows = circle()
    rows[:, 2] += 40.0
    high = made(rows=rows, where=ground(heights=np.full((81, 81), 40.0)))
    drives = [made(), rough, made(), high]
    write_drives(tmp_path / "a.npz", drives, "circles")
    back = read_drives(tmp_path / "a.npz", ROVER)
    for drive, original in zip(back, drives, strict=True):
        assert np.allclose(drive.states, original.states, atol=3e-6)
        assert np.allclose(drive.actions, original.actions, atol=1e-6)
        assert np.abs(drive.ground.heights - original.ground.heights).max() <= 0.0005001
    with np.load(tmp_path / "a.npz") as file:
        assert len(file["heights"]) == 3
        assert json.loads(str(file["header"]))["origin"] == "circles"
    with pytest.raises(ValueError, match="there are no drives to write"):
        write_drives(tmp_path / "none.csv", [], "nobody")


def test_slow_drives_with_velocities_are_read(tmp_path):
    slow = Body(name="slow", pose="spatial", columns=TWIST, actions=DRIVE, rate=1.0)
    rows = np.zeros((20, len(NAMES)))
    rows[:, 0], rows[:, 6], rows[:, 7], rows[:, 13] = np.arange(20), 1, 1, 0.5
    np.savez(tmp_path / "slow.npz", **members(rows=rows, header={"rate": 1}))
    assert len(read_drives(tmp_path / "slow.npz", slow)) == 1
