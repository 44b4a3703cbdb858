"""Algorithms 1 and 2: trained parts, seeds, released variants, a small whole run."""

import dataclasses
import itertools
import math

import pytest
import torch
from torch import nn

from sidm.config import ConfigError
from sidm.learning import (
    DynamicsModel,
    Standardisation,
    Training,
    TrainingError,
    train,
    validation_loss,
)
from sidm.learning import training as training_module
from sidm.learning.dataset import Datasets
from sidm.learning.evaluation import mean_loss
from sidm.learning.losses import prediction_loss
from sidm.learning.stopping import COMPONENT_SPACING
from sidm.learning.trainer import Trainer
from sidm.learning.training import (
    discriminator_iteration,
    matching_iteration,
    prediction_phase,
    regularisation_phase,
)
from sidm.learning.weights import make_optimiser

PARTS = (
    "encoders.novice",
    "encoders.expert",
    "sidm",
    "decoders.novice",
    "decoders.expert",
)


def losses_of(trainer: Trainer, batch) -> dict[str, torch.Tensor]:
    latents = {role: trainer.encode(role, windows) for role, windows in batch.items()}
    return trainer.model.losses(batch, latents)


def vector(module: nn.Module) -> torch.Tensor:
    return torch.cat(
        [parameter.detach().reshape(-1) for parameter in module.parameters()]
    )


def parts(trainer: Trainer) -> dict[str, torch.Tensor]:
    """All weights by part; the discriminator's key is 'A'."""
    return {name: vector(trainer.model.get_submodule(name)) for name in PARTS} | {
        "A": vector(trainer.discriminator)
    }


def changed(
    before: dict[str, torch.Tensor], after: dict[str, torch.Tensor]
) -> set[str]:
    return {name for name in before if not torch.equal(before[name], after[name])}


@pytest.fixture
def run(datasets, small_network, small_training):
    def run(seed=0, sets=datasets, standardisation=None, progress=None, **changes):
        training = dataclasses.replace(small_training, **changes)
        return train(
            sets,
            small_network,
            training,
            seed,
            standardisation=standardisation,
            progress=progress,
        )

    return run


def test_discriminator_iteration_changes_a_alone(make_trainer):
    trainer = make_trainer()
    before = parts(trainer)
    discriminator_iteration(trainer)
    assert changed(before, parts(trainer)) == {"A"}
    assert 0 <= trainer.accuracy <= 1


@pytest.mark.parametrize("optimiser", ["own", "shared"])
def test_matching_iteration_changes_the_novice_encoder_alone(make_trainer, optimiser):
    trainer = make_trainer(matching_optimiser=optimiser)
    prediction_phase(trainer)  # the shared optimiser now has moments for all parts
    before = parts(trainer)
    matching_iteration(trainer)
    assert changed(before, parts(trainer)) == {"encoders.novice"}


def test_the_matching_loss_is_the_mean_over_a_phase(make_trainer, monkeypatch):
    losses = []

    def recorded(trainer):
        losses.append(matching_iteration(trainer))
        return losses[-1]

    monkeypatch.setattr(training_module, "matching_iteration", recorded)
    trainer = make_trainer(matching_iterations=3)
    for _ in range(2):
        regularisation_phase(trainer)
    assert len(losses) == 6 and min(losses) > 0
    assert trainer.matching_loss == pytest.approx(sum(losses[3:]) / 3)


def test_prediction_changes_all_but_a(make_trainer):
    trainer = make_trainer(p_expert=0.5)
    before = parts(trainer)
    prediction_phase(trainer)
    assert changed(before, parts(trainer)) == set(PARTS)


@pytest.mark.parametrize(("p_expert", "untouched"), [(0.0, "expert"), (1.0, "novice")])
def test_prediction_leaves_the_parts_of_a_system_not_drawn(
    make_trainer, p_expert, untouched
):
    trainer = make_trainer(p_expert=p_expert)
    before = parts(trainer)
    prediction_phase(trainer)
    same = {f"encoders.{untouched}", f"decoders.{untouched}", "A"}
    assert changed(before, parts(trainer)) == set(before) - same


def test_the_discriminator_learns_to_tell_apart_and_matching_deceives_it(make_trainer):
    trainer = make_trainer(discriminator_batch=6, learning_rate=3e-3)
    encoder = trainer.model.encoders["novice"]
    for _ in range(150):
        discriminator_iteration(trainer)
    novice = trainer.datasets.train
    with torch.no_grad():
        before = float(
            trainer.discriminator(encoder(novice.inputs, novice.maps)).mean()
        )
    assert trainer.accuracy > 0.7 and before < 0.4
    for _ in range(100):
        matching_iteration(trainer)
    with torch.no_grad():
        assert (
            float(trainer.discriminator(encoder(novice.inputs, novice.maps)).mean())
            > before + 0.2
        )


