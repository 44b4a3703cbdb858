"""Latents that are alike and apart, and a stored diagnosis of a tiny trial."""

import numpy as np
import pytest
import torch
from sklearn.linear_model import LogisticRegression

from companion.engine.library import Library
from companion.studies.latent_space import latents, measure, untrained
from companion.study import Study
from sidm.learning import DynamicsModel, validation_loss
from sidm.systems import ROLES
from tests.companion.conftest import write_motion


@pytest.fixture
def pair():
    """Features (40, 8, 5) of two systems, drawn from one distribution."""
    return np.random.default_rng(3).normal(size=(2, 40, 8, 5))


def test_like_features_are_not_told_apart(pair):
    assert latents.classifier_accuracy(pair, LogisticRegression()) == pytest.approx(
        0.5, abs=0.1
    )
    assert latents.squared_mmd(*pair) == pytest.approx(0, abs=0.01)


def test_features_far_apart_are(pair):
    apart = pair[0], pair[1] + 6
    assert latents.classifier_accuracy(apart, LogisticRegression()) == 1.0
    assert latents.squared_mmd(*apart) > 0.5
    novice, expert = map(np.array, latents.picture(*apart))
    assert novice.shape == (latents.PICTURED, 2)
    assert abs(novice.mean(0) - expert.mean(0))[0] > 1


def test_only_whole_trajectories_are_held_out(pair):
    """A mark of single trajectories, not of systems, does not help the classifier."""
    marks = np.random.default_rng(4).normal(size=(2, 40, 1, 30)).repeat(8, axis=2)
    marked = np.concatenate([pair, marks], -1)
    assert latents.classifier_accuracy(marked, LogisticRegression()) < 0.7


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
    losses = {
        (e, g): latents.crossed_loss(model, motion, e, g) for e in ROLES for g in ROLES
    }
    for role in ROLES:
        assert losses[role, role] == pytest.approx(
            float(validation_loss(model, motion, role).sum()), rel=1e-5
        )
    assert len(set(losses.values())) == 4


def test_what_is_held_out_was_not_learnt_from(study, data, monkeypatch):
    """Latents are of expert trajectories after the trial's, and of validation data."""
    trial = measure.jobs(study, "system1")[1]
    write_motion(data, measure.held_out_expert(trial))
    seen, true = {}, latents.latents_of

    def latents_of(model, role, motion):
        seen[role] = motion
        return true(model, role, motion)

    monkeypatch.setattr(latents, "latents_of", latents_of)
    measure.measure(trial, data)
    library = Library(data)
    learnt = library.motion(trial, "expert").inputs
    assert len(seen["expert"]) == trial.datasets["validation"].count
    assert not any(
        torch.equal(inputs, other)
        for inputs in seen["expert"].inputs
        for other in learnt
    )
    assert torch.equal(
        seen["novice"].inputs, library.motion(trial, "validation").inputs
    )


def test_two_untrained_encoders_are_farther_apart_than_one(
    tiny, data, tmp_path, monkeypatch
):
    """With one encoder the latents differ as much as the robots' motion does."""
    monkeypatch.setattr(
        "companion.studies.latent_space.untrained.PAPER_SYSTEMS", ("system1",)
    )
    study = Study(tiny, data, tmp_path)
    assert untrained.read(tmp_path) == {}
    untrained.make(study, workers=1)
    measured = untrained.read(tmp_path)["system1"]
    own, one = (measured[name] for name in ("own encoders", "one encoder"))
    assert len(own) == len(one) == tiny.seeds
    assert all(two.mmd > 2 * same.mmd for two, same in zip(own, one, strict=True))
    assert all(0 <= apart.network_accuracy <= 1 for apart in own + one)
