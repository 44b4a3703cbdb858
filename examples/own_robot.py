"""A robot of your own from recorded drives: fit a model, evaluate it on drives held out, keep it.

python examples/own_robot.py recordings/warthog.csv.gz --body recordings/skid_steer.yaml
"""

from __future__ import annotations

import argparse
from pathlib import Path

import sidm


def main() -> None:
    """Read, compare, fit, evaluate, keep."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "drives", type=Path, help="a file, a ROS bag or a folder of drives"
    )
    parser.add_argument(
        "--body", type=Path, required=True, help="what the drives are made of, YAML"
    )
    parser.add_argument(
        "--expert", type=Path, help="drives of a similar robot, whose motion is cheaper"
    )
    parser.add_argument(
        "--samples",
        type=int,
        default=300_000,
        help="that each training sees at most (%(default)s)",
    )
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("own-robot"),
        help="folder of the model (%(default)s)",
    )
    given = parser.parse_args()

    drives = sidm.read_drives(given.drives, given.body)
    expert = sidm.read_drives(given.expert, given.body) if given.expert else None
    settings = {"max_samples": given.samples}
    table = sidm.compare(drives, expert, settings=settings, progress=True)
    print(table.to_string(index=False, float_format="{:.3g}".format))

    model = sidm.fit(
        drives,
        expert,
        method=table.method[0],
        settings=settings,
        out=given.out,
        progress=True,
    )
    drive = drives[-1]
    path = model.rollout(drive.states[0], drive.actions)
    print(f"{model} in {given.out}; it predicts {len(path) - 1} steps of {drive.name}")


if __name__ == "__main__":
    main()
