"""The paper's claims (section 5) beside our figures; verdicts follow by the rule of the book's page on claims."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from sidm.experiments.engine.store import Row
from sidm.experiments.statistics.efficiency import greatest_ratio, known
from sidm.experiments.statistics.intervals import FEWEST_SEEDS, Interval, interval, mean_ratio
from sidm.experiments.statistics.tables import Losses, final_position_error, gather, html_table, markdown_table
from sidm.systems import SYSTEMS

REPRODUCED = "Reproduced"
DIRECTION = "In the same direction"
NOT_SEEN = "Not seen"
CONTRARY = "Contrary"
UNCLEAR = "Unclear in the paper"
BETTER, WORSE, NO_DIFFERENCE = "better", "worse", "no difference seen"
NO_VERDICT = "No verdict"  # not run, fewer than three seeds, or sizes from which no figure follows


class Claim(NamedTuple):
    """A line of the table of claims."""

    claim: str
    paper: str  # its figure
    ours: str  # with its interval
    verdict: str
    interval: Interval | None = None


def verdict(found: Interval, none: float, paper: float | None = None) -> str:
    """What an interval says about a claim that a value lies above `none`, and at `paper` if the paper has a figure.

    One that holds `none` as well as the paper's figure says nothing of either.
    """
    if not np.all(np.isfinite(found)):
        return NO_VERDICT
    if paper is not None and none < found.low <= paper <= found.high:
        return REPRODUCED
    if found.low > none:
        return DIRECTION
    return CONTRARY if found.high < none else NOT_SEEN


def _saving(rows: Sequence[Row], system: str, words: str, paper: float) -> Claim:
    """Claims 1 and 2: as good as with so many times the data."""
    claim = f"{system}: as good with SIDM as without it on {words} the data"
    return saving_claim(claim, words, gather(rows, system), paper)


def saving_claim(claim: str, words: str, losses: Losses, paper: float | None = None) -> Claim:
    """A claim that the first method needs less data than the second, in `words` and by the `paper`'s figure."""
    if not losses.values.size:
        return Claim(claim, words, "not run", NO_VERDICT)
    ratio, bound = greatest_ratio(losses.minutes, losses.values)
    if not np.isfinite(ratio):
        return Claim(claim, words, "cannot be told from these sizes", NO_VERDICT)
    ends = np.exp(interval(lambda pairs: known(*greatest_ratio(losses.minutes, pairs)), losses.values)[1:])
    found = Interval(ratio, *ends)
    brackets = f" [{found.low:.3g}, {found.high:.3g}]" if np.isfinite(ends).all() else ""
    ours = f"{'at least' if bound == '>=' else 'at best'} {ratio:.3g} x{brackets}"  # the greatest over the sizes
    return Claim(claim, words, *_judged(ours, found, losses, verdict(found, 1.0, paper)))


def difference(losses: Losses, size: int) -> Interval:
    """Mean of the second method's value minus the first's, at size number `size`, with its interval."""
    return interval(lambda pairs: (pairs[:, 1] - pairs[:, 0]).mean(), losses.values[:, :, size])


def meeting(losses: Losses) -> str:
    """From which size on the difference keeps to one side of zero, or about it: the last run of sizes, in words."""
    sides = []
    for size in range(len(losses.minutes)):
        sides.append(difference(losses, size).side(0))
    if set(sides) == {-1}:
        return "worse with SIDM at every size"
    start = max((size for size, side in enumerate(sides) if side != sides[-1]), default=-1) + 1
    here, end = f"from {losses.minutes[start]:g} min", f"by {losses.minutes[-1]:g} min"
    return {0: here, 1: f"not {end}", -1: f"crossed: worse with SIDM {here}"}[sides[-1]]


def by(found: Interval, above: str, below: str, unit: str = "") -> str:
    """A difference in words, as 'smaller by 0.1 m [0.05, 0.15]'; where it is below zero, the interval is turned."""
    if found.value >= 0:
        return f"{above} by {found.value:.3g}{unit} [{found.low:.3g}, {found.high:.3g}]"
    return f"{below} by {-found.value:.3g}{unit} [{-found.high:.3g}, {-found.low:.3g}]"


def _meeting(rows: Sequence[Row], system: str, paper: str) -> Claim:
    """Claim 3: where the curves meet."""
    claim, losses = f"{system}: the curves become comparable", gather(rows, system)
    if not losses.values.size:
        return Claim(claim, paper, "not run", UNCLEAR)
    if len(losses.values) < FEWEST_SEEDS:
        return Claim(claim, paper, "too few seeds", UNCLEAR)
    return Claim(claim, paper, *_judged(meeting(losses), None, losses, UNCLEAR))


def _pretraining(rows: Sequence[Row], system: str, minutes: float) -> Claim:
    """Claim 5: the expert's data alone cannot pretrain the SIDM (section 4)."""
    claim = f"{system}: expert first, then novice has a larger loss than SIDM, at {minutes:g} min"
    here = (row for row in rows if row.trial.novice_minutes == minutes)
    losses = gather(here, system, ("sidm", "pretrain_finetune"))
    if not losses.values.size:
        return Claim(claim, "'cannot be pretrained'", "not run", NO_VERDICT)
    found = difference(losses, 0)
    ours = by(found, "larger", "smaller")
    return Claim(claim, "'cannot be pretrained'", *_judged(ours, found, losses, verdict(found, 0.0)))


