"""Predictions as ghosts: the drive of a robot beside the paths that models predict.

`python -m companion.explorer.predictions` makes the scenes of the book's page from the
stored results and recordings.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

import ownrobot
from ownrobot.replay.rides import Ride, drive, sampled_physics
from ownrobot.replay.scene import (
    GHOST_OPACITY,
    SPACING,
    TRUTH_COLOUR,
    Scene,
    drive_scene,
    drive_track,
    ride_track,
)
from ownrobot.replay.skeleton import BOXES
from ownrobot.replay.viewer import write_scene
from sidm.drives import Drive, Ground
from sidm.shards import Collection
from sidm.systems import PAPER_SYSTEMS
from sidm.terrain import generate_terrain

FOLDER = Path("results/explorer")
METHODS = ("novice_only", "sidm")
SEED, MINUTES = 0, 5.0  # seed and novice data of the trials whose models predict
WARTHOG_DRIVE = 23  # index of the drive; it turns more than most


def collected_ride(collection: Collection, index: int, steps: int) -> Ride:
    """Simulate the start of a collected trajectory again, with struts and joints."""
    from sidm.simulation import Simulator, simulate_trajectory
    from sidm.simulation.collecting import draw_attempt
    from sidm.systems import find_system

    system = find_system(collection.system)
    attempt = sum(simulate_trajectory(collection, index).discarded)
    terrain_seed, yaw, actions = draw_attempt(collection, index, attempt)
    throttle, steering = actions[:steps].T
    heights = generate_terrain(system.terrain, terrain_seed)
    robot = system.robot(collection.role)
    physics = sampled_physics(system.physics.strut_motors)
    with Simulator(robot, heights, physics) as simulator:
        return drive(simulator, throttle, steering, steps, yaw)


def rollout_scene(rows: Sequence[Any], number: int) -> Scene:
    """A stored drive of Figure 4: the robot, and the paths that models predict.

    Of a system's rows, those with SEED, MINUTES and METHODS are shown. ValueError says
    that there is none, or that the robot's path differs from that of these trials.
    """
    from companion.figures.style import METHOD_STYLES

    stored = {
        row.trial.method: row
        for row in rows
        if (row.trial.seed, row.trial.novice_minutes) == (SEED, MINUTES)
    }
    shown = {name: stored[name] for name in METHODS if name in stored}
    if not shown:
        raise ValueError(f"no trial of seed {SEED} with {MINUTES:g} min is stored")
    first = next(iter(shown.values()))
    actual = np.array(first.outcome.rollouts_actual[number])
    collection = first.trial.datasets["rollout"].collection
    ride = collected_ride(collection, number, len(actual) - 1)
    if not np.allclose(ride.states[::2, :2], actual[:, :2], atol=0.05):
        raise ValueError(
            "the robot drives elsewhere than when these trials were run; run them again"
        )
    truth = ride_track(ride, "the robot", TRUTH_COLOUR)
    ground, ghosts = Ground(ride.heights, SPACING), []
    for method, row in shown.items():
        states = np.array(row.outcome.rollouts_predicted[number])
        style = METHOD_STYLES[method]
        predicted = Drive(states, np.zeros((len(states) - 1, 2)))
        look = style["label"], style["color"]
        ghost = drive_track(predicted, ground, ride.robot, *look)
        ghosts.append(ghost._replace(ghost=GHOST_OPACITY))
    title = f"the robot, and models trained on {MINUTES:g} min"
    return Scene((truth, *ghosts), ground, 2.0, title)


def warthog_scene() -> Scene:
    """A drive of the real Warthog, and the path that a model predicts for it."""
    recordings = Path("recordings")
    drives = ownrobot.read_drives(
        recordings / "warthog.csv.gz", recordings / "skid_steer.yaml"
    )
    drive = drives[WARTHOG_DRIVE]
    model = ownrobot.load(recordings / "models" / "warthog")
    path = model.rollout(drive.states[0], drive.actions)
    return drive_scene(drive, BOXES["warthog"], path, ("the Warthog", "its model"))


def make(folder: Path = FOLDER) -> None:
    """Write the scenes of the book's page: median drives, and the Warthog."""
    from companion import Results, Study
    from companion.studies.decisive import figure4, verdicts
    from companion.studies.decisive.arms import R_CAPS, arm

    study, store = Study("study"), Results("results")
    shown = figure4.table(verdicts.results(study, store))
    for system in PAPER_SYSTEMS:
        number = figure4.median_drive(shown[shown.system == system])
        rows = store.stored(arm(study, "R", system, R_CAPS, [SEED]))
        write_scene(folder / f"scene-{system}.json", rollout_scene(rows, number))
    write_scene(folder / "scene-warthog.json", warthog_scene())


if __name__ == "__main__":
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    make()