def test_batch_loss_is_that_of_each_system_alone(make_trainer):
    trainer = make_trainer(p_expert=0.5, batch=8)
    batch = trainer.sampler.batch()
    assert set(batch) == {"novice", "expert"} and sum(map(len, batch.values())) == 8
    for role, losses in losses_of(trainer, batch).items():
        motion = batch[role]
        predicted, _ = trainer.model(role, motion.inputs, motion.maps)
        assert torch.allclose(
            losses, prediction_loss(predicted, motion.targets), rtol=1e-4
        )


def test_system_drawn_per_trajectory(make_trainer):
    trainer = make_trainer(p_expert=0.75, batch=8)
    batches = [trainer.sampler.batch() for _ in range(300)]
    shares = [len(batch["expert"]) if "expert" in batch else 0 for batch in batches]
    assert len(set(shares)) > 3 and abs(sum(shares) / 2400 - 0.75) < 0.04


def test_system_drawn_per_iteration(make_trainer):
    trainer = make_trainer(p_expert=0.75, system_draw="iteration")
    batches = [trainer.sampler.batch() for _ in range(300)]
    assert all(
        len(batch) == 1 and len(next(iter(batch.values()))) == 4 for batch in batches
    )
    assert abs(sum("expert" in batch for batch in batches) / 300 - 0.75) < 0.08


def test_methods_draw_the_same_novice_trajectories(make_trainer):
    alone = make_trainer(p_expert=0.0, regularise=False, batch=8)
    shared = make_trainer(p_expert=0.5, batch=8)
    for _ in range(5):
        everything = alone.sampler.batch()["novice"].inputs
        some = shared.sampler.batch()["novice"].inputs
        assert all(
            any(torch.equal(drawn, other) for other in everything) for drawn in some
        )


def test_decay_decoupled_and_l2(small_network):
    """With a zero gradient, decoupled decay shrinks weights in proportion.

    An L2 penalty takes a step of Adam.
    """
    after = {}
    for decay in ("decoupled", "l2"):
        layer = nn.Linear(3, 1, bias=False)
        layer.weight.data = torch.tensor([[1.0, 2.0, -4.0]])
        layer.weight.grad = torch.zeros(1, 3)
        make_optimiser(
            layer, Training(decay=decay, learning_rate=0.1, weight_decay=0.5)
        ).step()
        after[decay] = layer.weight.detach().flatten().tolist()
    assert after["decoupled"] == pytest.approx([0.95, 1.9, -3.8])
    assert after["l2"] == pytest.approx([0.9, 1.9, -3.9])


def test_reduction_mean_divides_the_gradient_by_thirteen(make_trainer):
    total, mean = (
        make_trainer(prediction_iterations=1, reduction=name)
        for name in ("sum", "mean")
    )
    for trainer in (total, mean):
        prediction_phase(trainer)
    for one, other in zip(
        total.model.parameters(), mean.model.parameters(), strict=True
    ):
        assert (one.grad is None) == (other.grad is None)
        assert one.grad is None or torch.allclose(
            one.grad, 13 * other.grad, rtol=1e-4, atol=1e-7
        )
    assert total.losses == mean.losses  # the reported loss stays equation (1)


def test_bfloat16_rounds_the_encoders_alone_and_moves_the_loss_little(make_trainer):
    exact, rounded = (
        make_trainer(prediction_iterations=1, precision=name)
        for name in ("float32", "bfloat16")
    )
    batch = exact.sampler.batch()
    for role, motion in batch.items():
        latents, low_latents = exact.encode(role, motion), rounded.encode(role, motion)
        assert latents.dtype == low_latents.dtype == torch.float32
        assert 0 < (latents - low_latents).abs().max() < 0.02 * latents.abs().max()
    pairs = zip(
        losses_of(exact, batch).values(),
        losses_of(rounded, batch).values(),
        strict=True,
    )
    assert all(
        torch.allclose(latents.mean(), low_latents.mean(), rtol=0.01)
        for latents, low_latents in pairs
    )
    for phase in (prediction_phase, discriminator_iteration, matching_iteration):
        phase(rounded)
    assert all(
        weights.dtype == torch.float32 and weights.isfinite().all()
        for weights in rounded.model.parameters()
    )


def test_released_stopping_is_chosen_by_its_name(run, make_trainer):
    assert make_trainer(stopping="released").stopping.rule == "released"
    assert not run(stopping="released", patience=1).stopped_early
    assert run(stopping="test_loss", patience=1, max_samples=10**6).stopped_early


def test_a_run_counts_samples_and_tests(run, datasets):
    seen = []
    trained = run(progress=seen.append)
    assert trained.iterations == 12
    assert trained.samples == 12 * 4 * 6
    assert not trained.stopped_early
    assert [tested.samples for tested in trained.history] == [96, 192, 288]
    assert seen == trained.history
    for name in ("discriminator_accuracy", "matching_loss"):
        unknown = [getattr(tested, name) is None for tested in trained.history]
        assert unknown == [True, False, False]
    assert all(math.isfinite(tested.training_loss) for tested in trained.history)


