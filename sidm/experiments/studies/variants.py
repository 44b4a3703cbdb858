"""What might need less novice data than the paper's method and its strongest neighbour."""

from __future__ import annotations

from sidm.experiments.methods import MIRRORED, VARIANTS
from sidm.experiments.study import Study
from sidm.experiments.trials import Trial

BEATEN = ("sidm", "pretrain_finetune")  # what a variant is to beat


def trials(study: Study, system: str) -> list[Trial]:
    """The variants on small datasets, beside the methods that they are to beat; those on Figure 3's too."""
    found = study.points(system, (*BEATEN, *VARIANTS, "least_squares", *MIRRORED), study.preset.variant_minutes)
    found += study.points(system, BEATEN, study.preset.novice_minutes(system))
    return list({trial.key: trial for trial in found}.values())


def correction(study: Study, system: str) -> list[Trial]:
    """Of these, least squares on the expert's model, what it is made of, and what it is to beat."""
    parts = ("mirrored", "corrected", "corrected_mirrored", "corrected_averaged")
    kept = (*BEATEN, "least_squares", "least_squares_mirrored", *parts)
    return [trial for trial in trials(study, system) if trial.method in kept]
