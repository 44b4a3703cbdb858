"""What was found about the SIDM, in short: sentences around measured numbers, which follow by rule."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from sidm.experiments.overlap import NEIGHBOURS, Neighbourhood
from sidm.experiments.suspects import (
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

if TYPE_CHECKING:  # scikit-learn need not be there to tell what it found
    from sidm.experiments.diagnostics import Diagnosis

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
            f"{count} of `python -m sidm run --preset {preset} --figure {figure}`"
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
    ratios = [one.ratio.value for one in found]
    least, greatest = (f"{one:.3g}" for one in (min(ratios), max(ratios)))
    span = f"the loss {least}" if least == greatest else f"losses {least} to {greatest}"
    changes, comparisons = len({one.instead for one in found}), len(found)
    return (
        f"{changes} change{'s' * (changes > 1)} in {comparisons} comparison{'s' * (comparisons > 1)}: {words}; "
        f"{span} times SIDM's"
    )


def summary(found: Sequence[Finding], missing: Mapping[str, Mapping[str, int]]) -> str:
    """Which suspects some change of theirs convicts, and which none does, as a paragraph.

    Args:
        found: what changes of SIDM did.
        missing: how many trials of which figures are missing, by suspect; such a suspect is not cleared.
    """
    changes = [one for one in found if one.instead not in CROSSED.values()]
    told = {suspect: [one for one in changes if one.suspect == suspect] for suspect in ORDER}
    judged = {suspect: [one for one in mine if one.verdict != NO_VERDICT] for suspect, mine in told.items()}
    better = [suspect for suspect, mine in judged.items() if any(one.verdict == BETTER for one in mine)]
    whole = [suspect for suspect in ORDER if len(judged[suspect]) == len(told[suspect]) and not missing.get(suspect)]
    cleared = [suspect for suspect in whole if judged[suspect] and suspect not in better]
    open_ = [suspect for suspect in ORDER if suspect not in (*better, *cleared)]
    lowered = "A change lowered the loss in at least one comparison under"
    parts = [(lowered, better), ("none did under", cleared), ("not settled:", open_)]
    return "; ".join(f"{words} {_listed(some)}" for words, some in parts if some) + "."


def _listed(names: Sequence[str]) -> str:
    return ", ".join(f"*{name}*" for name in names)


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
    alone = [one for one in found if one.instead in (CROSSED["expert_encoder_loss"], CROSSED["expert_decoder_loss"])]
    both = [one for one in found if one.instead == CROSSED["expert_path_loss"]]
    if not alone:
        return "Whether the expert's parts can stand in for the novice's is not measured"
    lost, kept = (sum(one.verdict == WORSE for one in some) for some in (alone, both))
    ratio = min(one.ratio.value for one in alone)
    two = "two models in one rather than one that both share" if 2 * lost > len(alone) else "one model that both share"
    return (
        f"The SIDM holds {two}: the novice's motion through the expert's encoder or decoder alone does worse than "
        f"through its own in {lost} of {len(alone)} comparisons (at least {ratio:.2g} times the loss in all), through "
        f"both of them in {kept} of {len(both)}"
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
