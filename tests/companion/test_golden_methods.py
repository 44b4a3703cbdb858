"""Six iterations of what truly differs give the figures of today's versions.

Methods that share their code have one example.

The weights decay a hundred thousand times faster than in a study, so that a change of
the decay shows in so few iterations.
"""

import math

import pytest

from companion import METHODS, Study, load_preset, run, run_trial
from companion.methods import FIGURE3
from tests.companion.conftest import TINY

#: Adam divides by the size of a gradient, so that rounding changes whole steps where a
#: gradient is nearly zero: on smaller instruction sets losses after six iterations
#: differ by up to 0.0007 of their value, rollouts by 0.003.
TOLERANCE = dict(rel=0.005, abs=0.002)
SHORT = dict(
    max_samples=3072, prediction_iterations=2, test_interval=2, weight_decay=1.0
)

HELD = (
    "sidm",
    "novice_only",
    "strong_matching",  # so strong that a wrong sign shows
    "mmd",
    "gradient_reversal",
    "pooled_flag",
    "adapters",
    "tethered",
    "residual",
    "corrected_averaged",  # pretraining, mirrored, averaged; least squares of the rest
    "core_frozen",
    "least_squares",
)
#: settings that no method has; each changes the method 'sidm'
CHOICES = {
    "as released": dict(
        initialisation="pytorch",
        reduction="mean",
        decay="l2",
        system_draw="iteration",
        matching_optimiser="shared",
        stopping="released",
    ),
    "stopped by its test loss": dict(
        learning_rate=0.02, test_interval=1, smoothing=0.0, patience=512
    ),
}


@pytest.fixture(scope="module")
def trial():
    """Function that makes a trial of system 1, with changes of the preset by name."""
    preset = load_preset("smoke", **(TINY | SHORT))
    return lambda method, **changes: Study(preset.replace(**changes)).trial(
        "system1", method, 0.75
    )


def figures(outcome) -> dict:
    return {
        "validation_loss": outcome.validation_loss,
        "component_losses": outcome.component_losses,
        "best_test_loss": outcome.best_test_loss,
        # the fifth step: later steps amplify rounding
        "rollouts": (outcome.position_error[4], outcome.heading_error[4]),
        "samples": (outcome.samples, outcome.pretraining_samples),
    }


@pytest.mark.parametrize("method", HELD)
def test_a_method_comes_to_its_figures(trial, data, golden, method):
    """The trial runs from its data to its outcome, with rollouts."""
    one = trial(method)
    outcome = run_trial(one, data).outcome
    assert math.isfinite(outcome.validation_loss) and len(outcome.position_error) == 25
    assert (outcome.pretraining_samples > 0) == METHODS[method].pretrained
    assert (outcome.iterations == 0) == one.solved
    golden.hold(
        method,
        "least_squares" if one.solved else "training",
        figures(outcome),
        **TOLERANCE,
    )


@pytest.mark.parametrize("choice", CHOICES)
def test_a_choice_comes_to_its_figures(trial, data, golden, choice):
    outcome = run_trial(trial("sidm", **CHOICES[choice]), data).outcome
    assert (outcome.samples < SHORT["max_samples"]) == choice.startswith("stopped")
    golden.hold(choice, "training", figures(outcome), **TOLERANCE)


@pytest.mark.parametrize("method", FIGURE3)
def test_a_bundle_comes_to_its_figures(trial, data, golden, tmp_path, method):
    one = trial(method)
    (row,) = run([one], data=data, results=tmp_path, progress=False, bundle=1).stored(
        [one]
    )
    golden.hold(f"{method} in a bundle", "bundle", figures(row.outcome), **TOLERANCE)
