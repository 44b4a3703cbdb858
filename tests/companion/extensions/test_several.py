"""One SIDM of several experts."""

import dataclasses

import pytest
import torch

from companion.extensions.several import (
    SeveralTrainer,
    expert_as_novice,
    nearest_expert,
)
from sidm.config import ConfigError
from sidm.learning import DynamicsModel, Standardisation
from sidm.learning.evaluation import mean_loss
from sidm.learning.training import learn, prediction_phase

UNITS = Standardisation.none()


@pytest.fixture
def experts(make_motion):
    """Three robots of the same law with different gains."""
    gains = {"expert": 1.5, "member0": 1.0, "member1": -1.0}
    return {
        name: make_motion(8, number, gain=gain)
        for number, (name, gain) in enumerate(gains.items())
    }


@pytest.fixture
def alone(small_training):
    return dataclasses.replace(
        small_training, p_expert=0.0, regularise=False, max_samples=24 * 60
    )


def test_a_batch_is_drawn_from_all_and_all_learn(experts, small_network, alone):
    trainer = SeveralTrainer(experts, small_network, alone, 0, UNITS)
    before = {name: part.clone() for name, part in trainer.model.state_dict().items()}
    counts = dict.fromkeys(experts, 0)
    for _ in range(100):
        for role, motion in trainer.sampler.batch().items():
            counts[role] += len(motion)
    assert sum(counts.values()) == 400 and min(counts.values()) > 100
    for _ in range(3):
        prediction_phase(trainer)
    after = trainer.model.state_dict()
    changed = {n.split(".")[1] for n in after if not torch.equal(after[n], before[n])}
    assert set(experts) <= changed
    assert trainer.samples == 18 * 24 and len(trainer.history) == 4


def test_trajectories_to_stop_by_are_not_learnt_from(experts, small_network, alone):
    trainer = SeveralTrainer(experts, small_network, alone, 0, UNITS)
    losses = []
    for role, windows in experts.items():
        learning = trainer.sampler.windows[role]
        left = sorted(set(range(len(windows))) - set(learning.row_indices.tolist()))
        assert len(learning) == 6 and len(left) == 2
        losses.append(mean_loss(trainer.model, windows.subset(left), role))
    assert trainer.run_test().test_loss == pytest.approx(sum(losses) / 3)


def test_a_novice_goes_on_from_the_nearest_expert(
    experts, small_network, alone, make_motion
):
    longer = dataclasses.replace(alone, max_samples=24 * 400)
    trained = learn(SeveralTrainer(experts, small_network, longer, 0, UNITS))
    assert trained.best_test_loss < trained.history[0].test_loss
    model = trained.model
    novice = make_motion(4, 9, gain=-1.0)
    role = nearest_expert(model, novice)
    assert role == "member1"
    own = DynamicsModel(small_network, UNITS, roles=["novice"])
    own.initialise_from(expert_as_novice(model, role))
    loss = mean_loss(model, novice, role)
    assert mean_loss(own.eval(), novice) == pytest.approx(loss)


def test_there_is_no_novice_among_several_experts(
    experts, small_network, small_training
):
    with pytest.raises(ConfigError, match="without a novice"):
        SeveralTrainer(experts, small_network, small_training, 0, UNITS)
