"""Trials for bundles."""

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest

from companion.bundle import Run
from sidm.body import ROVER
from sidm.learning import Datasets
from tests.sidm.learning.test_other_bodies import motion


@pytest.fixture
def make_run(small_training) -> Callable[..., Run]:
    """Function that makes a run with its own random data.

    Call `make_run(seed, sizes, settings)`.
    """

    def make(
        seed=0,
        novice=6,
        tests=2,
        start=None,
        checkpoint=None,
        **changes,
    ) -> Run:
        rng = np.random.default_rng(seed)
        parts = [motion(ROVER, count, rng, steps=6) for count in (novice, tests, 2)]
        training = dataclasses.replace(small_training, **changes)
        return Run(
            Datasets(*parts, motion(ROVER, 12, rng, steps=6)),
            training,
            seed,
            checkpoint,
            start,
        )

    return make
