"""Real robots as novice and expert: what is learnt from seconds to minutes of motion, with and without another robot.

`companion run --figure real-robots` makes what is not stored of it in
results/real_robots. Sessions, contiguous in time, are never parted between learning and
judging; each seed judges by others.
"""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from companion.engine.provenance import Provenance
from companion.engine.records import Making, by_field, records_of
from companion.methods import METHODS
from companion.presets import Preset
from companion.study import Study
from companion.training import StudyTraining
from sidm.body import Body, read_body
from sidm.config import config
from sidm.drives import Drive, minutes_of
from sidm.fitting.learning import datasets, learn, network_for, pretrain
from sidm.fitting.settings import SETTINGS, Settings
from sidm.fitting.windows import (
    common_length,
    cut,
    learn_and_test,
    of_sessions,
    rollouts,
    session_order,
)
from sidm.learning.arithmetic import one_thread
from sidm.learning.dataset import Datasets, stacked, windows_of
from sidm.learning.evaluation import rollout_errors
from sidm.learning.losses import component_losses
from sidm.learning.model import Predictor
from sidm.learning.networks import Network
from sidm.learning.training import Trained
from sidm.learning.units import Standardisation, loss_weights, units_for, units_of
from sidm.recordings import read_drives
from sidm.rivals.fine_tuning import Start
from sidm.rivals.kinematics import identify
from sidm.storage import checksum

#: Robot -> its body's file.
RECORDINGS = Path("recordings")
ROBOTS = {
    "warthog": "skid_steer.yaml",
    "husky": "skid_steer.yaml",
    "hunter": "hunter.yaml",
}
PAIRS = {
    "husky to warthog": ("husky", "warthog"),
    "warthog to husky": ("warthog", "husky"),
    "hunter to warthog": ("hunter", "warthog"),
}
SEEDS = 10
#: of the novice, of some 6 s each; all but those that judge, of a Warthog
SESSIONS = (2, 4, 8, 16, 32, 72)
HELD_OUT = 0.25  # of the novice's sessions, that judge
WARM_UP, HORIZON = 4, 15  # steps seen before a rollout, and predicted: 0.4 s and 1.5 s

KINEMATICS = ("differential_drive", "rotation_centres")
ALONE = ("novice_only", "least_squares", *KINEMATICS)  # that need no expert
WITH_EXPERT = ("sidm", "no_regularisation", "core_finetune", "core_frozen")
PRETRAINED = "pretrain_finetune"
ONE_BODY = (PRETRAINED, "expert_only", "corrected")  # that need robots of one body


@config
class Transfer:
    """All sizes of one robot's motion, learnt by one method from one seed's sessions."""

    novice: str  # of ROBOTS
    expert: str  # '' without one
    method: str  # of METHODS, or of KINEMATICS
    seed: int
    sessions: tuple[int, ...]  # sizes
    steps: int  # of a piece
    data: tuple[str, ...]  # checksums of the robots' pieces
    network: Network
    training: StudyTraining  # that the methods' own settings are changes of


@config
class Transferred:
    """What came out, an entry a size; errors are means over the pieces that judge."""

    about: Transfer
    #: of the novice's motion learnt from, train and test together
    minutes: tuple[float, ...]
    #: equation (1), each component by its variance in the training motion of all
    #: sessions
    loss: tuple[float, ...]
    components: tuple[tuple[float, ...], ...]  # (6,) of it
    displacement: tuple[tuple[float, ...], ...]  # (15,) m, open loop, after the warm-up
    heading: tuple[tuple[float, ...], ...]  # (15,) rad
    #: (15,) m, from the same state without a warm-up
    cold_displacement: tuple[tuple[float, ...], ...]
    cold_heading: tuple[tuple[float, ...], ...]  # (15,) rad
    samples: tuple[int, ...]  # seen by the training
    provenance: Provenance


#: where they are kept, under a folder of results
records = records_of(Transferred, "real-robots")


@functools.lru_cache
def robot(name: str, steps: int | None = None) -> list[Drive]:
    """A robot's recorded motion in windows of `steps`, those of its own shortest drive unless given."""
    body = read_body(RECORDINGS / ROBOTS[name])
    drives = read_drives(RECORDINGS / f"{name}.csv.gz", body)
    return cut(drives, steps or common_length(drives))


