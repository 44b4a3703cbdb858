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
    ROVER_JOINTS,
    ROVER_WHEELS,
    SPACING,
    TRUTH_COLOUR,
    Scene,
    Track,
    attitudes_on_ground,
    height_on,
    predicted_scene,
    ride_track,
    rolling_angles,
)
from ownrobot.replay.scene_file import write_scene
from ownrobot.replay.skeleton import BOXES, Skeleton
from sidm.drives import CONTROL_STEP, POSITION, QUATERNION, Ground
from sidm.shards import Collection
from sidm.terrain import generate_terrain

FOLDER = Path("results/explorer")
METHODS = ("novice_only", "sidm", "pretrain_finetune")
SEED = 0  # seed of the trials whose models predict
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


def predicted_track(
    states: np.ndarray,
    ground: Ground,
    skeleton: Skeleton,
    name: str,
    colour: str,
    height: float = 0.0,
) -> Track:
    """The track of a ghost that moves through predicted states (K + 1, 13).

    Where they are x and y alone, (K + 1, 2), the ghost lies on the ground, its body
    `height` m above it, and faces along its path.
    """
    base, track, radius = ROVER_WHEELS
    if states.shape[1] == 2:
        position = np.column_stack([states, height_on(ground, states) + height])
        turn = attitudes_on_ground(states, ground, base, track).as_quat()
    else:
        position, turn = states[:, POSITION], states[:, QUATERNION]
    joints = np.zeros((len(states), ROVER_JOINTS))
    joints[:, 4:8] = rolling_angles(position, turn, radius, track / 2)
    motion = (CONTROL_STEP, position, turn, joints)
    return Track(name, *motion, skeleton, colour, GHOST_OPACITY)


def rollout_scene(rows: Sequence[Any], minutes: float) -> Scene:
    """The first rollout of Figure 4: the robot, and the paths that models predict.

    Of the rows of a system, the trials with SEED, METHODS and so many minutes are
    shown. ValueError says that none is stored, or that the robot's path differs from
    its path at the time of these trials.
    """
    from companion.figures.style import METHOD_STYLES

    stored = {
        row.trial.method: row
        for row in rows
        if (row.trial.seed, row.trial.novice_minutes) == (SEED, minutes)
    }
    shown = {name: stored[name] for name in METHODS if name in stored}
    if not shown:
        raise ValueError(f"no trial of seed {SEED} with {minutes:g} min is stored")
    first = next(iter(shown.values()))
    steps = len(first.outcome.example_actual) - 1
    ride = collected_ride(first.trial.datasets["rollout"].collection, 0, steps)
    if not np.allclose(ride.states[::2, :2], first.outcome.example_actual, atol=0.05):
        raise ValueError(
            "the robot drives elsewhere than when these trials were run; run them again"
        )
    ground = Ground(ride.heights, SPACING)
    height = float(np.mean(ride.states[:, 2] - height_on(ground, ride.states[:, :2])))
    truth = ride_track(ride, "the robot", TRUTH_COLOUR)
    ghosts = []
    for method, row in shown.items():
        rollouts, style = row.outcome.rollouts_predicted, METHOD_STYLES[method]
        states = np.array(rollouts[0] if rollouts else row.outcome.example_predicted)
        look = (truth.skeleton, style["label"], style["color"])
        ghosts.append(predicted_track(states, ground, *look, height))
    title = f"the robot, and models trained on {minutes:g} min"
    return Scene((truth, *ghosts), ground, 2.0, title)


def warthog_scene(recordings: Path = Path("recordings")) -> Scene:
    """A drive of the real Warthog, and the path that a model predicts for it."""
    drives = ownrobot.read_drives(
        recordings / "warthog.csv.gz", recordings / "skid_steer.yaml"
    )
    drive = drives[WARTHOG_DRIVE]
    model = ownrobot.load(recordings / "models" / "warthog")
    path = model.rollout(drive.states[0], drive.actions)
    return predicted_scene(drive, path, BOXES["warthog"], ("the Warthog", "its model"))


def make(folder: Path = FOLDER) -> None:
    """Write the scenes of the book's page."""
    from companion import Results, Study

    rows = Results("results").rows(Study("laptop").figure4("system1"))
    for minutes in (5.0, 120.0):
        path = folder / f"scene-{minutes:g}-minutes.npz"
        write_scene(path, rollout_scene(rows, minutes))
    write_scene(folder / "scene-warthog.npz", warthog_scene())


if __name__ == "__main__":
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    make()
