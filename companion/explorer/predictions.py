"""Predictions as ghosts: a robot that really drove, and where models say it would be.

`python -m companion.explorer.predictions` makes the scenes of the book's page again
from the stored results and recordings.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

import sidm
from sidm.drives import CONTROL_STEP, POSITION, QUATERNION, Ground
from sidm.replay.rides import Ride, drive, sampled_physics
from sidm.replay.scene import (
    GHOST,
    ROVER_JOINTS,
    ROVER_WHEELS,
    SPACING,
    TRUTH,
    Scene,
    Track,
    height_on,
    laid,
    predicted_scene,
    ride_track,
    rolled,
)
from sidm.replay.scene_file import write_scene
from sidm.replay.skeleton import BOXES, Skeleton
from sidm.shards import Collection
from sidm.terrain import generate_terrain

FOLDER = Path("results/explorer")
METHODS = ("novice_only", "sidm", "pretrain_finetune")
SEED = 0  # whose trials predict
WARTHOG_DRIVE = 23  # it turns more than most


def collected_ride(collection: Collection, index: int, steps: int) -> Ride:
    """Trajectory `index` of a collection as a ride: the same motion, with all that moves."""
    from sidm.simulation import Simulator, simulate_trajectory
    from sidm.simulation.collecting import drawn
    from sidm.systems import find_system

    system, attempts = (
        find_system(collection.system),
        sum(simulate_trajectory(collection, index).discarded),
    )
    terrain_seed, yaw, actions = drawn(collection, index, attempts)
    physics = sampled_physics(system.physics.strut_motors)
    with Simulator(
        system.robot(collection.role),
        generate_terrain(system.terrain, terrain_seed),
        physics,
    ) as simulator:
        throttle, steering = actions[:steps].T
        return drive(simulator, throttle, steering, steps, yaw)


def predicted_track(
    states: np.ndarray,
    ground: Ground,
    skeleton: Skeleton,
    name: str,
    colour: str,
    height: float = 0.0,
) -> Track:
    """A ghost of predicted states, a control step apart.

    Args:
        states: (K + 1, 13); or (K + 1, 2), x and y in m: then it lies on the ground,
            heading along its way.
        ground: under it.
        skeleton: of the robot.
        name: of the model.
        colour: of the ghost.
        height: of the body above the ground where only x and y are known, m.
    """
    base, track, radius = ROVER_WHEELS
    if states.shape[1] == 2:
        position = np.column_stack([states, height_on(ground, states) + height])
        turn = laid(states, ground, base, track).as_quat()
    else:
        position, turn = states[:, POSITION], states[:, QUATERNION]
    joints = np.zeros((len(states), ROVER_JOINTS))
    joints[:, 4:8] = rolled(position, turn, radius, track / 2)
    return Track(name, CONTROL_STEP, position, turn, joints, skeleton, colour, GHOST)


def rollout_scene(rows: Sequence[Any], minutes: float) -> Scene:
    """The first rollout of Figure 4: the robot, and what the models trained on so many minutes predict.

    Args:
        rows: of the results store, of one system; those of SEED and of METHODS are
            shown.
        minutes: of novice data.

    Raises:
        ValueError: no such row is stored, or the robot drives elsewhere today than it
            did then.
    """
    from companion.figures.style import METHOD_STYLES

    chosen = {
        row.trial.method: row
        for row in rows
        if (row.trial.seed, row.trial.novice_minutes) == (SEED, minutes)
    }
    shown = {name: chosen[name] for name in METHODS if name in chosen}
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
    truth = ride_track(ride, "the robot", TRUTH)
    ghosts = []
    for method, row in shown.items():
        whole, style = row.outcome.rollouts_predicted, METHOD_STYLES[method]
        states = np.array(whole[0] if whole else row.outcome.example_predicted)
        ghosts.append(
            predicted_track(
                states, ground, truth.skeleton, style["label"], style["color"], height
            )
        )
    return Scene(
        (truth, *ghosts),
        ground,
        2.0,
        f"the robot, and models trained on {minutes:g} min",
    )


def warthog_scene(recordings: Path = Path("recordings")) -> Scene:
    """A drive of the real Warthog, and what the model that is kept beside the recording predicts from its start."""
    drive = sidm.read_drives(
        recordings / "warthog.csv.gz", recordings / "skid_steer.yaml"
    )[WARTHOG_DRIVE]
    model = sidm.load(recordings / "models" / "warthog")
    path = model.rollout(drive.states[0], drive.actions)
    return predicted_scene(drive, path, BOXES["warthog"], ("the Warthog", "its model"))


def make(folder: Path = FOLDER) -> None:
    """Write the scenes of the book's page."""
    from companion import Results, Study

    rows = Results("results").rows(Study("laptop").figure4("system1"))
    for minutes in (5.0, 120.0):
        write_scene(
            folder / f"scene-{minutes:g}-minutes.npz", rollout_scene(rows, minutes)
        )
    write_scene(folder / "scene-warthog.npz", warthog_scene())


if __name__ == "__main__":
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    make()
