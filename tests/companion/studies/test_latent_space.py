"""Latents that are alike and apart, and what a diagnosis is measured on."""

import numpy as np
import pytest
import torch
from sklearn.linear_model import LogisticRegression

from companion.engine.library import Library
from companion.registry import MEASUREMENTS
from companion.studies.latent_space import latents, measure, untrained
from sidm.learning import DynamicsModel, validation_loss
from sidm.systems import ROLES
from tests.companion.conftest import write_motion


@pytest.fixture
def pair():
    """Features (40, 8, 5) of two systems, drawn from one distribution."""
    return np.random.default_rng(3).normal(size=(2, 40, 8, 5))


def accuracy(features):
    return latents.classifier_accuracy(features, LogisticRegression())


def test_like_features_are_not_told_apart_and_distant_ones_are(pair):
    apart = pair[0], pair[1] + 6
    assert accuracy(pair) == pytest.approx(0.5, abs=0.1) and accuracy(apart) == 1.0
    novice, expert = map(np.array, latents.picture(*apart))
    assert novice.shape == (latents.PICTURED, 2)
    assert abs(novice.mean(0) - expert.mean(0))[0] > 1


def test_only_whole_trajectories_are_held_out(pair):
    """A mark of single trajectories, not of systems, does not help the classifier."""
    marks = np.random.default_rng(4).normal(size=(2, 40, 1, 30)).repeat(8, axis=2)
    assert accuracy(np.concatenate([pair, marks], -1)) < 0.7


def test_mmd_is_that_of_its_definition(pair):
    """The expected value is written out as sums over pairs."""
    x, y = pair[:, :6].reshape(2, -1, 5)
    both = np.concatenate([x, y])
    x, y = ((one - both.mean(0)) / both.std(0) for one in (x, y))
    width = np.median([((a - b) ** 2).sum() for a in x for b in y])

    def mean(one, other, same):
        terms = [
            np.exp(-((a - b) ** 2).sum() / width)
            for i, a in enumerate(one)
            for j, b in enumerate(other)
            if not (same and i == j)
        ]
        return np.mean(terms)

    wanted = mean(x, x, True) + mean(y, y, True) - 2 * mean(x, y, False)
    assert latents.squared_mmd(*pair[:, :6]) == pytest.approx(wanted)


def test_one_systems_parts_are_crossed_with_the_others(small_network, make_motion):
    """The novice's own parts give its loss; other parts give other losses."""
    model, motion = DynamicsModel(small_network), make_motion(3)
    pairs = [(encoder, decoder) for encoder in ROLES for decoder in ROLES]
    losses = {pair: latents.crossed_loss(model, motion, *pair) for pair in pairs}
    for role in ROLES:
        expected = float(validation_loss(model, motion, role).sum())
        assert losses[role, role] == pytest.approx(expected, rel=1e-5)
    assert len(set(losses.values())) == 4


def test_what_is_held_out_was_not_learnt_from(study, data, monkeypatch):
    """Latents are of expert trajectories after the trial's, and of validation data."""
    trial = measure.jobs(study, "system1")[1]
    write_motion(data, measure.held_out_expert(trial))
    seen, true = {}, latents.latents_of

    def latents_of(model, role, motion):
        seen[role] = motion.inputs
        return true(model, role, motion)

    monkeypatch.setattr(latents, "latents_of", latents_of)
    measure.measure(trial, data)
    learnt, validation = (
        Library(data).motion(trial, kind).inputs for kind in ("expert", "validation")
    )
    assert torch.equal(seen["novice"], validation)
    assert len(seen["expert"]) == trial.datasets["validation"].count
    assert not any(torch.equal(a, b) for a in seen["expert"] for b in learnt)


def test_two_untrained_encoders_are_farther_apart_than_one(
    study, data, tmp_path, monkeypatch
):
    """With one encoder the latents differ as much as the robots' motion does."""
    monkeypatch.setattr(untrained, "PAPER_SYSTEMS", ("system1",))
    assert not len(untrained.table(tmp_path, ["system1"]))
    MEASUREMENTS["untrained-latents"].run(study, None, 1, data, tmp_path)
    measured = untrained.table(tmp_path, ["system1"])
    own, one = (
        measured.mmd[measured.encoders == name].to_numpy()
        for name in untrained.ENCODERS
    )
    assert len(own) == study.preset.seeds and (own > 2 * one).all()
