"""When does an SIDM pay? The gap between two robots before learning, beside the saving.

The gap compares motion in the plane only, so any two robots can be compared. For a
sample of the novice, the motion of the next second is predicted from the most similar
samples of the expert (velocity, yaw rate, command). A command enters as the mean speed
and yaw rate that it causes. The gap is a ratio of prediction errors;
`studies.simulated_gap` measures another gap, the difference between motions under the
same actions.

`companion run --figure payoff` measures the gaps and writes `results/payoff.json`.
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Executor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from scipy.spatial import cKDTree

from companion.engine.records import read_or_empty
from companion.figures.dots import dot_plot
from companion.figures.style import system_label
from companion.statistics.savings import savings
from companion.studies.nearest_neighbours import NEIGHBOURS
from companion.studies.real_robots import results as robot_results
from companion.studies.real_robots.measure import HELD_OUT, PAIRS, robot
from companion.studies.several_experts import results as family_results
from companion.studies.several_experts.measure import dataset, robots
from companion.study import Study
from companion.trials import EXPERT_SEED, POOL_SEED
from sidm.drives import QUATERNION, Drive, yaw_of
from sidm.pool import local_pool
from sidm.shards import Collection
from sidm.systems import FREE_SYSTEMS, PAPER_SYSTEMS

RATE = 10  # control steps per second
AHEAD = 10  # steps of a predicted motion
BEFORE = 4  # steps over which a velocity is taken
TRAJECTORIES = 128  # of each simulated robot
POLICY = "ornstein_uhlenbeck"
MEMBER = 0  # the member of the family that is an expert
QUERY_EVERY = 4  # every fourth trajectory of the novice is predicted
NAME = "payoff.json"

#: Title of each plot -> the method that it shows.
PANELS = {
    "an SIDM": "sidm",
    "fine-tuning": "pretrain_finetune",
    "fine-tuning, core alone": "core_finetune",
}
SAVING = tuple(PANELS.values())
PAPER, FREE, FAMILY = "the paper's pairs", "free struts", "an expert of the family"
BODIES, REAL = "novices of another body", "real robots"
#: Headings of the figure -> kinds of pairs below it.
HEADINGS = {
    "simulated, same sensors": (PAPER, FREE, FAMILY),
    "simulated, other sensors": (BODIES,),
    "real robots": (REAL,),
}


class PlanarMotion(NamedTuple):
    """Motion of a robot in the plane: N trajectories of T steps at 10 Hz."""

    poses: np.ndarray  # (N, T + 1, 3) x and y, m, heading, rad
    yaw_rate: np.ndarray  # (N, T + 1) rad/s
    actions: np.ndarray  # (N, T, A)


class MotionSamples(NamedTuple):
    """M samples of a robot's motion, with the motion within the next second.

    Attributes:
        features: (M, 5) forward and left velocity, m/s, yaw rate, rad/s, speed, m/s,
            and yaw rate, rad/s, of the command
        motions: (M, 3) motion within a second in the robot's frame: forward and left,
            m, heading, rad
        trajectories: (M,) number of the trajectory
    """

    features: np.ndarray
    motions: np.ndarray
    trajectories: np.ndarray


def _arrays(drives: list[Drive]) -> tuple[np.ndarray, np.ndarray]:
    """States (N, T + 1, S) and actions (N, T, A) of drives of one length."""
    # here, since stored savings are read without PyTorch
    from sidm.learning.dataset import states_and_actions

    states, actions = states_and_actions(drives)
    return states.numpy(), actions.numpy()


def simulated_motion(drives: list[Drive]) -> PlanarMotion:
    """Planar motion of drives of one of the paper's robots."""
    states, actions = _arrays(drives)
    yaw = yaw_of(states[..., QUATERNION])
    poses = np.concatenate([states[..., :2], yaw[..., None]], -1)
    return PlanarMotion(poses, states[..., 12], actions)


def recorded_motion(name: str) -> PlanarMotion:
    """Planar motion of a real robot, or of a robot in a third party's simulator."""
    states, actions = _arrays(robot(name))
    return PlanarMotion(states[..., :3], states[..., 3], actions)


