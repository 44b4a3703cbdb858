"""The adversary made stronger: what becomes of the latents and of the loss.

`companion run --figure adversary` makes the adversary stronger in two ways: with more
and more iterations of the discriminator and of the matching in each phase (Algorithm
2), and with a growing weight of the reversed gradient (Ganin and Lempitsky, 2015),
which moves both encoders in every prediction step. It measures the latents as the study
of the latent space does. All trainings have SAMPLES samples; all else is as in
Figure 3, on motion of the decisive experiment.
"""

from __future__ import annotations

from companion.engine.records import records_of
from companion.studies.decisive.recipes import on_fresh_motion, without_early_stopping
from companion.studies.latent_space.measure import Diagnosis, measure, motion
from companion.study import Study
from companion.trials import Trial

__all__ = ["jobs", "measure", "motion", "records"]

MINUTES = 5.0  # of novice data
SAMPLES = 500_000  # half the cap of Figure 3; the strongest take five times as long
SEEDS = range(3)
#: Iterations of the discriminator and of the matching in each phase, after 100
#: prediction iterations; the paper has 20 of the matching.
PHASES = ((20, 20), (20, 100), (100, 100), (20, 500))
#: Weights of the discriminator's loss in the encoders' gradient; 0.1 is the default,
#: which the chapter on rivals has.
REVERSAL_WEIGHTS = (0.01, 0.1, 1.0, 10.0)

#: the stored results, under a folder of results
records = records_of(Diagnosis, "adversary")


def jobs(study: Study, system: str) -> list[Trial]:
    """The trials whose latents are measured, seed by seed."""
    fresh = on_fresh_motion(study).changed(**without_early_stopping(SAMPLES))
    variants = [("no_regularisation", fresh)]
    for discriminator, matching in PHASES:
        phases = {"discriminator_iterations": discriminator}
        phases |= {"matching_iterations": matching}
        variants.append(("sidm", fresh.changed(**phases)))
    for weight in REVERSAL_WEIGHTS:
        variants.append(("gradient_reversal", fresh.changed(reversal_weight=weight)))
    return [
        variant.trial(system, method, MINUTES, seed)
        for seed in SEEDS
        for method, variant in variants
    ]
