"""Parts that the two systems may share, and equal initial weights of both systems."""

import dataclasses

import pytest
import torch

from sidm.config import ConfigError
from sidm.learning import DynamicsModel, Network, parameter_count
from sidm.learning.trainer import Trainer
from sidm.learning.training import prediction_phase


@pytest.fixture
def make_model(small_network):
    def make(own, **given) -> DynamicsModel:
        return DynamicsModel(dataclasses.replace(small_network, own=own), **given)

    return make


@pytest.mark.parametrize(
    ("own", "differing"),
    [
        ("none", set()),
        ("flag", {"encoders.dense.0.bias"}),
        (
            "biases",
            {
                f"encoders.{n}.bias"
                for n in ("convolutions.0", "convolutions.2", "dense.0", "dense.2")
            }
            | {f"decoders.{n}.bias" for n in ("dense.0", "dense.2")},
        ),
    ],
)
def test_each_system_learns_what_is_its_own_and_both_the_rest(
    make_trainer, datasets, small_network, small_training, own, differing
):
    network = dataclasses.replace(small_network, own=own)
    training = dataclasses.replace(small_training, p_expert=0.5, regularise=False)
    trainer = Trainer(datasets, network, training, 0)
    one = DynamicsModel(network, roles=["novice"])
    extra = sum(size_of(one, name) for name in differing)
    assert parameter_count(trainer.model) == parameter_count(one) + extra
    prediction_phase(trainer)
    weights = dict(trainer.model.state_dict())
    found = set()
    for name, tensor in weights.items():
        if ".novice." in name and not torch.equal(
            tensor, weights[name.replace(".novice.", ".expert.")]
        ):
            found.add(name.replace(".novice", ""))
    assert found == differing


def size_of(model: DynamicsModel, name: str) -> int:
    kind, _, rest = name.partition(".")
    return dict(model.named_parameters())[f"{kind}.novice.{rest}"].numel()


def test_the_paper_shares_the_sidm_alone(make_model):
    both, one = make_model("all"), make_model("all", roles=["novice"])
    shared = parameter_count(both.sidm)
    assert parameter_count(both) - shared == 2 * (parameter_count(one) - shared)


@pytest.mark.parametrize("own", ["all", "biases", "flag", "none"])
def test_both_systems_begin_as_copies(make_model, make_motion, own):
    start = make_model("all", seed=7, roles=["novice"])
    model, motion = make_model(own), make_motion(2)
    model.initialise_from(start.state_dict())
    expected = start("novice", motion.inputs, motion.maps)[0]
    for role in ("novice", "expert"):
        assert torch.equal(model(role, motion.inputs, motion.maps)[0], expected)


def test_a_model_with_shared_parts_starts_from_its_own_weights(make_model):
    first, second = make_model("biases", seed=1), make_model("biases", seed=2)
    second.initialise_from(first.state_dict())
    assert all(
        torch.equal(weights, second.state_dict()[name])
        for name, weights in first.state_dict().items()
    )


def test_shared_parts_have_the_novices_initial_weights(make_model):
    """So a method with shared parts begins like a method without."""
    shared, apart = make_model("none").state_dict(), make_model("all").state_dict()
    for name in shared:
        assert torch.equal(shared[name], apart[name.replace(".expert.", ".novice.")])


def test_what_is_shared_has_a_name():
    with pytest.raises(ConfigError, match="Network.own"):
        Network(own="some")


def test_one_encoder_has_nothing_to_match(datasets, small_network, small_training):
    with pytest.raises(ConfigError, match="nothing to match"):
        Trainer(
            datasets, dataclasses.replace(small_network, own="none"), small_training, 0
        )
