"""Makes warthog.csv.gz, husky.csv.gz and hunter.csv.gz from tables of their sources: `prepare.py FOLDER`.

FOLDER has the three tables as README.md describes them; what is written stands beside this file.
"""

import gzip
import sys
from pathlib import Path

import numpy as np
import pandas as pd

HERE = Path(__file__).parent
TICKS = (
    2393.0  # of a Hunter's encoder, a metre: the median of ticks over distance driven
)
SHORT = 20  # rows of a drive, fewer are left out
RESET = 1.0  # m in one step: the simulator put the robot elsewhere

DRIVE = "norlab-ulaval/DRIVE, calib_data/test_{}, commit e158a19, BSD-3-Clause (LICENSE-DRIVE.txt)"
AUTODRIVE = "Tinker-Twins/AutoDRIVE-Hunter-SE-Dataset, off-road, commit 3401cce, BSD-2-Clause (LICENSE-AutoDRIVE.txt)"


def write(name: str, table: pd.DataFrame, header: list[str]) -> None:
    """Six significant digits; the same bytes each time."""
    lines = table.to_csv(index=False, float_format="%.6g", lineterminator="\n")
    (HERE / name).write_bytes(
        gzip.compress(
            ("".join(f"# {line}\n" for line in header) + lines).encode(), mtime=0
        )
    )


def skid_steered(folder: Path, robot: str) -> None:
    """A window of 2 s is a drive, what one calibration step holds a session; yaw without its jumps by 2 pi."""
    table = pd.read_csv(folder / f"{robot}.csv.gz")
    yaw = table.groupby(["calibration_step", "window"]).yaw.transform(
        lambda angle: np.unwrap(angle)
    )
    found = pd.DataFrame({"session": table.calibration_step, "drive": table.window})
    for column, unit in {"x": "m", "y": "m", "yaw": "rad"}.items():
        found[f"{column} [{unit}]"] = yaw if column == "yaw" else table[column]
    for column in (
        "yaw_rate",
        "wheel_left",
        "wheel_right",
        "command_left",
        "command_right",
    ):
        found[f"{column} [rad/s]"] = table[column]
    write(f"{robot}.csv.gz", found, [f"origin: {DRIVE.format(robot)}", "rate: 20 Hz"])


def hunter(folder: Path) -> None:
    """A run is a session, cut where the simulator reset the robot; wheel speeds are those of the ticks."""
    parts = []
    for run, table in pd.read_csv(folder / "hunter.csv.gz").groupby("run", sort=False):
        far = np.hypot(*np.diff(table[["x", "y"]].to_numpy(), axis=0).T) > RESET
        drive = np.r_[0, np.cumsum(far)]
        for number in range(drive[-1] + 1):
            mine = table[drive == number]
            if len(mine) < SHORT:
                continue
            ticks = {
                side: np.gradient(mine[f"{side}_ticks"], mine.time) / TICKS
                for side in ("left", "right")
            }
            found = pd.DataFrame(
                {"session": run, "drive": number, "time [s]": mine.time}
            )
            found["x [m]"], found["y [m]"], found["yaw [rad]"] = (
                mine.x,
                mine.y,
                np.unwrap(mine.yaw),
            )
            found["yaw_rate [rad/s]"] = mine.angular_z
            found["wheel_left [m/s]"], found["wheel_right [m/s]"] = (
                ticks["left"],
                ticks["right"],
            )
            found["throttle [1]"], found["steering [rad]"] = (
                mine.throttle,
                mine.steering,
            )
            parts.append(found)
    write("hunter.csv.gz", pd.concat(parts), [f"origin: {AUTODRIVE}"])


if __name__ == "__main__":
    source = Path(sys.argv[1])
    for name in ("husky", "warthog"):
        skid_steered(source, name)
    hunter(source)
