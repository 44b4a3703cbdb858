"""A correction learns what the base leaves, and both together predict."""

import pytest
import torch

from ownrobot.methods.fine_tuning import pretraining_datasets
from ownrobot.methods.residual import Corrected, correction_units, residual_datasets
from sidm.config import ConfigError
from sidm.learning import (
    CheckpointError,
    DynamicsModel,
    Standardisation,
    Training,
    train,
    validation_loss,
)
from sidm.learning.evaluation import mean_loss, rollout
from sidm.systems import Terrain
from sidm.terrain import generate_terrain

ALONE = Training(
    p_expert=0.0,
    regularise=False,
    max_samples=6000,
    test_interval=20,
    prediction_iterations=20,
    batch=4,
)


@pytest.fixture
def base(datasets, small_network) -> DynamicsModel:
    return train(
        pretraining_datasets(datasets, 0), small_network, ALONE, 0
    ).model.requires_grad_(False)


def test_what_is_left_over_is_the_target_less_the_base(datasets, base):
    sets = residual_datasets(datasets, base)
    predicted, _ = base("novice", datasets.train.inputs, datasets.train.maps)
    assert torch.allclose(
        sets.train.targets + predicted, datasets.train.targets, atol=1e-6
    )
    assert len(sets.test) == len(datasets.test)
    assert len(sets.validation) == len(datasets.validation)


def test_the_loss_of_a_correction_is_that_of_the_sum(datasets, base, small_network):
    """So the training loop, which sees only residuals, stops by the reported loss."""
    sets = residual_datasets(datasets, base)
    correction = train(
        sets, small_network, ALONE, 0, standardisation=correction_units(sets)
    ).model
    both = Corrected(base, correction)
    assert mean_loss(both, datasets.test) == pytest.approx(
        mean_loss(correction, sets.test), rel=1e-5
    )
    assert float(validation_loss(both, datasets.validation).sum()) < float(
        validation_loss(base, datasets.validation).sum()
    )


def test_both_memories_are_carried_along(datasets, base, small_network):
    """Single steps give the same as the whole trajectory."""
    both = Corrected(base, DynamicsModel(small_network, seed=5, roles=["novice"]))
    motion = datasets.validation
    whole, _ = both("novice", motion.inputs, motion.maps)
    memory, steps = None, []
    for step in range(motion.inputs.shape[1]):
        one = slice(step, step + 1)
        predicted, memory = both(
            "novice", motion.inputs[:, one], motion.maps[:, one], memory
        )
        steps.append(predicted)
    assert torch.allclose(torch.cat(steps, 1), whole, atol=1e-5)
    heights = generate_terrain(Terrain(cell_height_scale=0.35, size=81), 0)
    state = torch.tensor([0, 0, 0.5, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0.0])
    assert rollout(both, heights, state, torch.zeros(4, 2), 8).shape == (5, 13)


def test_a_checkpoint_is_of_one_base(datasets, base, small_network, tmp_path):
    """Residuals of another model are the targets of another run."""
    sets, others = (
        residual_datasets(datasets, model)
        for model in (base, DynamicsModel(small_network, roles=["novice"]))
    )
    train(
        sets,
        small_network,
        ALONE,
        0,
        standardisation=correction_units(sets),
        checkpoint=tmp_path,
    )
    with pytest.raises(CheckpointError, match="of another run"):
        train(
            others,
            small_network,
            ALONE,
            0,
            standardisation=correction_units(others),
            checkpoint=tmp_path,
        )


def test_a_correction_works_in_the_experts_units_about_zero(datasets, base):
    sets = residual_datasets(datasets, base)
    units = correction_units(sets)
    assert torch.equal(units.target_mean, torch.zeros(13))
    assert torch.equal(
        units.target_std, Standardisation.fit(datasets.expert).target_std
    )
    with pytest.raises(ConfigError, match="needs the expert's data"):
        correction_units(sets._replace(expert=None))
