"""Learning a robot of one's own: its motion by the name of a file, or of a simulated robot, and the three methods."""

from __future__ import annotations

from pathlib import Path

import torch
from torch import Tensor

from sidm.body import ROVER
from sidm.config import ConfigError, unknown_name
from sidm.experiments.methods import change
from sidm.experiments.trials import EXPERT_SEED, POOL_SEED
from sidm.learning.beyond.pretraining import expert_in_place, start_from
from sidm.learning.beyond.recorded import Pieces, cut
from sidm.learning.dataset import Datasets, Motion, novice_split
from sidm.learning.settings import Network, Training
from sidm.learning.training import Trained, train
from sidm.recordings import Drive, Ground, read_drives
from sidm.systems import ROLES, SYSTEMS, System
from sidm.terrain import generate_terrain
from sidm.trajectory import Collection, Trajectory, trajectories_for

#: Robots of the paper by what they are called here -> system and role.
SIMULATED = {f"{system} {role}": (system, role) for system in SYSTEMS for role in ROLES}


def as_drive(trajectory: Trajectory, system: System) -> Drive:
    """A simulated trajectory as a recorded one, with its ground."""
    ground = Ground(generate_terrain(system.terrain, trajectory.terrain_seed), system.terrain.spacing)
    name = f"{system.name} trajectory {trajectory.index}"
    return Drive(name, name, trajectory.states.astype(float), trajectory.actions.astype(float), ground)


def pieces_of(source: str, minutes: float, data: str | Path = "data", policy: str = "ornstein_uhlenbeck") -> Pieces:
    """The motion of a robot, cut into trajectories.

    Args:
        source: a file or folder of recordings, or the name of a simulated robot, as 'system1 expert'.
        minutes: of a simulated robot's motion, simulated where it is missing; of recordings all are taken.
        data: the folder of simulated trajectories.
        policy: of a simulated robot's random actions.

    Raises:
        ConfigError: there is no such file, no such robot or no such policy.
        RecordingError: a file has a fault.
        ImportError: PyBullet is needed and not installed; one line.
    """
    if source in SIMULATED:
        from sidm.simulation import collect

        system, role = SIMULATED[source]
        seed = EXPERT_SEED if role == "expert" else POOL_SEED
        found = collect(data, Collection(system=system, role=role, policy=policy, seed=seed), trajectories_for(minutes))
        return cut([as_drive(trajectory, SYSTEMS[system]) for trajectory in found])
    if not Path(source).exists():
        error = unknown_name(source, SIMULATED, "the simulated robots")
        raise ConfigError(f"'{source}' is no file of recordings, and {error}")
    return cut(read_drives(source, ROVER))


def learn(
    motion: Motion,
    learning: Tensor,
    judging: Tensor,
    expert: Motion,
    minutes: float,
    network: Network,
    training: Training,
    seed: int,
) -> dict[str, Trained]:
    """Train Figure 3's methods on a novice's motion.

    Args:
        motion: the novice's.
        learning: numbers (n,) of its trajectories to learn from.
        judging: numbers (m,) of those to judge by.
        expert: the expert's.
        minutes: of the novice's motion to learn from, split 75 to 25 for training and testing.
        network: sizes of the networks.
        training: with the p_e and the regularisation of the method with SIDM.
        seed: of the choice of trajectories, the initial weights and the batches.

    Returns:
        By the name of the method.

    Raises:
        ConfigError: fewer minutes are there to learn from.
    """
    parts = (learning[torch.from_numpy(part)] for part in novice_split(len(learning), minutes, seed))
    train_part, test_part = (motion.part(part) for part in parts)
    sets = Datasets(train_part, test_part, motion.take(judging), expert)
    alone = change(training, p_expert=0.0, regularise=False)
    start = start_from(train(expert_in_place(sets, seed), network, alone, seed))
    return {
        "sidm": train(sets, network, training, seed),
        "novice_only": train(sets, network, alone, seed),
        "pretrain_finetune": train(sets, network, alone, seed, start=start.weights),
    }
