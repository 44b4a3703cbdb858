"""What came out of a chapter's trials, in short: sentences around measured numbers, which follow by rule."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from sidm.experiments.engine.store import Row
from sidm.experiments.figures.style import METHOD_STYLES
from sidm.experiments.statistics.claims import NOT_SEEN, Claim
from sidm.experiments.statistics.intervals import FEWEST_SEEDS
from sidm.experiments.statistics.savings import expert_first
from sidm.experiments.statistics.tables import final_position_error
from sidm.experiments.studies.ablations import ablation_lines
from sidm.experiments.studies.baselines import Neighbour
from sidm.experiments.studies.choices import Worth

NOTHING = "Nothing is stored yet.\n"
BETTER, WORSE, NO_DIFFERENCE = "better than with SIDM", "worse", "no difference seen"


def figure3_summary(claims: Sequence[Claim], rows: Sequence[Row], systems: Sequence[str]) -> list[str]:
    """What an SIDM saves, where it no longer does, and what the expert first does, a sentence a system.

    Args:
        claims: of `figure3_claims`.
        rows: of Figure 3.
        systems: which.
    """
    said = []
    for system in systems:
        saved, met, *_ = (one for one in claims if one.claim.startswith(f"{system}:"))
        if not saved.interval:
            said.append(f"{system}: {saved.ours}")
            continue
        or_none = ", which leaves room for none at all" if saved.verdict == NOT_SEEN else ""
        said.append(
            f"{system}: with SIDM as good as without it on {saved.ours} the data{or_none} (the paper: {saved.paper}); "
            f"the two curves {_meeting(met.ours)}; expert first, then novice: {expert_first(rows, system)}"
        )
    return said


def _meeting(ours: str) -> str:
    """Where two curves meet, as the end of a sentence about them."""
    if ours.startswith("too few"):
        return f"have {ours}"
    if ours.startswith(("crossed", "worse")):
        return ours
    return f"are {'not ' * ours.startswith('not ')}comparable {ours.removeprefix('not ')}"


def ablation_summary(rows: Sequence[Row], name: str, usual: Mapping[str, float], by_method: bool = False) -> str:
    """A list in Markdown, a line of the figure's: where the mean loss is lowest, highest, and at Figure 3's value.

    Args:
        rows: of the ablation of `name`.
        name: of the value, as `ablated` takes it.
        usual: each system's value in Figure 3.
        by_method: as for the figure.
    """
    said = []
    for (system, minutes, method), found in sorted(ablation_lines(rows, name, by_method).items()):
        means = {value: float(np.mean(losses)) for value, losses in found.items()}
        places = {"lowest at": min(means, key=means.__getitem__), "highest at": max(means, key=means.__getitem__)}
        places |= {"at Figure 3's": usual[system]} if usual[system] in means else {}
        words = []
        for place, value in places.items():
            single = ", one trial" if len(found[value]) == 1 else ""
            words.append(f"{place} {_plain(value)} ({means[value]:.3f}{single})")
        line = f"{system}, {minutes:g} min" + (f", {METHOD_STYLES[method]['label']}" if method else "")
        said.append(f"- {line}: {', '.join(words) if len(means) > 1 else f'{_plain(*means)} alone is stored'}\n")
    return "".join(said) or NOTHING


def _plain(value: float) -> str:
    return f"{value:,.0f}" if value >= 1 else f"{value:.2g}"


def neighbours_summary(found: Sequence[Neighbour]) -> str:
    """A list in Markdown, a line a system and size: which methods do better or worse than SIDM, by their intervals."""
    lines: dict[tuple[str, float], dict[str, list[str]]] = {}
    for one in found:
        apart = one.differences[0]
        if apart is not None and one.seeds >= FEWEST_SEEDS:
            side = {-1: BETTER, 0: NO_DIFFERENCE, 1: WORSE}[apart.side(0)]
            sides = lines.setdefault((one.system, one.minutes), {BETTER: [], WORSE: [], NO_DIFFERENCE: []})
            sides[side].append(f"*{METHOD_STYLES[one.method]['label']}* ({one.loss:.3f})")
    said = ""
    for (system, minutes), sides in sorted(lines.items()):
        words = "; ".join(f"{side}: {', '.join(methods)}" for side, methods in sides.items() if methods)
        said += f"- {system}, {minutes:g} min: {words}\n"
    return said or NOTHING


def choices_summary(found: Sequence[Worth]) -> str:
    """Which choices do better or worse changed, by their intervals, in a paragraph."""
    judged = [one for one in found if one.seeds >= FEWEST_SEEDS]
    groups = {
        "Changed, the loss is smaller for": [one for one in judged if one.ratio.side(1) < 0],
        "Changed, the loss is larger for": [one for one in judged if one.ratio.side(1) > 0],
    }
    said = [
        f"{words} " + ", ".join(f"*{one.choice}* ({one.system}, {METHOD_STYLES[one.method]['label']})" for one in some)
        for words, some in groups.items()
        if some
    ]
    if not judged:
        return f"No comparison has {FEWEST_SEEDS} seeds yet."
    rest = len(judged) - sum(map(len, groups.values()))
    return ". ".join([*said, f"{rest} of {len(judged)} comparisons show no difference"]) + "."


def together_summary(found: Sequence[Worth]) -> str:
    """A list in Markdown, a line a choice, system and method: at which sizes the loss is smaller or larger changed."""
    lines: dict[tuple[str, str, str], dict[str, list[str]]] = {}
    for one in found:
        sides = lines.setdefault((one.choice, one.system, one.method), {})
        sides.setdefault(_side(one), []).append(f"{one.minutes:g}")
    said = ""
    for (choice, system, method), sides in lines.items():
        words = "; ".join(f"{side} at {', '.join(sizes)} min" for side, sizes in sides.items())
        said += f"- *{choice}*, {system}, {METHOD_STYLES[method]['label']}: {words}\n"
    return said or NOTHING


def _side(one: Worth) -> str:
    if one.seeds < FEWEST_SEEDS:
        return f"fewer than {FEWEST_SEEDS} seeds"
    return {-1: "a smaller loss", 0: NO_DIFFERENCE, 1: "a larger loss"}[one.ratio.side(1)]


def example_summary(rows: Sequence[Row], seed: int) -> str:
    """How the example of Figure 4, with the models of `seed`, compares with all test trajectories, in a sentence."""
    shown = [row.outcome for row in rows if row.trial.seed == seed]
    if not shown:
        return "The trials of this seed are not stored."
    actual = np.array(shown[0].example_actual)
    driven = np.linalg.norm(np.diff(actual, axis=0), axis=1).sum()
    parted = [float(np.linalg.norm(one.example_predicted[-1] - actual[-1])) for one in shown]
    mean = np.mean([final_position_error(row) for row in rows])
    easy = ", so the example is an easy one" if max(parted) < mean / 2 else ""
    return (
        f"In the example the robot drives {driven:.2g} m, and the predicted paths end {min(parted):.2g} to "
        f"{max(parted):.2g} m from where it comes to. Over all test trajectories and trials that distance is "
        f"{mean:.2g} m in the mean{easy}."
    )
