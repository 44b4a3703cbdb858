"""What was found about the SIDM, in short: sentences around measured numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from sidm.experiments.methods import BOTH_OF_SIDM, ONE_OPTIMISER, ONE_SYSTEM, PATIENCE, PYTORCH_WEIGHTS
from sidm.experiments.overlap import NEIGHBOURS, Neighbourhood
from sidm.experiments.suspects import CROSSED, REPLACED, Suspect

if TYPE_CHECKING:  # scikit-learn need not be there to tell what it found
    from sidm.experiments.diagnostics import Diagnosis

NEARLY_ALL = 0.95  # of the latents told apart

#: The choices that are told.
TOLD = (PYTORCH_WEIGHTS, PATIENCE, ONE_SYSTEM, ONE_OPTIMISER, BOTH_OF_SIDM)


def in_short(
    suspects: Sequence[Suspect],
    diagnoses: Sequence[Diagnosis],
    overlap: Mapping[str, Mapping[str, Neighbourhood]],
) -> str:
    """A list in Markdown; 'not run' or 'not measured' stands where results are missing.

    Args:
        suspects: what was changed of SIDM, and what that did.
        diagnoses: of SIDM's models.
        overlap: neighbourhoods by system and robot.
    """

    def ratios(instead: str) -> str:
        mine = (one for one in suspects if one.instead == instead)
        return "; ".join(f"{o.system}, {o.minutes:g} min: {o.ratio.words(3)}" for o in mine) or "not run"

    told = sum((one.discriminator_accuracy or 0) >= NEARLY_ALL for one in diagnoses)
    return "\n".join([
        f"- **How alike the two robots are.** {_overlap(overlap)}.",
        f"- **Whether the adversary makes their latents alike.** The training's own discriminator tells at least "
        f"{NEARLY_ALL:.0%} of the latents apart in {told} of {len(diagnoses)} models.",
        f"- **Whether their parts can stand in for each other.** {CROSSED['expert_encoder_loss'].capitalize()}: "
        f"{ratios(CROSSED['expert_encoder_loss'])}. {CROSSED['expert_path_loss'].capitalize()}: "
        f"{ratios(CROSSED['expert_path_loss'])}.",
        f"- **What one common model does.** {REPLACED['pretrain_finetune'].capitalize()}: "
        f"{ratios(REPLACED['pretrain_finetune'])}.",
        "- **What our choices do.** " + ". ".join(
            f"{name[0].upper()}{name[1:]}: {ratios(name)}" for name in TOLD) + ".",
    ]) + "\n"  # fmt: skip


def _overlap(overlap: Mapping[str, Mapping[str, Neighbourhood]]) -> str:
    """What neighbours say, a system after the other."""
    return "; ".join(
        f"{system}: {both['expert'].uncovered:.1%} of the novice's steps lie where the expert has not been, 5 % being "
        f"chance, and {NEIGHBOURS} neighbours of the expert's predict with a loss of {both['expert'].loss:.3f}, "
        f"of the novice's own with {both['novice'].loss:.3f}"
        for system, both in overlap.items()
    ) or "Not measured"
