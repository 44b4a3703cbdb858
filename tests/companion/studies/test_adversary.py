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
    assert len({job.key for job in jobs}) == len(STRENGTHS) * len(measure.SEEDS)
    settings = [job.training for job in jobs if job.training.regularise]
    iterations = ("discriminator_iterations", "matching_iterations")
    assert {tuple(getattr(s, name) for name in iterations) for s in settings} == {
        tuple(strength) for strength in STRENGTHS if strength != NONE
    }
    same = dict.fromkeys(iterations, 1)
    assert len({dataclasses.replace(s, **same) for s in settings}) == 1


def test_the_table_goes_from_the_weakest_to_the_strongest(tmp_path):
    """Its figure has the same points."""
    rows = [
        {
            "system": "system1",
            "seed": seed,
            "training_regularise": strength != NONE,
            "training_discriminator_iterations": strength.discriminator or 20,
            "training_matching_iterations": strength.matching or 20,
            "validation_loss": 0.2 + 0.1 * place + 0.01 * seed,
            "discriminator_accuracy": None if strength == NONE else 1 - 0.1 * place,
            "network_accuracy": 1 - 0.05 * place,
            "linear_accuracy": 0.9,
            "mmd": 0.1,
        }
        for place, strength in reversed([*enumerate(STRENGTHS)])
        for seed in measure.SEEDS
    ]
    table = results.table(pd.DataFrame(rows))
    assert table.strength.tolist() == [strength.words for strength in STRENGTHS]
    assert table.seeds.tolist() == [3] * len(STRENGTHS)
    paper = table[table.strength == PAPER.words].iloc[0]
    assert paper.validation_loss == pytest.approx(0.31)
    assert (paper.lowest, paper.highest) == pytest.approx((0.3, 0.32))
    figure = results.figure(table)
    losses, told_apart = figure.axes
    assert losses.lines[0].get_ydata().tolist() == table.validation_loss.tolist()
    assert len(told_apart.lines) == len(results.LINES) + 1  # and chance


def test_records_of_the_kind_can_be_tabled():
    """Those of the latent space have 5 matching iterations, or no adversary."""
    frame = records("results").frame()
    table = results.table(frame[~frame.training_regularise])
    assert set(table.strength) == {NONE.words} and set(table.system) == {
        "system1",
        "system2",
    }
