"""Real robots: sessions that no method has seen, and the jitter of their poses."""

import numpy as np
import pytest

from companion import Study
from companion.registry import STUDIES
from companion.studies.real_robots import jitter
from companion.studies.real_robots import measure as m
from companion.studies.real_robots import results as r
from sidm.config import ConfigError, replace


def test_a_study_is_asked_for_its_own_systems_alone(tmp_path):
    with pytest.raises(ConfigError, match="'real-robots' is about husky to warthog"):
        STUDIES["real-robots"].run(Study("smoke"), "system1", 1, tmp_path, tmp_path)


def test_jitter_is_found_in_a_smooth_path(rng):
    """Noise is 2 cm, 1 cm and 0.01 rad on a curve, which does not count as jitter."""
    windows = m.robot("warthog", 19)[:280]
    yaw = np.tile(0.05 * np.arange(20), (280, 1))
    still = np.zeros((3, 280, 20))
    path = np.stack([2 * np.sin(yaw), 2 - 2 * np.cos(yaw), yaw, *still], -1)

    def found(states):
        pairs = zip(windows, states, strict=True)
        return jitter.jitter([replace(one, states=some) for one, some in pairs])

    assert found(path).max() < 1e-4
    size = (0.02, 0.01, 0.01)
    forward, left, turn = (scale * rng.normal(size=yaw.shape) for scale in size)
    path[..., 0] += np.cos(yaw) * forward - np.sin(yaw) * left
    path[..., 1] += np.sin(yaw) * forward + np.cos(yaw) * left
    path[..., 2] += turn
    assert found(path) == pytest.approx(size, rel=0.1)


def test_jitter_costs_at_least_half_of_what_it_costs_without_memory():
    floor = jitter.floor(m.robot("warthog"))
    assert floor.loss[1] == 2 * floor.loss[0] and 0.1 < floor.loss[0] < 0.2
    assert 0.02 < floor.displacement[0] < floor.displacement[1] < 0.1
    assert floor.heading[1] > floor.heading[0]
    floors = {"warthog": floor.loss, "husky": floor.loss}
    figure = r.figure(m.records("results").frame(), "loss", floors)
    named = figure.axes[-1].get_legend().get_texts()
    assert named[-1].get_text() == "jitter of the pose"


@pytest.mark.parametrize("method", ["least_squares", "differential_drive"])
def test_a_stored_result_made_again_is_the_stored_one(method):
    """All sizes of one seed agree but for rounding; only the recordings are needed."""
    jobs = m.jobs(Study("laptop"), "husky to warthog")
    job = next(one for one in jobs if (one.method, one.seed) == (method, 0))
    stored, repeated = m.records("results").get(job), m.measure(job)
    assert repeated.minutes == pytest.approx(stored.minutes)
    assert repeated.loss == pytest.approx(stored.loss, rel=1e-3)
    assert repeated.displacement[-1] == pytest.approx(stored.displacement[-1], rel=1e-2)