def test_losses_by_component_are_kept_ever_farther_apart(run, make_trainer):
    """Losses are of the tested weights, on the first trajectories of each set.

    Nothing is chosen by them.
    """
    trained = run(max_samples=24 * 400, test_interval=1)
    samples = [entry.samples for entry in trained.components]
    assert samples[0] == 24
    assert samples == sorted(set(samples))
    assert len(samples) < len(trained.history) / 4
    assert all(
        later >= COMPONENT_SPACING * earlier
        for earlier, later in itertools.pairwise(samples)
    )
    tests = {tested.samples: tested.test_loss for tested in trained.history}
    assert [sum(one.test) for one in trained.components] == pytest.approx(
        [tests[s] for s in samples], rel=1e-5
    )
    trainer = make_trainer(validation_trajectories=1)
    expected = validation_loss(trainer.model, trainer.datasets.validation.first(1))
    assert trainer.measure_components().validation == pytest.approx(expected.tolist())


def test_training_loss_is_the_novices(make_trainer):
    trainer = make_trainer()
    trainer.record_losses(
        {"novice": torch.full((1, 6), 2.0), "expert": torch.full((3, 6), 8.0)}
    )
    assert trainer.run_test().training_loss == 2.0
    trainer.record_losses({"expert": torch.full((4, 6), 8.0)})
    assert trainer.run_test().training_loss == 8.0
    assert trainer.samples == 48


def test_same_seed_same_result_another_seed_another(run):
    first, repeated, other = run(seed=1), run(seed=1), run(seed=2)
    assert torch.equal(vector(first.model), vector(repeated.model))
    assert first.history == repeated.history
    assert not torch.equal(vector(first.model), vector(other.model))


def test_global_randomness_does_not_matter(run):
    first = run()
    with torch.random.fork_rng():
        torch.default_generator.manual_seed(12345)
        before = torch.get_rng_state()
        repeated = run()
        assert torch.equal(torch.get_rng_state(), before)
    assert torch.equal(vector(first.model), vector(repeated.model))


def test_learning_lowers_the_validation_loss(run, make_motion, small_network):
    sets = Datasets(
        make_motion(60, 1),
        make_motion(8, 2),
        make_motion(8, 3),
        make_motion(60, 4, gain=1.5),
    )
    fresh = DynamicsModel(small_network, Standardisation.fit(sets.expert), seed=0)
    trained = run(sets=sets, max_samples=24 * 300, learning_rate=5e-3, p_expert=0.5)
    before, after = (
        float(validation_loss(model, sets.validation).sum())
        for model in (fresh, trained.model)
    )
    assert after < 0.8 * before


def test_the_best_weights_are_returned(run, datasets):
    trained = run(max_samples=24 * 40, learning_rate=0.05, smoothing=0.0)
    losses = [tested.test_loss for tested in trained.history]
    assert losses.index(min(losses)) < len(losses) - 1, (
        "the run must overfit for this test to tell"
    )
    assert trained.best_test_loss == min(losses)
    assert trained.best_samples == trained.history[losses.index(min(losses))].samples
    assert mean_loss(trained.model, datasets.test) == pytest.approx(
        min(losses), rel=1e-6
    )


def test_without_the_experts_data(run, datasets):
    units = Standardisation.fit(datasets.expert)
    alone = run(
        sets=datasets._replace(expert=None),
        standardisation=units,
        p_expert=0.0,
        regularise=False,
    )
    beside = run(p_expert=0.0, regularise=False)
    assert torch.equal(vector(alone.model), vector(beside.model))
    assert alone.history == beside.history


def test_missing_expert_data_are_named(run, datasets):
    without = datasets._replace(expert=None)
    with pytest.raises(ConfigError, match="need the expert's data"):
        run(sets=without)
    with pytest.raises(ConfigError, match="pass `standardisation`"):
        run(sets=without, p_expert=0.0, regularise=False)


def test_a_short_run_is_tested_at_its_end(run):
    trained = run(max_samples=1)
    assert trained.iterations == 1 and len(trained.history) == 1


def test_a_loss_that_is_no_number_is_an_error(run, datasets):
    datasets.test.targets.fill_(float("nan"))
    with pytest.raises(TrainingError, match="the test loss is nan after 2 iterations"):
        run(test_interval=2)


def test_training_that_diverges_stops_at_the_next_test(run):
    with pytest.raises(
        TrainingError, match="the training loss is (nan|inf) after 3 iterations"
    ):
        run(learning_rate=1e11, test_interval=3)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("p_expert", 1.1),
        ("smoothing", 1.0),
        ("batch", 0),
        ("patience", 0),
        ("matching_iterations", -1),
        ("learning_rate", 0.0),
        ("weight_decay", -1.0),
        ("system_draw", "sample"),
        ("stopping", "never"),
    ],
)
def test_settings_that_no_run_can_have(name, value):
    with pytest.raises(ConfigError, match=f"Training.{name}"):
        Training(**{name: value})