def _deviation(rows: Sequence[Row], minutes: float) -> Claim:
    """Claim 4: a smaller deviation over 25 steps."""
    claim = f"system1: less deviation after 2.5 s with SIDM, at {minutes:g} min"
    losses = gather((row for row in rows if row.trial.novice_minutes == minutes), "system1", value=final_position_error)
    if not losses.values.size:
        return Claim(claim, "less (Figure 4)", "not run", NO_VERDICT)
    found = difference(losses, 0)
    ours = by(found, "less", "more", " m")
    return Claim(claim, "less (Figure 4)", *_judged(ours, found, losses, verdict(found, 0.0)))


def difference_claim(claim: str, paper: str, pairs: np.ndarray, unit: str = "") -> Claim:
    """A claim that the first of paired values (S, 2) is the smaller: by how much, the mean over the pairs.

    Args:
        claim: in words.
        paper: what the paper says of it.
        pairs: values of the method and of its comparison, a seed or an episode a line.
        unit: of the values.
    """
    if not len(pairs):
        return Claim(claim, paper, "not run", NO_VERDICT)
    if len(pairs) < FEWEST_SEEDS:
        mean = float((pairs[:, 1] - pairs[:, 0]).mean())
        ours = by(Interval(mean, mean, mean), "smaller", "larger", unit).split(" [")[0]
        return Claim(claim, paper, f"{ours} ({len(pairs)} only)", NO_VERDICT)
    found = interval(lambda some: float((some[:, 1] - some[:, 0]).mean()), pairs)
    ours = by(found, "smaller", "larger", unit)
    return Claim(claim, paper, ours, verdict(found, 0.0), found)


def ratio_claim(claim: str, paper: str, own: np.ndarray, other: np.ndarray, what: str = "loss") -> Claim:
    """A claim that the first of paired values (S, M) are the smaller, M sizes together; its interval is of their ratio.

    Args:
        claim: in words.
        paper: what the paper says of it.
        own: values of the method, a seed a line.
        other: of its comparison.
        what: the values are.
    """
    if not own.size:
        return Claim(claim, paper, "not run", NO_VERDICT)
    ratio = mean_ratio(own, other)
    ours = f"{ratio.words(3)} times the {what}"
    if len(own) < FEWEST_SEEDS:
        return Claim(claim, paper, f"{ours} ({few(len(own))})", NO_VERDICT)
    gain = Interval(*-np.log(np.array([ratio.value, ratio.high, ratio.low])))
    return Claim(claim, paper, ours, verdict(gain, 0.0), ratio)


def few(seeds: int) -> str:
    """A number of seeds that is too small, in words."""
    return "one seed" if seeds == 1 else f"{seeds} seeds"


def _judged(ours: str, found: Interval | None, losses: Losses, said: str) -> tuple[str, str, Interval | None]:
    """The last columns of a claim; fewer than FEWEST_SEEDS make no interval and give no verdict."""
    seeds = len(losses.values)
    if seeds < FEWEST_SEEDS:
        return f"{ours.split(' [')[0]} ({few(seeds)})", said if said == UNCLEAR else NO_VERDICT, found
    return ours, said, found


def figure3_claims(rows: Sequence[Row], minutes: float = 5.0) -> list[Claim]:
    """Claims 1 to 3 and 5 beside what the `rows` of Figure 3 say; the last looks at one size, in minutes.

    Ratios and differences are of means over seeds, with 95 % intervals over whole seeds.
    """
    return [
        _saving(rows, "system1", "up to 20 x", 20),
        _saving(rows, "system2", "about 5 x", 5),
        _meeting(rows, "system1", "at about 2 h or 5 h"),
        _meeting(rows, "system2", "at about 2 h or 5 h"),
        *(_pretraining(rows, system, minutes) for system in SYSTEMS),
    ]


def figure4_claims(rows: Sequence[Row], sizes: Sequence[float] = (5.0, 120.0)) -> list[Claim]:
    """Claim 4 beside what the `rows` of Figure 4 say."""
    return [_deviation(rows, minutes) for minutes in sizes]


HEAD = ("Claim", "The paper's figure", "Ours [95 % interval]", "Verdict")


def markdown(claims: Iterable[Claim]) -> str:
    """The table of claims for a page."""
    return markdown_table(HEAD, (claim[:4] for claim in claims))


def tally(claims: Sequence[Claim]) -> str:
    """How many of some claims have which verdict, as a sentence."""
    counts = Counter(claim.verdict for claim in claims).most_common()
    said = ", ".join(f"{count} {verdict.lower()}" for verdict, count in counts)
    return f"Of {len(claims)} verdicts: {said}."


def html(claims: Iterable[Claim]) -> str:
    """The same in HTML, for a page that takes it over from another."""
    return html_table(HEAD, (claim[:4] for claim in claims))
