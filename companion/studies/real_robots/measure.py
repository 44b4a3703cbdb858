"""Real robots as novice and expert: models from seconds to minutes of motion.

`companion run --figure real-robots` makes the results that are not stored in
results/real_robots.jsonl yet. Sessions are contiguous in time; none is divided between
training and evaluation. Each seed evaluates on other sessions.
"""

from __future__ import annotations

import functools
from pathlib import Path

import torch

from companion.engine.provenance import Provenance
from companion.engine.records import ProvenanceTimer, by_field, records_of
from companion.methods import METHODS
from companion.presets import Preset
from companion.study import Study
from companion.training import StudyTraining
from ownrobot.body_file import read_body
from ownrobot.fitting.learning import (
    SETTINGS,
    Settings,
    learn,
    network_for,
    pretrain,
)
from ownrobot.fitting.splits import drives_of_sessions, session_order, train_test_split
from ownrobot.fitting.windows import common_length, cut, rollouts
from ownrobot.methods.fine_tuning import Pretrained
from ownrobot.methods.kinematics import identify
from ownrobot.recordings import read_drives
from sidm.body import Body
from sidm.config import config
from sidm.drives import Drive, minutes_of
from sidm.learning.arithmetic import one_thread
from sidm.learning.dataset import Datasets, states_and_actions, windows_of
from sidm.learning.evaluation import rollout_errors
from sidm.learning.losses import component_losses
from sidm.learning.model import Predictor
from sidm.learning.networks import Network
from sidm.learning.training import Trained
from sidm.learning.units import Standardisation, default_units, loss_weights, role_units
from sidm.storage import checksum

RECORDINGS = Path("recordings")
#: Robot -> its body's file.
ROBOTS = {
    "warthog": "skid_steer.yaml",
    "husky": "skid_steer.yaml",
    "hunter": "hunter.yaml",
}
#: Name of a pair -> expert and novice.
PAIRS = {
    "husky to warthog": ("husky", "warthog"),
    "warthog to husky": ("warthog", "husky"),
    "hunter to warthog": ("hunter", "warthog"),
}
SEEDS = 10
#: numbers of sessions of the novice, some 6 s each; the last is all training sessions
#: of a Warthog
SESSIONS = (2, 4, 8, 16, 32, 72)
HELD_OUT = 0.25  # share of the novice's sessions that serve evaluation
#: steps seen before a rollout (0.4 s), and steps predicted (1.5 s)
WARM_UP, HORIZON = 4, 15

KINEMATICS = ("differential_drive", "rotation_centres")
ALONE = ("novice_only", "least_squares", *KINEMATICS)  # methods without an expert
WITH_EXPERT = ("sidm", "no_regularisation", "core_finetune", "core_frozen")
PRETRAINED = "pretrain_finetune"
#: methods that need robots of the same body
ONE_BODY = (PRETRAINED, "expert_only", "corrected")


@config
class Transfer:
    """Trainings on all sizes of one robot's motion, with one method and one seed."""

    novice: str  # a key of ROBOTS
    expert: str  # a key of ROBOTS; '' without an expert
    method: str  # a name of METHODS or of KINEMATICS
    seed: int
    sessions: tuple[int, ...]  # sizes: numbers of sessions
    steps: int  # length of a window
    data: tuple[str, ...]  # checksums of the robots' windows
    network: Network
    training: StudyTraining  # before the changes of the method


@config
class TransferResult:
    """Results of a Transfer, an entry per size; errors are means over test windows."""

    about: Transfer
    #: of the novice's motion, train and test split together
    minutes: tuple[float, ...]
    #: equation (1), each component by its variance in the training motion of all
    #: sessions
    loss: tuple[float, ...]
    components: tuple[tuple[float, ...], ...]  # (6,) components of the loss
    displacement: tuple[tuple[float, ...], ...]  # (15,) m, open loop, after the warm-up
    heading: tuple[tuple[float, ...], ...]  # (15,) rad, open loop, after the warm-up
    #: (15,) m, from the same state without a warm-up
    cold_displacement: tuple[tuple[float, ...], ...]
    #: (15,) rad, from the same state without a warm-up
    cold_heading: tuple[tuple[float, ...], ...]
    samples: tuple[int, ...]  # seen by the training
    provenance: Provenance


#: the stored results, under a folder of results
records = records_of(TransferResult, "real-robots")


@functools.lru_cache
def robot(name: str, steps: int | None = None) -> list[Drive]:
    """A robot's recorded motion in windows of `steps`.

    By default a window is as long as the robot's shortest drive.
    """
    body = read_body(RECORDINGS / ROBOTS[name])
    drives = read_drives(RECORDINGS / f"{name}.csv.gz", body)
    return cut(drives, steps or common_length(drives))


