"""Real robots: every method learns their recordings.

Losses are of sessions that no method has seen; a table shows them.
"""

import numpy as np
import pytest

from companion import Study, registry
from companion.presets import load_preset
from companion.studies.real_robots import jitter
from companion.studies.real_robots import measure as m
from companion.studies.real_robots import results as r
from ownrobot.fitting.splits import session_order, sessions_of, train_test_split
from sidm.config import ConfigError, replace

JOBS = {
    (job.expert, job.method): job
    for pair in m.PAIRS
    for job in m.jobs(Study("smoke"), pair, (4, 8), 1)
}


JUDGED = [
    ("", "rotation_centres"),
    ("", "least_squares"),
    ("hunter", "sidm"),
    ("husky", "corrected"),
]


def test_sessions_are_never_parted():
    windows = m.robot("warthog", 19)
    order = session_order(windows, 3)
    learning, testing = (
        set(sessions_of(part)) for part in train_test_split(windows, order[:12])
    )
    assert not learning & testing and learning | testing == set(order[:12])
    more, _ = train_test_split(windows, order[:16])
    assert learning <= set(sessions_of(more))


def test_a_study_is_asked_for_its_own_systems_alone(tmp_path):
    with pytest.raises(ConfigError, match="is about husky to warthog"):
        registry.run(
            "real-robots", load_preset("smoke"), "system1", 1, tmp_path, tmp_path
        )
    assert registry.STUDIES["real-robots"].pairs == tuple(m.PAIRS)


def test_jitter_is_found_in_a_smooth_path(rng):
    """Noise is 2 cm, 1 cm and 0.01 rad on a curve of 20 steps.

    The curve itself does not count as jitter.
    """
    windows, time = m.robot("warthog", 19)[:280], 0.1 * np.arange(20)
    yaw = np.tile(0.5 * time, (280, 1))
    smooth = np.stack(
        [2 * np.sin(yaw), 2 - 2 * np.cos(yaw), yaw, *np.zeros((3, 280, 20))], -1
    )
    first = [
        replace(one, states=path) for one, path in zip(windows, smooth, strict=True)
    ]
    size = (0.02, 0.01, 0.01)
    assert jitter.jitter(first).max() < 1e-4
    forward, left, turn = (scale * rng.normal(size=yaw.shape) for scale in size)
    noisy = smooth.copy()
    noisy[..., 0] += np.cos(yaw) * forward - np.sin(yaw) * left
    noisy[..., 1] += np.sin(yaw) * forward + np.cos(yaw) * left
    noisy[..., 2] += turn
    shaken = [
        replace(one, states=path) for one, path in zip(windows, noisy, strict=True)
    ]
    assert jitter.jitter(shaken) == pytest.approx(size, rel=0.1)


def test_jitter_costs_at_least_half_of_what_it_costs_without_memory():
    floor = jitter.floor(m.robot("warthog"))
    assert floor.loss[1] == 2 * floor.loss[0] and 0.1 < floor.loss[0] < 0.2
    assert 0.02 < floor.displacement[0] < floor.displacement[1] < 0.1
    assert floor.heading[1] > floor.heading[0]
    floors = {"warthog": floor.loss, "husky": jitter.floor(m.robot("husky")).loss}
    figure = r.figure(m.records("results").frame(), "loss", floors)
    assert [line.get_text() for line in figure.axes[-1].get_legend().get_texts()][
        -1
    ] == "jitter of the pose"


@pytest.mark.parametrize("method", ["least_squares", "differential_drive"])
def test_a_stored_result_made_again_is_the_stored_one(method):
    """All sizes of one seed agree but for rounding; only the recordings are needed."""
    job = next(
        one
        for one in m.jobs(Study("laptop"), "husky to warthog")
        if (one.method, one.seed) == (method, 0)
    )
    stored, repeated = m.records("results").get(job), m.measure(job)
    assert repeated.minutes == pytest.approx(stored.minutes)
    assert repeated.loss == pytest.approx(stored.loss, rel=1e-3)
    assert repeated.displacement[-1] == pytest.approx(stored.displacement[-1], rel=1e-2)
