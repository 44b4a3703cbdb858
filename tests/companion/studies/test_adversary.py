"""The adversary's strength: its trainings, its table and its figure."""

import dataclasses

import pandas as pd
import pytest

from companion import Study
from companion.studies.adversary import measure, results
from companion.studies.adversary.measure import NONE, PAPER, STRENGTHS
from companion.studies.latent_space.measure import records


def test_trainings_differ_in_the_adversary_alone(tmp_path):
    jobs = measure.jobs(Study("study", tmp_path, tmp_path), "system1")
    variants = len(STRENGTHS) + len(measure.REVERSAL_WEIGHTS)
    assert len({job.key for job in jobs}) == variants * len(measure.SEEDS)
    settings = [job.training for job in jobs if job.training.regularise]
    iterations = ("discriminator_iterations", "matching_iterations")
    assert {
        tuple(getattr(s, name) for name in iterations)
        for s in settings
        if s.matching == "adversary"
    } == {tuple(strength) for strength in STRENGTHS if strength != NONE}
    assert {s.reversal_weight for s in settings if s.matching == "reversal"} == {
        *measure.REVERSAL_WEIGHTS
    }
    same = dict.fromkeys(iterations, 1) | {"matching": "mmd", "reversal_weight": 1.0}
    assert len({dataclasses.replace(s, **same) for s in settings}) == 1


def test_the_table_goes_from_the_weakest_to_the_strongest():
    """The figure has the table's points; each way begins without matching."""
    variants = [
        (strength != NONE, "adversary", strength, 0.1) for strength in STRENGTHS
    ] + [(True, "reversal", PAPER, weight) for weight in measure.REVERSAL_WEIGHTS]
    rows = [
        {
            "system": "system1",
            "seed": seed,
            "training_regularise": regularise,
            "training_matching": matching,
            "training_reversal_weight": weight,
            "training_discriminator_iterations": strength.discriminator or 20,
            "training_matching_iterations": strength.matching or 20,
            "validation_loss": 0.2 + 0.1 * place + 0.01 * seed,
            "discriminator_accuracy": 1 - 0.1 * place if regularise else None,
            "network_accuracy": 1 - 0.05 * place,
            "linear_accuracy": 0.9,
            "mmd": 0.1,
        }
        for place, (regularise, matching, strength, weight) in reversed(
            [*enumerate(variants)]
        )
        for seed in measure.SEEDS
    ]
    table = results.table(pd.DataFrame(rows))
    for way, strengths in results.STRENGTHS_OF.items():
        part = table[table.way == way]
        assert part.strength.tolist() == strengths and strengths[0] == NONE.words
        assert part.seeds.tolist() == [3] * len(strengths)
        assert part.validation_loss.iloc[0] == pytest.approx(0.21)
    paper = table[table.strength == PAPER.words].iloc[0]
    assert paper.validation_loss == pytest.approx(0.31)
    assert (paper.lowest, paper.highest) == pytest.approx((0.3, 0.32))
    losses, told_apart, reversed_losses, reversed_told = results.figure(table).axes
    drawn = [*losses.lines[0].get_ydata(), *reversed_losses.lines[0].get_ydata()]
    assert drawn == table.validation_loss.tolist()
    assert losses.get_ylim() == reversed_losses.get_ylim()
    for axes in (told_apart, reversed_told):
        assert len(axes.lines) == len(results.LINES) + 1  # and chance


def test_records_of_the_kind_can_be_tabled():
    """Those of the latent space have 5 matching iterations, or no adversary."""
    frame = records("results").frame()
    table = results.table(frame[~frame.training_regularise])
    assert set(table.strength) == {NONE.words} and set(table.system) == {
        "system1",
        "system2",
    }