def motion_samples(motion: PlanarMotion) -> MotionSamples:
    """All samples that have BEFORE steps before them and AHEAD steps after them.

    The speed and yaw rate of a command are fitted to the motion by least squares, with
    the mean commands of the next second and their products as terms.
    """
    poses = motion.poses.copy()
    poses[..., 2] = np.unwrap(poses[..., 2], axis=1)
    times = np.arange(BEFORE, poses.shape[1] - AHEAD)
    now, then, later = (poses[:, times + shift] for shift in (0, -BEFORE, AHEAD))
    velocity = -_relative(now, then)[..., :2] / BEFORE * RATE
    motions = _relative(now, later)
    # mean commands (N, times, A)
    commands = np.stack([motion.actions[:, t : t + AHEAD].mean(1) for t in times], 1)
    rows, columns = np.triu_indices(commands.shape[-1])
    products = commands[..., rows] * commands[..., columns]
    terms = np.concatenate([np.ones_like(commands[..., :1]), commands, products], -1)
    targets = motions[..., (0, 2)].reshape(-1, 2) * RATE / AHEAD
    flat = terms.reshape(-1, terms.shape[-1])
    twist = terms @ np.linalg.lstsq(flat, targets, rcond=None)[0]
    features = np.concatenate([velocity, motion.yaw_rate[:, times, None], twist], -1)
    numbers = np.broadcast_to(np.arange(len(poses))[:, None], features.shape[:2])
    return MotionSamples(
        features.reshape(-1, 5), motions.reshape(-1, 3), numbers.reshape(-1)
    )


def _relative(frames: np.ndarray, poses: np.ndarray) -> np.ndarray:
    """Poses (..., 3) relative to the poses `frames` (..., 3)."""
    moved, yaw = poses - frames, frames[..., 2]
    forward = np.cos(yaw) * moved[..., 0] + np.sin(yaw) * moved[..., 1]
    left = np.cos(yaw) * moved[..., 1] - np.sin(yaw) * moved[..., 0]
    return np.stack([forward, left, moved[..., 2]], -1)


def gap(expert: PlanarMotion, novice: PlanarMotion) -> dict[str, float]:
    """Errors of motions predicted from the expert's and the novice's samples.

    Both predictions use the same number of samples. Means over a second, m and rad:
    `displacement` and `heading` from the expert's samples, `own_displacement` and
    `own_heading` from the novice's.
    """
    experts, novices = motion_samples(expert), motion_samples(novice)
    queries = novices.trajectories % QUERY_EVERY == 0
    own = MotionSamples(*(values[~queries] for values in novices))
    count = min(len(own.features), len(experts.features))
    scale = own.features.std(0)
    errors = {}
    for prefix, samples in (("", experts), ("own_", own)):
        even = np.linspace(0, len(samples.features) - 1, count).round().astype(int)
        tree = cKDTree(samples.features[even] / scale)
        _, near = tree.query(novices.features[queries] / scale, k=NEIGHBOURS)
        error = samples.motions[even][near].mean(1) - novices.motions[queries]
        distance = np.linalg.norm(error[:, :2], axis=1)
        errors[f"{prefix}displacement"] = float(distance.mean())
        errors[f"{prefix}heading"] = float(np.abs(error[:, 2]).mean())
    return errors


def pair_motions(
    data: Path, executor: Executor
) -> Iterator[tuple[str, PlanarMotion, PlanarMotion]]:
    """Name, expert's motion and novice's motion of each pair of robots.

    Motion that is missing in `data` is simulated.
    """
    from sidm.simulation import collect

    def paper_robot(system: str, role: str) -> PlanarMotion:
        seed = EXPERT_SEED if role == "expert" else POOL_SEED
        collection = Collection(system=system, role=role, policy=POLICY, seed=seed)
        drives = collect(data, collection, TRAJECTORIES, executor=executor)
        return simulated_motion(drives)

    def family_member(system: str) -> PlanarMotion:
        member = dataset(system, MEMBER, POLICY, TRAJECTORIES)
        drives = collect(
            data,
            member.collection,
            TRAJECTORIES,
            executor=executor,
            system=robots(member),
        )
        return simulated_motion(drives)

    for system in (*PAPER_SYSTEMS, *FREE_SYSTEMS):
        yield system, paper_robot(system, "expert"), paper_robot(system, "novice")
    yield "family", family_member("system1"), paper_robot("system1", "novice")
    for pair, (expert, novice) in PAIRS.items():
        yield pair, recorded_motion(expert), recorded_motion(novice)


def make(study: Study, workers: int, data: Path, results: Path) -> dict[str, Any]:
    """Measure the gap of every pair."""
    measured = {}
    with local_pool(workers) as pool:
        for pair, *motions in pair_motions(data, pool):
            errors = gap(*motions)
            measured[pair] = {name: float(f"{errors[name]:.5g}") for name in errors}
    return {"found": measured}


def gaps(results: Path | str = "results") -> pd.DataFrame:
    """The stored gaps as a table, without rows if none are stored.

    One row per `pair`: the errors that `gap` returns; the expert's divided by the
    novice's own, `displacement_ratio` and `heading_ratio`; and `gap`, their geometric
    mean: 1 where the expert predicts as well as the novice itself.
    """
    stored = read_or_empty(Path(results) / NAME).get("found", {})
    names = ["displacement", "heading", "own_displacement", "own_heading"]
    table = pd.DataFrame.from_dict(stored, orient="index", columns=names)
    table = table.rename_axis("pair").reset_index()
    for name in names[:2]:
        table[f"{name}_ratio"] = table[name] / table[f"own_{name}"]
    return table.assign(gap=np.sqrt(table.displacement_ratio * table.heading_ratio))


