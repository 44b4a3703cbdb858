"""Make warthog.csv.gz, husky.csv.gz and hunter.csv.gz from tables of their sources.

Usage: python recordings/prepare.py FOLDER

FOLDER has the three tables that README.md describes. The files are written into the
folder of this script.
"""

import gzip
import sys
from pathlib import Path

import numpy as np
import pandas as pd

HERE = Path(__file__).parent
SIDES = ("left", "right")
#: ticks of the Hunter's encoder a metre: the median of ticks over the distance driven
TICKS = 2393.0
SHORT = 20  # drives with fewer rows are left out
RESET = 1.0  # m; a longer step means that the simulator moved the robot

DRIVE = (
    "norlab-ulaval/DRIVE, calib_data/test_{}, commit e158a19, "
    "BSD-3-Clause (LICENSE-DRIVE.txt)"
)
AUTODRIVE = (
    "Tinker-Twins/AutoDRIVE-Hunter-SE-Dataset, off-road, commit 3401cce, "
    "BSD-2-Clause (LICENSE-AutoDRIVE.txt)"
)


def write(name: str, table: pd.DataFrame, header: list[str]) -> None:
    """Write a table with six significant digits, the same bytes each time."""
    comments = "".join(f"# {line}\n" for line in header)
    rows = table.to_csv(index=False, float_format="%.6g", lineterminator="\n")
    content = (comments + rows).encode()
    (HERE / name).write_bytes(gzip.compress(content, mtime=0))


def skid_steered(folder: Path, robot: str) -> None:
    """Write the drives of a skid-steered robot.

    A drive is a window of 2 s, and its session is its calibration step. Yaw is written
    without jumps by 2 pi.
    """
    table = pd.read_csv(folder / f"{robot}.csv.gz")
    yaw = table.groupby(["calibration_step", "window"]).yaw
    drives = pd.DataFrame({"session": table.calibration_step, "drive": table.window})
    drives["x [m]"], drives["y [m]"] = table.x, table.y
    drives["yaw [rad]"] = yaw.transform(lambda angle: np.unwrap(angle))
    sides = [f"{kind}_{side}" for kind in ("wheel", "command") for side in SIDES]
    for column in ("yaw_rate", *sides):
        drives[f"{column} [rad/s]"] = table[column]
    write(f"{robot}.csv.gz", drives, [f"origin: {DRIVE.format(robot)}", "rate: 20 Hz"])


def hunter(folder: Path) -> None:
    """Write the drives of the Hunter.

    A session is a run; it is cut into drives where the simulator reset the robot. The
    speeds of the wheels are computed from the ticks of their encoders.
    """
    drives = []
    for run, table in pd.read_csv(folder / "hunter.csv.gz").groupby("run", sort=False):
        far = np.hypot(*np.diff(table[["x", "y"]].to_numpy(), axis=0).T) > RESET
        numbers = np.r_[0, np.cumsum(far)]
        for number in range(numbers[-1] + 1):
            rows = table[numbers == number]
            if len(rows) < SHORT:
                continue
            columns = {
                "session": run,
                "drive": number,
                "time [s]": rows.time,
                "x [m]": rows.x,
                "y [m]": rows.y,
                "yaw [rad]": np.unwrap(rows.yaw),
                "yaw_rate [rad/s]": rows.angular_z,
            }
            for side in SIDES:
                speed = np.gradient(rows[f"{side}_ticks"], rows.time) / TICKS
                columns[f"wheel_{side} [m/s]"] = speed
            columns["throttle [1]"] = rows.throttle
            columns["steering [rad]"] = rows.steering
            drives.append(pd.DataFrame(columns))
    write("hunter.csv.gz", pd.concat(drives), [f"origin: {AUTODRIVE}"])


if __name__ == "__main__":
    source = Path(sys.argv[1])
    for name in ("husky", "warthog"):
        skid_steered(source, name)
    hunter(source)