def jobs(
    study: Study, pair: str, sessions: tuple[int, ...] = SESSIONS, seeds: int = SEEDS
) -> list[Transfer]:
    """All trainings of a pair; what needs no expert is that of the novice alone, the same for every pair."""
    expert, novice = PAIRS[pair]
    steps = min(len(robot(name)[0]) for name in (novice, expert))
    chosen = settings(study.preset)
    bodies = {name: robot(name)[0].body for name in (novice, expert)}
    one_body = bodies[novice] == bodies[expert]
    methods = [(name, "") for name in ALONE]
    methods += [
        (name, expert) for name in (*WITH_EXPERT, *(ONE_BODY if one_body else ()))
    ]
    return [
        Transfer(
            novice=novice,
            expert=other,
            method=method,
            seed=seed,
            sessions=sessions,
            steps=steps,
            data=tuple(
                checksum(stacked(robot(name, steps))[0].numpy())
                for name in (novice, other)
                if name
            ),
            network=network_for(chosen, bodies[novice], bodies[other or novice]),
            training=StudyTraining(**vars(chosen.training)),
        )
        for seed in range(seeds)
        for method, other in methods
    ]


def settings(preset: Preset) -> Settings:
    """Those of `sidm fit`, with at most the preset's samples."""
    samples = (
        min(SETTINGS.training.max_samples, preset.training.max_samples)
        if preset.name == "smoke"
        else None
    )
    return SETTINGS.with_values({"max_samples": samples}) if samples else SETTINGS


def measure(about: Transfer, data: str | Path = "data") -> Transferred:
    """Train and judge all sizes; needs the recordings alone, no `data`."""
    making = Making("fitting", None, data)
    novice = robot(about.novice, about.steps)
    expert = robot(about.expert, about.steps) if about.expert else None
    order = session_order(novice, about.seed)
    judging = round(HELD_OUT * len(order))
    judge, pool = of_sessions(novice, order[:judging]), order[judging:]
    scale = loss_weights(
        novice[0].body, Standardisation.of(windows_of(of_sessions(novice, pool), 0))
    )
    with one_thread():
        found = [
            _one(about, pool[:count], novice, judge, expert, scale)
            for count in about.sessions
        ]
    return Transferred(
        about=about,
        **by_field(found),
        provenance=making.done(),
    )


def _one(
    about: Transfer,
    sessions: np.ndarray,
    novice: list[Drive],
    judge: list[Drive],
    expert: list[Drive] | None,
    scale: Tensor | None,
) -> dict[str, Any]:
    """The fields on one size."""
    train_part, test_part = learn_and_test(novice, sessions)
    sets = datasets(train_part, test_part, judge, expert)
    trained = _learn(about, sets, novice[0].body)
    with torch.inference_mode():
        motion = windows_of(judge, 0)
        predicted, _ = trained.model("novice", motion.inputs, motion.maps)
        components = (
            component_losses(predicted, motion.targets, scale)
            .double()
            .mean((0, 1))
            .tolist()
        )
    (displacement, heading), (cold, cold_heading) = (
        _errors(trained.model, judge, seen) for seen in (True, False)
    )
    return {
        "minutes": minutes_of(train_part) + minutes_of(test_part),
        "loss": sum(components),
        "components": components,
        "displacement": displacement,
        "heading": heading,
        "cold_displacement": cold,
        "cold_heading": cold_heading,
        "samples": trained.samples,
    }


def _learn(about: Transfer, sets: Datasets, body: Body) -> Trained:
    if about.method in KINEMATICS:
        own = units_for(units_of(sets, about.network), "novice")
        return identify(sets, body, about.method, loss_weights(body, own))  # type: ignore[arg-type]
    chosen, start = (
        SETTINGS.with_values({"max_samples": about.training.max_samples}),
        None,
    )
    if METHODS[about.method].pretrained:
        start = _pretrained(
            about.expert, about.steps, about.network.body("expert"), about.seed, chosen
        )
    return learn(about.method, sets, about.network, about.seed, chosen, start)


@functools.lru_cache(maxsize=4)
def _pretrained(
    name: str, steps: int, body: Body, seed: int, chosen: Settings
) -> Start | None:
    """Weights that learnt from an expert alone, for all sizes and methods of a seed."""
    expert = windows_of(robot(name, steps), 0)
    return pretrain(
        PRETRAINED,
        Datasets(expert, expert, expert, expert),
        network_for(chosen, body),
        seed,
        chosen,
    )


def _errors(
    model: Predictor, judge: list[Drive], seen: bool
) -> tuple[list[float], list[float]]:
    """Mean displacement, m, and heading error, rad, (15,) each, after the WARM_UP, which the model has seen or not."""
    path = rollouts(model, judge, WARM_UP, HORIZON, seen=seen)
    errors = rollout_errors(
        path, stacked(judge)[0][:, WARM_UP : WARM_UP + HORIZON + 1], judge[0].body
    )
    displacement, heading = (error.mean(0).tolist() for error in errors)
    return displacement, heading