def gaps_for_page(gaps: pd.DataFrame) -> pd.DataFrame:
    """A table made by `gaps` as a page shows it."""
    names = {
        "pair": "pair",
        "displacement": "expert's error (m)",
        "own_displacement": "own (m)",
        "heading": "expert's error (rad)",
        "own_heading": "own (rad)",
        "gap": "gap",
    }
    return gaps[[*names]].rename(columns=names)


def savings_of(
    kind: str, frame: pd.DataFrame, size: float = 1.0, pair: str = "", **options: Any
) -> pd.DataFrame:
    """Novice data of training without SIDM divided by each method's, at equal loss.

    The method has about a minute of the novice's motion.

    Args:
        kind: of the pairs of robots.
        frame: results as those of Figure 3; each pair is a system.
        size: the novice dataset size nearest to a minute, in the units of the frame's
            `novice_minutes`.
        pair: the pair whose gap all these systems have; each its own unless given.
        options: of `savings`.

    Returns:
        The table of `savings`, one row per system and method that has results, with
        `kind`, and the `pair` whose gap belongs to the row.
    """
    methods = [name for name in SAVING if name in set(frame.method)]
    rows = savings(frame, methods, **options)
    rows = rows[rows.novice_minutes == size]
    return rows.assign(kind=kind, pair=pair or rows.system)


def family_of(frame: pd.DataFrame, table: pd.DataFrame) -> pd.DataFrame:
    """Fine-tuning after one expert of the family, as results like those of Figure 3.

    Training without SIDM stands beside it, from the `frame` of Figure 3; both have the
    system 'family'. `table` is that of several experts.
    """
    member = table[(table.experts == family_results.MEMBER) & (table.way == "all")]
    losses = member.rename(columns={"loss": "validation_loss"})
    tuned = losses.assign(method="pretrain_finetune")
    alone = frame[(frame.method == "novice_only") & frame.system.isin(member.system)]
    columns = ["system", "method", "seed", "novice_minutes", "validation_loss"]
    both = pd.concat([tuned[columns], alone[columns]], ignore_index=True)
    return both.assign(system="family")


def saved(
    figure3: pd.DataFrame,
    free: pd.DataFrame,
    bodies: pd.DataFrame,
    relatives: pd.DataFrame,
    recorded: pd.DataFrame,
) -> pd.DataFrame:
    """`savings_of` all kinds of pairs.

    The results are those of Figure 3, the same with free struts, novices with other
    bodies, records of several experts, and records of real robots.
    """
    member = family_of(figure3, family_results.table(relatives))
    real = robot_results.long(recorded)
    by_novice = bodies.assign(system=bodies.novice_body)
    kinds = [
        savings_of(PAPER, figure3),
        savings_of(FREE, free),
        savings_of(FAMILY, member),
        savings_of(BODIES, by_novice, pair="system1"),
        savings_of(REAL, real, 8.0, value="loss", held_out=HELD_OUT),
    ]
    return pd.concat(kinds, ignore_index=True)


def table(gaps: pd.DataFrame, saved: pd.DataFrame) -> pd.DataFrame:
    """Gap and saving of each pair that has both, the smallest gap first."""
    names = ["kind", "system", "pair", "method", "gap"]
    names += ["seeds", "ratio", "low", "high", "bound"]
    rows = saved.merge(gaps, on="pair").sort_values(["gap", "system", "method"])
    return rows[names].reset_index(drop=True)


def figure(table: pd.DataFrame) -> Figure:
    """The saving of each pair of robots as labelled dots, by the gap between them.

    No dot is drawn where the sizes that were run give no more than a bound.
    """
    titles = {method: panel for panel, method in PANELS.items()}
    headings = {kind: name for name, kinds in HEADINGS.items() for kind in kinds}
    place = {kind: number for number, kind in enumerate(HEADINGS)}
    table = table[table.bound == "="].sort_values("gap", kind="stable")
    dots = table.assign(
        panel=table.method.map(titles),
        row=[_row(row) for row in table.itertuples()],
        group=table.kind.map(headings),
        value=table.ratio,
    )
    dots = dots.sort_values("group", key=lambda names: names.map(place), kind="stable")
    ticks = 0.3, 1.0, 3.0, 10.0, 30.0, 100.0
    return dot_plot(dots, "data saved (times)", list(PANELS), ticks)


def _row(row: Any) -> str:
    """The name of a pair's row, with its gap."""
    pair = "system 1, family" if row.system == "family" else system_label(row.system)
    return f"{pair} (gap {row.gap:.1f})"
