"""What was found about the SIDM, in short: sentences around measured numbers, which follow by rule."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from sidm.experiments.studies.hypotheses import (
    ADVERSARY,
    ALIKE,
    APART,
    BATCHES,
    BETTER,
    CROSSED,
    FIRST_LAYER,
    NO_VERDICT,
    OPTIMISER,
    OTHERS,
    P_EXPERT,
    PHASES,
    RELEASED_TWO,
    STOPPING,
    TOGETHER,
    WORSE,
    Finding,
)
from sidm.experiments.studies.overlap import NEIGHBOURS, Neighbourhood

if TYPE_CHECKING:  # scikit-learn need not be there to tell what it found
    from sidm.experiments.studies.latent_space.diagnosis import Diagnosis

NEARLY_ALL = 0.95  # of the latents told apart

#: The suspects in the order in which they are told.
ORDER = (
    ALIKE, TOGETHER, ADVERSARY, APART, PHASES, P_EXPERT, STOPPING, FIRST_LAYER, OPTIMISER, BATCHES, RELEASED_TWO, OTHERS
)  # fmt: skip


def in_short(
    found: Sequence[Finding],
    missing: Mapping[str, Mapping[str, int]],
    diagnoses: Sequence[Diagnosis],
    overlap: Mapping[str, Mapping[str, Neighbourhood]],
    preset: str = "laptop",
) -> str:
    """A list in Markdown, a line a suspect: what was measured, what that says, and what is missing.

    Args:
        found: what changes of SIDM did.
        missing: how many trials of which figures are missing, by suspect.
        diagnoses: of SIDM's models.
        overlap: neighbourhoods by system and robot.
        preset: whose trials, for the commands that run what is missing.
    """
    more = {ALIKE: _overlap(overlap), ADVERSARY: told_apart(diagnoses), APART: two_in_one(found)}
    lines = []
    for suspect in ORDER:
        mine = [one for one in found if one.suspect == suspect and one.instead not in CROSSED.values()]
        left = ", ".join(
            f"{count} of `sidm run --preset {preset} --figure {figure}`"
            for figure, count in missing.get(suspect, {}).items()
        )
        said = [more.get(suspect, ""), tally(mine), f"Trials not run: {left}" if left else ""]
        lines.append(f"- **{suspect[0].upper()}{suspect[1:]}.** " + " ".join(f"{one}." for one in said if one))
    return "\n".join(lines) + "\n"


def tally(found: Sequence[Finding]) -> str:
    """How many comparisons say what, and the least and the greatest ratio among them."""
    if not found:
        return "No change of it is measured"
    counts = Counter(one.verdict for one in found).most_common()
    few = {NO_VERDICT: " (fewer than three seeds)"}
    words = ", ".join(f"{verdict.lower()} in {count}{few.get(verdict, '')}" for verdict, count in counts)
    changes, comparisons = len({one.instead for one in found}), len(found)
    return (
        f"{changes} change{'s' * (changes > 1)} in {comparisons} comparison{'s' * (comparisons > 1)}: {words}; "
        f"{_times(found)} SIDM's loss"
    )


def summary(found: Sequence[Finding]) -> str:
    """Which changes lowered the loss always, sometimes and never, the greatest first, as a list in Markdown."""
    judged: dict[str, list[Finding]] = {}
    for one in found:
        if one.instead not in CROSSED.values() and one.verdict != NO_VERDICT:
            judged.setdefault(one.instead, []).append(one)
    sides: dict[str, list[str]] = {"always": [], "sometimes": [], "worse": [], "never": []}
    for instead, mine in sorted(judged.items(), key=lambda one: min(line.ratio.value for line in one[1])):
        better = sum(one.verdict == BETTER for one in mine)
        worse = any(one.verdict == WORSE for one in mine)
        side = "always" if better == len(mine) else "sometimes" if better else "worse" if worse else "never"
        sides[side].append(f"*{instead}* ({better} of {len(mine)}, {_times(mine)})")
    words = {
        "always": "A lower loss than SIDM's in every comparison",
        "sometimes": "In some",
        "worse": "In none, and a higher one in some",
        "never": "No difference seen",
    }
    said = "".join(f"- {words[side]}: {', '.join(names)}\n" for side, names in sides.items() if names)
    return said or "No change is measured.\n"


def _times(found: Sequence[Finding]) -> str:
    """The ratios' span, as '0.62 to 0.79 times'."""
    ratios = [one.ratio.value for one in found]
    least, greatest = (f"{one:.2g}" for one in (min(ratios), max(ratios)))
    return f"{least} times" if least == greatest else f"{least} to {greatest} times"


def told_apart(diagnoses: Sequence[Diagnosis]) -> str:
    """Whether the adversary makes the latents alike."""
    if not diagnoses:
        return "Whether it makes the latents alike is not measured"
    told = sum((one.discriminator_accuracy or 0) >= NEARLY_ALL for one in diagnoses)
    does = "does not make" if 2 * told > len(diagnoses) else "seems to make"
    return (
        f"The adversary {does} the latents alike: the training's own discriminator tells at least {NEARLY_ALL:.0%} of "
        f"them apart in {told} of {len(diagnoses)} models"
    )


def two_in_one(found: Sequence[Finding]) -> str:
    """Whether the expert's parts can stand in for the novice's, alone and together."""
    told = [one for one in found if one.verdict != NO_VERDICT]
    alone = [one for one in told if one.instead in (CROSSED["expert_encoder_loss"], CROSSED["expert_decoder_loss"])]
    both = [one for one in told if one.instead == CROSSED["expert_path_loss"]]
    if not alone:
        return "Whether the expert's parts can stand in for the novice's is not measured with enough seeds"
    lost, kept = (sum(one.verdict == WORSE for one in some) for some in (alone, both))
    two = "two models" if 2 * lost > len(alone) else "one model that both robots share"
    return (
        f"The SIDM behaves like {two}: with the expert's encoder alone or its decoder alone in place of the novice's, "
        f"the loss on the novice's motion is {_times(alone)} as large, larger by the whole interval in {lost} of "
        f"{len(alone)} comparisons; with both exchanged, it is so in {kept} of {len(both)}"
    )


def _overlap(overlap: Mapping[str, Mapping[str, Neighbourhood]]) -> str:
    """What neighbours say, a system after the other."""
    said = "; ".join(
        f"{system}: {both['expert'].uncovered:.1%} of the novice's steps lie where the expert has not been, 5 % being "
        f"chance, and {NEIGHBOURS} neighbours of the expert's predict with a loss of {both['expert'].loss:.3f}, "
        f"of the novice's own with {both['novice'].loss:.3f}"
        for system, both in overlap.items()
    )
    return said or "How alike is not measured"
