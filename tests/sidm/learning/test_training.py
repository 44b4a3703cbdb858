"""Algorithms 1 and 2: draws, seeds, tests, checkpoints, a small whole run."""

import dataclasses

import pytest
import torch

from sidm.config import ConfigError
from sidm.learning import (
    CheckpointError,
    Standardisation,
    Training,
    TrainingError,
    checkpoint,
    training,
)
from sidm.learning.evaluation import mean_loss
from tests.sidm.learning.test_reference import RELEASED


@pytest.fixture
def run(datasets, small_network, small_training):
    def run(seed=0, sets=datasets, how=(), **changes):
        settings = dataclasses.replace(small_training, **changes)
        return training.train(sets, small_network, settings, seed, **dict(how))

    return run


@pytest.mark.parametrize("system_draw", ["trajectory", "iteration"])
def test_the_expert_is_drawn_with_its_probability(make_trainer, system_draw):
    trainer = make_trainer(p_expert=0.75, system_draw=system_draw)
    batches = [trainer.sampler.batch_indices() for _ in range(300)]
    shares = [len(batch.get("expert", ())) / 4 for batch in batches]
    assert (set(shares) == {0, 1}) == (system_draw == "iteration")
    assert abs(sum(shares) / 300 - 0.75) < 0.08


def test_methods_draw_the_same_novice_trajectories(make_trainer):
    alone = make_trainer(p_expert=0.0, regularise=False, batch=8)
    shared = make_trainer(p_expert=0.5, batch=8)
    for _ in range(5):
        some = shared.sampler.batch_indices()["novice"].tolist()
        assert {*some} <= {*alone.sampler.batch_indices()["novice"].tolist()}


def test_a_run_counts_samples_and_tests(run):
    seen = []
    trained = run(how={"progress": seen.append})
    assert trained.iterations == 12 and trained.samples == 12 * 4 * 6
    assert not trained.stopped_early
    assert [tested.samples for tested in trained.history] == [96, 192, 288]
    assert seen == trained.history
    for name in ("discriminator_accuracy", "matching_loss"):
        unknown = [getattr(tested, name) is None for tested in trained.history]
        assert unknown == [True, False, False]
    short = run(max_samples=1)
    assert short.iterations == len(short.history) == 1  # tested at its end
    assert not run(stopping="released", patience=1).stopped_early
    assert run(stopping="test_loss", patience=1, max_samples=10**6).stopped_early


def test_training_loss_is_the_novices(make_trainer):
    trainer, expert = make_trainer(), torch.full((3, 6), 8.0)
    trainer.record_losses({"novice": torch.full((1, 6), 2.0), "expert": expert})
    assert trainer.run_test().training_loss == 2.0
    trainer.record_losses({"expert": expert})
    assert trainer.run_test().training_loss == 8.0
    assert trainer.samples == 42


def test_the_seed_alone_decides_the_result(run):
    first, other = run(seed=1), run(seed=2)
    with torch.random.fork_rng():
        torch.default_generator.manual_seed(12345)
        before = torch.get_rng_state()
        repeated = run(seed=1)
        assert torch.equal(torch.get_rng_state(), before)
    same(first, repeated)
    assert first.history != other.history


def test_the_best_weights_are_returned(run, datasets):
    trained = run(max_samples=24 * 40, learning_rate=0.05, smoothing=0.0)
    losses = [tested.test_loss for tested in trained.history]
    best = losses.index(min(losses))
    assert best < len(losses) - 1, "the run must overfit for this test to tell"
    assert trained.best_test_loss == losses[best]
    assert trained.best_samples == trained.history[best].samples
    found = mean_loss(trained.model, datasets.test)
    assert found == pytest.approx(losses[best], rel=1e-6)


def test_a_novice_alone_needs_units_but_no_expert(run, datasets):
    without = datasets._replace(expert=None)
    alone = dict(p_expert=0.0, regularise=False)
    with pytest.raises(ConfigError, match="need the expert's data"):
        run(sets=without)
    with pytest.raises(ConfigError, match="pass `standardisation`"):
        run(sets=without, **alone)
    units = {"standardisation": Standardisation.fit(datasets.expert)}
    assert run(sets=without, how=units, **alone)[1:] == run(**alone)[1:]


def test_a_loss_that_is_no_number_is_an_error(run, datasets):
    with pytest.raises(TrainingError, match="training loss is (nan|inf) after 3 iter"):
        run(learning_rate=1e11, test_interval=3)
    datasets.test.targets.fill_(float("nan"))
    with pytest.raises(TrainingError, match="the test loss is nan after 2 iterations"):
        run(test_interval=2)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("p_expert", 1.1),
        ("smoothing", 1.0),
        ("batch", 0),
        ("matching_iterations", -1),
        ("learning_rate", 0.0),
        ("stopping", "never"),
    ],
)
def test_settings_that_no_run_can_have(name, value):
    with pytest.raises(ConfigError, match=f"Training.{name}"):
        Training(**{name: value})


def kill_at(samples):
    """A function that raises an error at the first test after so many samples."""

    def progress(tested):
        if tested.samples >= samples:
            raise KeyboardInterrupt

    return progress


def same(first, second):
    weights = second.model.state_dict()
    for name, one in first.model.state_dict().items():
        assert torch.equal(one, weights[name]), name
    assert first[1:] == second[1:]


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"p_expert": 0.0, "regularise": False},
        RELEASED | {"test_interval": 4},
        {"matching": "reversal"},
        {"matching": "mmd", "frozen": "sidm"},
        {"mirror": True, "averaging": 0.9, "tether": 10.0},
    ],
)
def test_a_killed_run_goes_on_bit_for_bit_and_a_finished_one_is_read(
    run, tmp_path, changes
):
    how, changes = {"checkpoint": tmp_path}, changes | {"max_samples": 24 * 24}
    whole = run(**changes)
    for samples in (8 * 24, 20 * 24):
        with pytest.raises(KeyboardInterrupt):
            run(how=how | {"progress": kill_at(samples)}, **changes)
    same(run(how=how, **changes), whole)
    same(run(how=how | {"progress": kill_at(0)}, **changes), whole)


def test_data_that_no_training_can_have_are_refused(run, datasets, make_motion):
    for changes, words in (
        ({"test": datasets.test.first(0)}, "datasets.test has no windows"),
        ({"expert": make_motion(2, steps=3)}, "have 6 steps, the expert's 3"),
    ):
        with pytest.raises(ConfigError, match=words):
            run(sets=datasets._replace(**changes))


def test_a_checkpoint_of_another_run_is_refused(run, datasets, tmp_path):
    how = {"checkpoint": tmp_path}
    start = run().model.state_dict()
    run(how=how)
    for changes in (
        {"seed": 1},
        {"learning_rate": 2e-3},
        {"how": how | {"start": start}},
    ):
        with pytest.raises(CheckpointError, match="of another run; delete it") as error:
            run(**{"how": how} | changes)
        assert "\n" not in str(error.value)
    for numbers in (
        datasets.validation.targets,
        datasets.train.maps,
        datasets.train.inputs,
    ):
        numbers[0, 0, 0] += 1
        with pytest.raises(CheckpointError, match="of another run"):
            run(how=how)
        numbers[0, 0, 0] -= 1


def test_a_damaged_checkpoint_is_named(run, tmp_path):
    (tmp_path / checkpoint.FILE).write_bytes(b"PK\x03\x04 cut short")
    words = f"{checkpoint.FILE}.*damaged.*delete it"
    with pytest.raises(CheckpointError, match=words) as error:
        run(how={"checkpoint": tmp_path})
    assert "\n" not in str(error.value)
