"""Fixtures with fixed seeds: small synthetic motion and the smallest networks.

They need no simulator.
"""

import dataclasses
import os
from collections.abc import Callable, Generator
from importlib.util import find_spec
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import HealthCheck, settings
from xdist.scheduler import LoadFileScheduling

from companion.training import StudyTraining
from ownrobot.replay import ROBOTS, Ride, ride
from sidm.drives import Drive, SimulatedGround, probe
from sidm.learning import Datasets, Network, Windows
from sidm.learning.trainer import Trainer
from sidm.shards import simulated_drive
from sidm.storage import checksum
from sidm.systems import Terrain
from sidm.terrain import generate_terrain
from tests.golden import Golden

# a folder that examples share is meant, and no machine is too slow
settings.register_profile(
    "quick",
    max_examples=25,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
settings.register_profile("more", settings.get_profile("quick"), max_examples=200)
settings.load_profile("quick")

#: marker of a test -> whether this machine has what such a test needs
NEEDS = {"gpu": torch.cuda.is_available(), "triton": find_spec("triton") is not None}
if not torch.cuda.is_available():  # Triton reads it where a kernel is first imported
    os.environ["TRITON_INTERPRET"] = "1"


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo
) -> Generator[None, pytest.TestReport]:
    """Under CI a test that would be skipped fails, unless it needs a GPU or Triton."""
    report = yield
    allowed = hasattr(report, "wasxfail") or any(map(item.get_closest_marker, NEEDS))
    if report.skipped and os.environ.get("CI") and not allowed:
        reason = f"skipped, which CI does not allow: {report.longrepr}"
        report.outcome, report.longrepr = "failed", reason
    return report


def pytest_runtest_setup(item: pytest.Item) -> None:
    for need, there in NEEDS.items():
        if item.get_closest_marker(need) and not there:
            pytest.skip(f"needs {need}")


class Scheduling(LoadFileScheduling):
    """Gives the tests of a file to one worker.

    Tests that take long and share nothing go one by one to the next free worker.
    """

    def _split_scope(self, nodeid: str) -> str:
        alone = "with_the_smoke_preset", "runs_on_them", "is_seen"
        if any(name in nodeid for name in alone):
            return nodeid
        return super()._split_scope(nodeid)


def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Scheduling:
    """Schedule tests under `--dist loadfile`."""
    return Scheduling(config, log)


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Order files: what takes long first, and one that builds the book before others.

    The others that need the book follow when it is there, so that no worker waits.
    """
    with_book = {i.path for i in items if "book" in getattr(i, "fixturenames", ())}
    builder = max(with_book, default=None)

    def place(item: pytest.Item) -> int:
        if item.path.stem in ("test_shown_commands", "test_crash", "test_cluster"):
            return 0
        if item.path == builder:
            return 1
        notebooks = item.path.suffix == ".ipynb" or item.path.stem == "test_notebooks"
        return 2 if notebooks else 3 if item.path in with_book else 4

    items.sort(key=place)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--threads", type=int, default=1, help="of PyTorch")


@pytest.fixture(autouse=True, scope="session")
def threads(pytestconfig: pytest.Config) -> None:
    """Fix the number of threads, since bit-for-bit comparisons depend on it."""
    torch.set_num_threads(pytestconfig.getoption("threads"))


@pytest.fixture(scope="session")
def golden() -> Golden:
    """The stored figures: `golden.hold(name, kind, figures, rel)`."""
    return Golden()


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(0)


@pytest.fixture
def generator() -> torch.Generator:
    return torch.Generator().manual_seed(0)


@pytest.fixture(scope="session")
def small_terrain() -> Terrain:
    """Terrain of 8 m a side."""
    return Terrain(cell_height_scale=0.35, size=81)


@pytest.fixture
def small_network() -> Network:
    return Network(
        pixels=8,
        encoder_hidden=16,
        latent=8,
        layers=2,
        hidden=12,
        latent_transition=6,
        decoder_hidden=8,
        discriminator_hidden=16,
    )


@pytest.fixture
def small_training() -> StudyTraining:
    """Two phases of a few iterations; a batch holds 4 trajectories of 6 steps."""
    return StudyTraining(
        batch=4,
        discriminator_batch=3,
        matching_batch=3,
        prediction_iterations=6,
        discriminator_iterations=2,
        matching_iterations=2,
        test_interval=4,
        max_samples=24 * 12,
    )


@pytest.fixture(scope="session")
def make_trajectories(small_terrain) -> Callable[..., list[Drive]]:
    """Function that makes random drives: make_trajectories(count, steps=6, seed=0)."""

    def make(count: int, steps: int = 6, seed: int = 0) -> list[Drive]:
        rng, made = np.random.default_rng(seed), []
        for index in range(count):
            quaternion = rng.normal(size=(steps + 1, 4))
            quaternion /= np.linalg.norm(quaternion, axis=1, keepdims=True)
            position = np.cumsum(rng.normal(0, 0.1, (steps + 1, 3)), axis=0)
            states = np.hstack(
                [position, quaternion, rng.normal(size=(steps + 1, 6))]
            ).astype(np.float32)
            actions = rng.uniform(-1, 1, (steps, 2)).astype(np.float32)
            heights = generate_terrain(small_terrain, index)
            ground = SimulatedGround(
                small_terrain, index, checksum(heights), probe(heights)
            )
            made.append(
                simulated_drive("rover", index, states, actions, ground, (0, 0, 0, 0))
            )
        return made

    return make


@pytest.fixture(scope="session")
def make_motion() -> Callable[..., Windows]:
    """Function that makes motion that can be learnt: targets are linear in the inputs.

    Call `make_motion(count, seed=0, steps=6, gain=1.0)`.
    """

    def make(
        count: int, seed: int = 0, steps: int = 6, pixels: int = 8, gain: float = 1.0
    ) -> Windows:
        generator = torch.Generator().manual_seed(seed)
        inputs = torch.randn(count, steps, 11, generator=generator)
        maps = (
            0.2 * torch.randn(count, steps, pixels, pixels, generator=generator).half()
        )
        law = torch.randn(11, 13, generator=torch.Generator().manual_seed(99)) / 11
        targets = gain * inputs @ law + maps.float().mean((-2, -1))[..., None]
        return Windows(inputs, targets, maps)

    return make


@pytest.fixture
def datasets(make_motion) -> Datasets:
    """Novice data of 6 training, 2 test and 3 validation trajectories, and expert data.

    The 12 expert trajectories have other gains.
    """
    return Datasets(
        make_motion(6, 1),
        make_motion(2, 2),
        make_motion(3, 3),
        make_motion(12, 4, gain=1.5),
    )


@pytest.fixture
def make_trainer(datasets, small_network, small_training) -> Callable[..., Trainer]:
    """Function that makes a Trainer with some settings changed."""

    def make(**changes) -> Trainer:
        training = dataclasses.replace(small_training, **changes)
        return (training.trainer() or Trainer)(datasets, small_network, training, 0)

    return make


@pytest.fixture(scope="session")
def rides() -> dict[str, Ride]:
    """Rides of two robots over the same ground for half a second."""
    ground = Terrain(cell_height_scale=0.35)
    return {
        name: ride(ROBOTS[name], ground, 3, 0.5, steps=5)
        for name in ("system1 novice", "system2 expert")
    }
