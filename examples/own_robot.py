"""Fit a model of your own robot to recorded drives, and save it.

python examples/own_robot.py recordings/warthog.csv.gz --body recordings/skid_steer.yaml

It compares several methods by cross-validation, and fits the one to take.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import ownrobot


def parse_arguments() -> argparse.Namespace:
    """The options on the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    text = "a file, a ROS bag or a folder of drives"
    parser.add_argument("drives", type=Path, help=text)
    text = "what the drives are made of, YAML"
    parser.add_argument("--body", type=Path, required=True, help=text)
    text = "drives of a similar robot, whose motion is cheaper"
    parser.add_argument("--expert", type=Path, help=text)
    text = "largest number of samples in a training (%(default)s)"
    parser.add_argument("--samples", type=int, default=300_000, help=text)
    text = "folder of the model (%(default)s)"
    parser.add_argument("--out", type=Path, default=Path("own-robot"), help=text)
    return parser.parse_args()


def main() -> None:
    """Read the drives, compare the methods, fit a model, predict a drive."""
    options = parse_arguments()
    drives = ownrobot.read_drives(options.drives, options.body)
    expert = (
        ownrobot.read_drives(options.expert, options.body) if options.expert else None
    )
    settings = {"max_samples": options.samples}
    comparison = ownrobot.compare(
        drives,
        expert,
        ["mean", "least_squares", "novice_only", *(["sidm"] if expert else [])],
        repeats=1,
        shares=[1.0],
        settings=settings,
        progress=True,
    )
    print(comparison)

    method, out = comparison.verdict.method, options.out
    model = ownrobot.fit(
        drives, expert, method, settings=settings, out=out, progress=True
    )
    drive = drives[-1]
    path = model.rollout(drive.states[0], drive.actions)
    print(f"{model} in {out}; it predicts {len(path) - 1} steps of {drive.name}")


if __name__ == "__main__":
    main()
