"""Tiny studies on synthetic motion over real terrain, and made-up rows.

Nothing here needs the simulator.
"""

from pathlib import Path
from typing import get_type_hints

import numpy as np
import pytest

from companion import Outcome, Row, Study, Trial, load_preset
from companion.engine.frame import frame_of
from companion.engine.provenance import record_provenance
from ownrobot.recordings import write_drives
from sidm.body import ROVER
from sidm.drives import STEPS, Drive, Ground, SimulatedGround, probe
from sidm.shards import SHARD_SIZE, simulated_drive, write_shard
from sidm.storage import checksum
from sidm.systems import find_system
from sidm.terrain import generate_terrain, height_at

RESULTS = Path(__file__).parents[2] / "results"  # the committed results
TINY = dict(
    expert_minutes=1.0,
    novice_minutes_system1=[0.25, 0.75],
    novice_minutes_system2=[0.25],
    pool_minutes_system1=1.0,
    pool_minutes_system2=1.0,
    validation_minutes=0.25,
    rollouts=2,
    figure4_minutes=[0.25, 0.75],
    baseline_minutes=[0.25],
    variant_minutes=[0.25],
    ablation_minutes=[0.25],
    pixels=8,
    hidden=8,
    encoder_hidden=16,
    max_samples=8000,
)


def glide(
    heights: np.ndarray, actions: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """States (T + 1, 13) of a body that slides as throttle and steering command."""
    x = y = 0.0
    yaw, states = rng.uniform(-np.pi, np.pi), []
    for throttle, steering in (*actions, (0.0, 0.0)):
        rate = -throttle * steering  # a positive steering is to the right
        z = float(height_at(heights, np.array(x), np.array(y))) + 0.17
        turn = [0, 0, np.sin(yaw / 2), np.cos(yaw / 2)]
        states.append([x, y, z, *turn, throttle, 0, 0, 0, 0, rate])
        x, y, yaw = (
            x + 0.1 * throttle * np.cos(yaw),
            y + 0.1 * throttle * np.sin(yaw),
            yaw + 0.1 * rate,
        )
    return np.array(states, np.float32)


def write_motion(data: Path, dataset) -> None:
    """Write sliding bodies as the start of a collection."""
    collection = dataset.collection
    rng = np.random.default_rng([collection.seed, collection.role == "expert"])
    terrain, made = find_system(collection.system).terrain, []
    for index in range(SHARD_SIZE * -(-dataset.count // SHARD_SIZE)):
        heights = generate_terrain(terrain, index % 2)
        actions = np.tile(rng.uniform(-1, 1, 2), (STEPS, 1)).astype(np.float32)
        states = glide(heights, actions, rng)
        ground = SimulatedGround(terrain, index % 2, checksum(heights), probe(heights))
        made.append(
            simulated_drive("rover", index, states, actions, ground, (0, 0, 0, 0))
        )
    for number, start in enumerate(range(0, len(made), SHARD_SIZE)):
        write_shard(collection.shard(data, number), made[start : start + SHARD_SIZE])


@pytest.fixture(scope="session")
def recordings(tmp_path_factory):
    """A folder with twelve drives over six grounds for system 1."""
    folder, rng = tmp_path_factory.mktemp("recordings"), np.random.default_rng(1)
    drives = []
    for number in range(12):
        heights = generate_terrain(find_system("system1").terrain, number // 2)
        actions = np.tile(rng.uniform(-1, 1, 2), (STEPS, 1))
        states = glide(heights, actions, rng).astype(float)
        drives.append(Drive(states, actions, ROVER, Ground(heights, 0.1)))
    write_drives(folder / "system1.npz", drives, "made up")
    return folder


@pytest.fixture(scope="session")
def tiny():
    """A preset whose trials take a second."""
    return load_preset("smoke", **TINY)


@pytest.fixture(scope="session")
def data(tiny, tmp_path_factory) -> Path:
    """Folder with the tiny preset's data for system 1."""
    folder = tmp_path_factory.mktemp("data")
    for dataset in tiny.datasets("system1").values():
        write_motion(folder, dataset)
    return folder


@pytest.fixture
def study(tiny) -> Study:
    """The tiny study."""
    return Study(tiny)


@pytest.fixture(scope="session")
def make_row():
    """Function that makes a row without running its trial: make_row(trial, loss)."""

    def make(trial, loss: float = 2.0) -> Row:
        outcome = Outcome(
            validation_loss=loss,
            component_losses=(loss / 13,) * 13,
            best_test_loss=loss * 1.1,
            position_error=tuple(0.01 * loss * (k + 1) for k in range(25)),
            heading_error=tuple(0.02 * (k + 1) for k in range(25)),
            curve_samples=(100, 200, 300),
            curve_test_loss=(3.0, 2.5, 1.1 * loss),
            curve_training_loss=(3.0, 2.0, 1.0),
            iterations=30,
            samples=300,
        )
        return Row(
            trial=trial,
            outcome=outcome,
            provenance=record_provenance(seconds=12.0, threads=1, resumed=False),
        )

    return make


def made(kind, about, **values):
    """A made-up record of some kind; values that are not given are 0."""
    nothing = {
        name: {float: 0.0, int: 0}.get(hint, ())
        for name, hint in get_type_hints(kind).items()
    }
    return kind(
        **(
            nothing
            | values
            | {"about": about, "provenance": record_provenance(1.0, 1, False)}
        )
    )


def kept(store, found) -> bool:
    """Whether a record has today's versions and stays the same when read again."""
    store.put(found)
    return not found.provenance.stale and store.get(found.about).about == found.about


@pytest.fixture(scope="session")
def laptop() -> Study:
    """The study of the preset `laptop`."""
    return Study("laptop")


@pytest.fixture(scope="session")
def power_law():
    """Loss of a trial by a power law of its data, with a factor for its seed.

    Data count four times with SIDM.
    """

    def law(trial: Trial) -> float:
        data = trial.novice_minutes * (4 if trial.method == "sidm" else 1)
        return (1 + 0.01 * trial.seed) * data**-0.5

    return law


@pytest.fixture(scope="session")
def figure3_rows(laptop, make_row, power_law) -> list[Row]:
    """Made-up rows of all trials of Figure 3, by the power law."""
    return [
        make_row(t, power_law(t))
        for system in ("system1", "system2")
        for t in laptop.figure3(system)
    ]


@pytest.fixture(scope="session")
def figure3_frame(figure3_rows):
    """The rows of Figure 3 as a table."""
    return frame_of(figure3_rows)
