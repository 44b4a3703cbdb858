"""When does an SIDM pay? How far two robots' answers lie apart before any learning, beside what is saved then.

All that two robots need to have in common here is motion in the plane: what a robot
does within a second is looked up at the nearest moments of the other, by velocity, yaw
rate and command. The command is told as a twist, the speed and the yaw rate that it
leads to on average, so that a throttle and two wheels' speeds can be held against each
other.

Run as a module it measures anew and writes `results/payoff.json`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from concurrent.futures import Executor
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from scipy.spatial import cKDTree

from companion.engine.records import single
from companion.figures.style import SIZE_STYLES, legend_below
from companion.methods import CORES
from companion.numerics import versions
from companion.statistics.savings import savings
from companion.studies.overlap import NEIGHBOURS
from companion.studies.real_robots.measure import PAIRS, robot
from companion.studies.several_experts.family import collect_members, dataset
from companion.studies.several_experts.results import MEMBER as MEMBER_ALONE
from companion.study import Study
from companion.trials import EXPERT_SEED, POOL_SEED
from sidm.drives import QUATERNION, Drive, yaw_of
from sidm.learning.dataset import stacked
from sidm.plots import finish, side_by_side, styled
from sidm.pool import local_pool
from sidm.shards import Collection, load
from sidm.storage import write_record
from sidm.systems import FREE_SYSTEMS, SYSTEMS

#: steps of 0.1 s: of the answer, and over which a velocity is taken
AHEAD, BEFORE = 10, 4
TRAJECTORIES = 128  # of a simulated robot
POLICY = "ornstein_uhlenbeck"
MEMBER = 0  # of the family
ASKED_EVERY = 4  # pieces; the others answer
NAME = "payoff.json"

#: What the two plots show: methods that an SIDM trains, and what goes on from the
#: expert's weights.
PANELS = {
    "with an SIDM": ("sidm",),
    "by pretraining and fine-tuning": ("pretrain_finetune", "core_finetune"),
}
SAVING = tuple(method for methods in PANELS.values() for method in methods)


class Planar(NamedTuple):
    """Motion of a robot in the plane: N pieces at 10 Hz."""

    poses: np.ndarray  # (N, T + 1, 3) x and y, m, heading, rad
    yaw_rate: np.ndarray  # (N, T + 1) rad/s
    actions: np.ndarray  # (N, T, A)


class Moments(NamedTuple):
    """Moments of a robot's motion, and what followed within a second, in the robot's own frame."""

    #: (M, 5) forward and sideways velocity, yaw rate; speed and yaw rate of the command
    features: np.ndarray
    answers: np.ndarray  # (M, 3) m, m, rad
    pieces: np.ndarray  # (M,) number of the piece


def simulated(trajectories: list[Drive]) -> Planar:
    """Of the paper's robots."""
    states = np.stack([one.states for one in trajectories]).astype(float)
    yaw = yaw_of(states[..., QUATERNION])
    actions = np.stack([one.actions for one in trajectories]).astype(float)
    return Planar(
        np.concatenate([states[..., :2], yaw[..., None]], -1), states[..., 12], actions
    )


def recorded(name: str) -> Planar:
    """Of a real robot, or of someone else's simulator."""
    states, actions = (values.numpy() for values in stacked(robot(name)))
    return Planar(states[..., :3], states[..., 3], actions)


def moments(motion: Planar) -> Moments:
    """Every moment that has BEFORE steps before it and AHEAD after it."""
    poses = motion.poses.copy()
    poses[..., 2] = np.unwrap(poses[..., 2], axis=1)
    times = np.arange(BEFORE, poses.shape[1] - AHEAD)
    now, then, later = (poses[:, times + shift] for shift in (0, -BEFORE, AHEAD))
    velocity = -_seen_from(now, then)[..., :2] / BEFORE * 10
    # (N, M, A)
    held = np.stack([motion.actions[:, t : t + AHEAD].mean(1) for t in times], 1)
    answers = _seen_from(now, later)
    twist = _twist(held, answers)
    features = np.concatenate([velocity, motion.yaw_rate[:, times, None], twist], -1)
    pieces = np.broadcast_to(np.arange(len(poses))[:, None], features.shape[:2])
    return Moments(features.reshape(-1, 5), answers.reshape(-1, 3), pieces.reshape(-1))