def jobs(
    study: Study, pair: str, sessions: tuple[int, ...] = SESSIONS, seeds: int = SEEDS
) -> list[Transfer]:
    """All trainings of a pair.

    A training without an expert depends on the novice and the length of the windows
    alone, so pairs share it.
    """
    expert, novice = PAIRS[pair]
    steps = min(len(robot(name)[0]) for name in (novice, expert))
    fit_settings = settings(study.preset)
    bodies = {name: robot(name)[0].body for name in (novice, expert)}
    one_body = ONE_BODY if bodies[novice] == bodies[expert] else ()
    methods = [(method, "") for method in ALONE]
    methods += [(method, expert) for method in (*WITH_EXPERT, *one_body)]

    def data_of(name: str) -> str:
        return checksum(states_and_actions(robot(name, steps))[0].numpy())

    return [
        Transfer(
            novice=novice,
            expert=other,
            method=method,
            seed=seed,
            sessions=sessions,
            steps=steps,
            data=tuple(data_of(name) for name in (novice, other) if name),
            network=network_for(fit_settings, bodies[novice], bodies[other or novice]),
            training=StudyTraining(**vars(fit_settings.training)),
        )
        for seed in range(seeds)
        for method, other in methods
    ]


def settings(preset: Preset) -> Settings:
    """The settings of the fits; the preset 'smoke' may train with fewer samples."""
    if preset.name != "smoke":
        return SETTINGS
    samples = min(SETTINGS.training.max_samples, preset.training.max_samples)
    return SETTINGS.with_values({"max_samples": samples})


def measure(about: Transfer, data: str | Path = "data") -> TransferResult:
    """Train and evaluate the models of all sizes.

    This needs the recordings alone; `data` serves the provenance only.
    """
    timer = ProvenanceTimer("fitting", None, data)
    novice = robot(about.novice, about.steps)
    expert = robot(about.expert, about.steps) if about.expert else None
    order = session_order(novice, about.seed)
    count = round(HELD_OUT * len(order))
    validation, pool = drives_of_sessions(novice, order[:count]), order[count:]
    units = Standardisation.fit(windows_of(drives_of_sessions(novice, pool), 0))
    weights = loss_weights(novice[0].body, units)
    motion, sizes = windows_of(validation, 0), []
    others = windows_of(expert, 0) if expert else None
    with one_thread():
        for size in about.sessions:
            parts = train_test_split(novice, pool[:size])
            train, test = (windows_of(part, 0) for part in parts)
            sets = Datasets(train, test, motion, others)
            trained = _learn(about, sets, novice[0].body)
            with torch.inference_mode():
                predicted, _ = trained.model("novice", motion.inputs, motion.maps)
                losses = component_losses(predicted, motion.targets, weights)
            components = losses.double().mean((0, 1)).tolist()
            fields = {
                "minutes": sum(map(minutes_of, parts)),
                "loss": sum(components),
                "components": components,
                "samples": trained.samples,
            }
            sizes.append(fields | _open_loop(trained.model, validation))
    return TransferResult(about=about, **by_field(sizes), provenance=timer.done())


def _learn(about: Transfer, sets: Datasets, body: Body) -> Trained:
    if about.method in KINEMATICS:
        units = role_units(default_units(sets, about.network), "novice")
        return identify(sets, body, about.method, loss_weights(body, units))  # type: ignore[arg-type]
    fit_settings = SETTINGS.with_values({"max_samples": about.training.max_samples})
    start = None
    if METHODS[about.method].pretrained:
        expert_body = about.network.body("expert")
        start = _pretrained(
            about.expert, about.steps, expert_body, about.seed, fit_settings
        )
    return learn(about.method, sets, about.network, about.seed, fit_settings, start)


@functools.lru_cache(maxsize=4)
def _pretrained(
    name: str, steps: int, body: Body, seed: int, fit_settings: Settings
) -> Pretrained | None:
    """Weights trained on an expert alone, shared by all sizes and methods of a seed."""
    expert = windows_of(robot(name, steps), 0)
    sets = Datasets(expert, expert, expert, expert)
    network = network_for(fit_settings, body)
    return pretrain(PRETRAINED, sets, network, seed, fit_settings)


def _open_loop(model: Predictor, drives: list[Drive]) -> dict[str, list[float]]:
    """Mean displacement and heading errors as fields of a TransferResult.

    Rollouts start after WARM_UP steps, which the model has seen or, cold, not.
    """
    states = states_and_actions(drives)[0][:, WARM_UP : WARM_UP + HORIZON + 1]
    fields = {}
    for prefix, seen in (("", True), ("cold_", False)):
        path = rollouts(model, drives, WARM_UP, HORIZON, seen=seen)
        displacement, heading = rollout_errors(path, states, drives[0].body)
        fields[f"{prefix}displacement"] = displacement.mean(0).tolist()
        fields[f"{prefix}heading"] = heading.mean(0).tolist()
    return fields