def _seen_from(now: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Poses (..., 3) in the frame of others."""
    way, yaw = other - now, now[..., 2]
    forward = np.cos(yaw) * way[..., 0] + np.sin(yaw) * way[..., 1]
    left = np.cos(yaw) * way[..., 1] - np.sin(yaw) * way[..., 0]
    return np.stack([forward, left, way[..., 2]], -1)


def _twist(held: np.ndarray, answers: np.ndarray) -> np.ndarray:
    """Speed and yaw rate (..., 2) that commands (..., A) lead to on average, by least squares on their squares."""
    rows, columns = np.triu_indices(held.shape[-1])
    terms = np.concatenate(
        [np.ones_like(held[..., :1]), held, held[..., rows] * held[..., columns]], -1
    )
    flat, wanted = (
        terms.reshape(-1, terms.shape[-1]),
        answers[..., (0, 2)].reshape(-1, 2) * 10 / AHEAD,
    )
    return terms @ np.linalg.lstsq(flat, wanted, rcond=None)[0]


def gap(expert: Planar, novice: Planar) -> dict[str, float]:
    """The expert's nearest-neighbour answer beside the novice's own, each from as many moments.

    Returns:
        `displacement` m and `heading` rad, mean errors over a second, of the expert's
        answer, `own_displacement` and `own_heading` of the novice's.
    """
    theirs, mine = moments(expert), moments(novice)
    asking = mine.pieces % ASKED_EVERY == 0
    own = Moments(*(part[~asking] for part in mine))
    count = min(len(own.features), len(theirs.features))
    spread = own.features.std(0)
    found = {}
    for prefix, some in (("", theirs), ("own_", own)):
        chosen = np.linspace(0, len(some.features) - 1, count).round().astype(int)
        _, near = cKDTree(some.features[chosen] / spread).query(
            mine.features[asking] / spread, k=NEIGHBOURS
        )
        off = some.answers[chosen][near].mean(1) - mine.answers[asking]
        found[f"{prefix}displacement"] = float(
            np.linalg.norm(off[:, :2], axis=1).mean()
        )
        found[f"{prefix}heading"] = float(np.abs(off[:, 2]).mean())
    return found


def motions(data: Path, executor: Executor) -> Iterator[tuple[str, Planar, Planar]]:
    """Each pair by its name, with its expert's and its novice's motion, simulated where it is missing."""
    from sidm.simulation import collect

    def of(system: str, role: str) -> Planar:
        seed = EXPERT_SEED if role == "expert" else POOL_SEED
        collection = Collection(system=system, role=role, policy=POLICY, seed=seed)
        return simulated(collect(data, collection, TRAJECTORIES, executor=executor))

    def family(system: str) -> Planar:
        collect_members(
            system, POLICY, {MEMBER: [TRAJECTORIES]}, data, data / "payoff", executor
        )
        return simulated(
            load(
                data,
                dataset(system, MEMBER, POLICY, TRAJECTORIES).collection,
                TRAJECTORIES,
            )
        )

    for system in (*SYSTEMS, *FREE_SYSTEMS):
        yield system, of(system, "expert"), of(system, "novice")
    yield "family", family("system1"), of("system1", "novice")
    for pair, (expert, novice) in PAIRS.items():
        yield pair, recorded(expert), recorded(novice)


def measure(data: Path, results: Path, executor: Executor) -> None:
    """Measure the gap of every pair and store it."""
    found = {
        pair: {
            name: float(f"{value:.5g}") for name, value in gap(expert, novice).items()
        }
        for pair, expert, novice in motions(data, executor)
    }
    write_record(results / NAME, {"found": found, "numerics": versions("free_struts")})


def gaps(results: Path | str = "results") -> pd.DataFrame:
    """A line a `pair`: errors as of `gap`, the expert's by the novice's own (`displacement_ratio`, `heading_ratio`).

    `gap` is their geometric mean: 1 where the expert answers as well as the novice
    itself.
    """
    found = single(Path(results) / NAME).get("found", {})
    names = ["displacement", "heading", "own_displacement", "own_heading"]
    table = (
        pd.DataFrame.from_dict(found, orient="index", columns=names)
        .rename_axis("pair")
        .reset_index()
    )
    for name in names[:2]:
        table[f"{name}_ratio"] = table[name] / table[f"own_{name}"]
    return table.assign(gap=np.sqrt(table.displacement_ratio * table.heading_ratio))


class Group(NamedTuple):
    """Results of pairs that are learnt alike."""

    frame: pd.DataFrame  # as of Figure 3, a system each
    #: of the novice's data that is nearest to a minute, in the frame's `novice_minutes`
    size: float
    value: str = "validation_loss"
    pair: str = ""  # whose gap is all these systems'; their own unless given
    #: share of the same data that each seed judges on, where seeds only split them anew
    held_out: float = 0.0


def saved(groups: Mapping[str, Group]) -> pd.DataFrame:
    """How many times a method's data training without SIDM needs, with about a minute of the novice's motion.

    A line a `kind` of pairs, `system` and method that is there: `pair`, whose gap it
    goes with, and what `savings` has.
    """
    parts = []
    for kind, (frame, size, value, pair, held_out) in groups.items():
        methods = [name for name in SAVING if name in set(frame.method)]
        found = savings(frame, methods, ("novice_only",), value, held_out)
        found = found[found.novice_minutes == size]
        parts.append(found.assign(kind=kind, pair=pair or found.system))
    return pd.concat(parts, ignore_index=True)


def family_of(frame: pd.DataFrame, table: pd.DataFrame) -> pd.DataFrame:
    """Fine-tuning after one expert of the family, as results of Figure 3 beside training without SIDM.

    Args:
        frame: of Figure 3.
        table: of several experts.
    """
    mine = table[(table.experts == MEMBER_ALONE) & (table.way == "all")]
    tuned = mine.rename(columns={"loss": "validation_loss"}).assign(
        method="pretrain_finetune"
    )
    alone = frame[(frame.method == "novice_only") & frame.system.isin(mine.system)]
    columns = ["system", "method", "seed", "novice_minutes", "validation_loss"]
    return pd.concat([tuned[columns], alone[columns]], ignore_index=True).assign(
        system="family"
    )


def table(gaps: pd.DataFrame, saved: pd.DataFrame) -> pd.DataFrame:
    """Both beside each other, the smallest gap first; pairs whose gap or saving is not known are left out."""
    names = [
        "kind",
        "system",
        "pair",
        "method",
        "gap",
        "seeds",
        "ratio",
        "low",
        "high",
        "bound",
    ]
    return (
        saved.merge(gaps, on="pair")
        .sort_values(["gap", "system", "method"])[names]
        .reset_index(drop=True)
    )


@styled
def figure(table: pd.DataFrame) -> Figure:
    """What is saved against the gap: with an SIDM, and from the expert's weights, all of them or the core's alone.

    Where sizes that were run give no more than a bound, no point is drawn.
    """
    figure, panels = side_by_side(2)
    table = table[table.bound == "="]
    kinds = list(dict.fromkeys(table.kind))
    for axes, (title, methods) in zip(panels, PANELS.items(), strict=True):
        axes.set(
            xscale="log",
            yscale="log",
            xlabel="gap between the robots before learning (1: none)",
            title=title,
        )
        axes.set_ylabel("data without it / with it, same loss")
        for (kind, method), mine in table[table.method.isin(methods)].groupby(
            ["kind", "method"], sort=False
        ):
            low, high = mine.low.fillna(mine.ratio), mine.high.fillna(mine.ratio)
            off = np.clip([mine.ratio - low, high - mine.ratio], 0, None)
            # of the same pair, its points stand side by side
            beside = mine.groupby("gap").cumcount()
            style = SIZE_STYLES[kinds.index(kind)] | {"linestyle": "", "label": kind}
            core = {
                "label": f"{kind}, recurrent core alone",
                "markerfacecolor": "white",
            }
            style |= core if method in CORES else {}
            axes.errorbar(
                mine.gap * 1.025**beside,
                mine.ratio,
                yerr=off,
                capsize=2,
                elinewidth=1,
                **style,
            )
        axes.axhline(1, color="0.5", lw=1, linestyle="-", marker="", zorder=0)
    for axes in panels:
        axes.set_ylim(
            min(one.get_ylim()[0] for one in panels),
            max(one.get_ylim()[1] for one in panels),
        )
        finish(axes, (1, 1.5, 2, 3, 5), legend=False)
    legend_below(figure, panels)
    return figure


def make(study: Study, workers: int) -> None:
    """`companion run --figure payoff`."""
    with local_pool(workers) as pool:
        measure(study.data, study.results, pool)
