"""A bundle gives each of its trials the result of the trial alone."""

import dataclasses

import pytest
import torch

from companion.bundle import Run, train_bundle
from companion.bundle.adam import Single, StackedAdam
from companion.bundle.bundle import Bundle
from companion.bundle.device_data import DeviceData
from ownrobot.methods.fine_tuning import pretrained_from
from sidm.config import ConfigError
from sidm.learning import Datasets, TrainingError, train
from sidm.learning.arithmetic import matmul_precision
from sidm.learning.checkpoint import Checkpoint
from sidm.learning.trainer import Trainer
from sidm.learning.training import prediction_phase, regularisation_phase

SHARED_L2 = dict(matching_optimiser="shared", decay="l2", weight_decay=0.1)
RECIPE = dict(
    p_expert=0.5,
    reduction="mean",
    system_draw="iteration",
    units="raw",
    zero_gradients=True,
    replacement=False,
    discriminator_draw="one",
    **SHARED_L2,
)
#: relative tolerance of losses, whose sums run in another order; two tests of a run
#: always differ by more
ROUNDING = 1e-4
ALONE = dict(p_expert=0.0, regularise=False)


@pytest.fixture
def five(make_run):
    """Runs that differ in size, seed, system, method and length."""
    return [
        make_run(0),
        make_run(1, novice=3, tests=5, **ALONE),
        make_run(2, novice=9, p_expert=0.25),
        make_run(3, tests=40, max_samples=24 * 30, learning_rate=2e-3),
        make_run(4, regularise=False, max_samples=24 * 8),
    ]


def alone(run: Run, network, **more):
    return train(run.datasets, network, run.training, run.seed, start=run.start, **more)


def results(ended) -> dict:
    return {outcome.number: outcome.result for outcome in ended}


def assert_same(bundled, single, rel=ROUNDING):
    """Compare the learning curve, the counters and the kept weights."""
    for name in ("samples", "iterations", "best_samples", "stopped_early"):
        assert getattr(bundled, name) == getattr(single, name)
    assert bundled.best_test_loss == pytest.approx(single.best_test_loss, rel=rel)
    assert len(bundled.history) == len(single.history) > 0
    for entry, expected in zip(bundled.history, single.history, strict=True):
        assert entry[:3] == pytest.approx(expected[:3], rel=rel)
        # None without validation windows, and before the first matching
        losses = expected.validation_loss, expected.matching_loss
        close = (loss and pytest.approx(loss, rel=rel) for loss in losses)
        assert (entry.validation_loss, entry.matching_loss) == tuple(close)
        # a sample or two
        assert entry.discriminator_accuracy == pytest.approx(
            expected.discriminator_accuracy, abs=0.06
        )
    for name, weights in single.model.state_dict().items():
        assert torch.allclose(
            bundled.model.state_dict()[name], weights, rtol=1e-3, atol=10 * rel
        ), name


@pytest.mark.parametrize(
    "changes",
    [
        SHARED_L2,
        dict(stopping="released", smoothing=0.9),
        RECIPE,
    ],
    ids=["shared, l2", "released stopping", "the released recipe"],
)
def test_a_bundle_of_one_is_the_trial(make_run, small_network, changes):
    run = make_run(**changes)
    ((number, bundled, seconds),) = train_bundle([run], small_network, slots=1)
    assert number == 0 and seconds > 0
    assert_same(bundled, alone(run, small_network))


@pytest.mark.parametrize("slots", [1, 2, 5])
def test_a_bundle_of_unlike_trials_is_each_of_them(five, small_network, slots):
    """Finished trials wait for the others; then the next bundle begins."""
    reported = []

    def report(*progress):
        reported.append(progress)

    ended = results(train_bundle(five, small_network, slots, progress=report))
    assert list(ended) != sorted(ended) or slots < 5
    assert set(ended) == set(range(5))
    for number, run in enumerate(five):
        assert_same(ended[number], alone(run, small_network))
        tests = [test for reporter, test in reported if reporter == number]
        assert tests == ended[number].history


def test_a_loss_that_is_not_finite_ends_that_trial_alone(five, small_network):
    five[2].datasets.train.targets[:, 0] = float("inf")
    five[4] = five[4]._replace(
        training=dataclasses.replace(five[4].training, learning_rate=1e11)
    )
    ended = results(train_bundle(five, small_network, slots=3))
    for number, what in ((2, "training"), (4, "test|training")):
        assert isinstance(ended[number], TrainingError) and ended[number].iteration == 4
        with pytest.raises(
            TrainingError, match=f"the ({what}) loss is (nan|inf) after 4 iterations"
        ):
            alone(five[number], small_network)
    for number in (0, 1, 3):
        assert_same(ended[number], alone(five[number], small_network))


def test_a_trial_that_ends_within_a_phase(make_run, small_network):
    """A finished trial waits until the phase of the others ends.

    This holds also where its first test comes last.
    """
    runs = [make_run(0), make_run(1, max_samples=24 * 2)]
    for number, bundled, _ in train_bundle(runs, small_network, slots=2):
        assert_same(bundled, alone(runs[number], small_network))


def test_a_finished_checkpoint(make_run, small_network, tmp_path):
    """Nothing remains but to return the result."""
    run = make_run(checkpoint=tmp_path)
    first = train(
        run.datasets, small_network, run.training, run.seed, checkpoint=tmp_path
    )
    ((_, again, _),) = train_bundle([run], small_network, slots=3)
    assert_same(again, first, rel=1e-7)


def test_the_released_recipe_side_by_side_and_from_checkpoints(
    make_run, small_network, tmp_path
):
    """Runs have different seeds, which draw different systems; they stop and resume."""
    runs = [
        make_run(seed, max_samples=24 * 30, checkpoint=tmp_path / str(seed), **RECIPE)
        for seed in range(3)
    ]
    expected = [alone(run, small_network) for run in runs]
    for run in runs:
        trainer = Trainer(run.datasets, small_network, run.training, run.seed)
        prediction_phase(trainer)
        regularisation_phase(trainer)
        Checkpoint(run.checkpoint).save(trainer)
    for number, bundled, _ in train_bundle(runs, small_network, slots=2):
        assert_same(bundled, expected[number])


def test_a_bundle_that_the_memory_does_not_hold_is_refused_in_one_line(
    make_run, small_network, monkeypatch
):
    def full(self, progress):
        raise torch.OutOfMemoryError("a long report")

    monkeypatch.setattr(Bundle, "phase", full)
    with pytest.raises(
        ConfigError,
        match="^the memory of cpu does not hold 2 trials side by side; "
        "choose a smaller",
    ):
        list(train_bundle([make_run(0), make_run(1)], small_network, slots=3))
    with pytest.raises(
        ConfigError,
        match=r"^the memory of cpu does not hold the trial; choose smaller networks",
    ):
        list(train_bundle([make_run(0)], small_network, slots=3))


def test_the_motion_of_a_bundle_has_one_shape(make_run, small_network, make_motion):
    strange = make_run()._replace(datasets=Datasets(*[make_motion(3, steps=7)] * 4))
    with pytest.raises(
        ConfigError, match=r"must have one shape, not \[\(6, 8, 8\), \(7, 8, 8\)\]"
    ):
        next(train_bundle([make_run(), strange], small_network, slots=2))
    assert list(train_bundle([], small_network, slots=2)) == []


def test_rounding_of_products_is_set_and_put_back():
    matrices, networks = torch.backends.cuda.matmul, torch.backends.cudnn
    before = matrices.allow_tf32, networks.allow_tf32
    for precision, rounded in (("float32", False), ("tf32", True)):
        with matmul_precision(precision):
            assert matrices.allow_tf32 is networks.allow_tf32 is rounded
        assert (matrices.allow_tf32, networks.allow_tf32) == before


def test_shared_data_are_on_the_device_once(make_motion):
    pool, expert = make_motion(10), make_motion(4, seed=1)
    parts = pool.subset([7, 2, 5]), pool.subset([1])
    data = DeviceData([parts[0], expert, parts[1], expert], torch.device("cpu"))
    assert len(data.windows) == 14 and data.steps == 6
    for motion in (*parts, pool, expert):
        assert torch.equal(
            data.windows.take(data.rows(motion)).maps,
            motion.take(range(len(motion))).maps,
        )


@pytest.mark.parametrize("decoupled", [True, False])
def test_stacked_adam_is_adam_of_each(decoupled):
    """Settings differ.

    The weights, moments and step count of a trial that does not move stay the same.
    """
    torch.manual_seed(0)
    rates, decays = (1e-2, 3e-3, 1e-1), (0.1, 0.0, 0.5)
    start = torch.randn(3, 4, 2)
    single = [part.clone().requires_grad_() for part in start]
    kind = torch.optim.AdamW if decoupled else torch.optim.Adam
    adams = [
        kind([one], lr=r, weight_decay=d)
        for one, r, d in zip(single, rates, decays, strict=True)
    ]
    stacked = start.clone()
    singles = [
        Single(kind([copy := one.detach().clone()], lr=r, weight_decay=d), {"w": copy})
        for one, r, d in zip(single, rates, decays, strict=True)
    ]
    stacked_adam = StackedAdam({"w": stacked}, singles)
    for _ in range(8):
        gradient, moving = torch.randn(3, 4, 2), torch.rand(3) < 0.7
        stacked_adam.step({"w": gradient}, moving)
        for trial, adam in enumerate(adams):
            if moving[trial]:
                single[trial].grad = gradient[trial]
                adam.step()
    assert torch.allclose(stacked, torch.stack(single).detach(), rtol=1e-5)
    stacked_adam.hand_back(0)
    ((_, taken),) = singles[0].optimiser.state.items()
    expected = adams[0].state[single[0]]
    assert taken["step"] == expected["step"]
    assert torch.allclose(taken["exp_avg_sq"], expected["exp_avg_sq"], rtol=1e-5)


@pytest.mark.parametrize("bad", ["train", "expert"])
def test_data_of_one_trial_do_not_reach_another(make_run, small_network, bad):
    """This holds also where none of a system's trajectories was drawn."""
    runs = [make_run(0), make_run(1, **ALONE), make_run(2)]
    getattr(runs[0].datasets, bad).inputs[:] = float("nan")
    ended = results(train_bundle(runs, small_network, 3))
    assert isinstance(ended[0], TrainingError)
    for number in (1, 2):
        assert_same(ended[number], alone(runs[number], small_network))


def test_a_killed_bundle_goes_on(make_run, small_network, tmp_path, monkeypatch):
    """A bundle resumes from its trials' checkpoints, also with a frozen part.

    They are the checkpoints of trials alone.
    """
    core = pretrained_from(alone(make_run(**ALONE), small_network)).core().weights
    frozen = dict(start=core, frozen="sidm", **ALONE)
    runs = [
        make_run(seed, max_samples=24 * 30, checkpoint=tmp_path / str(seed), **changes)
        for seed, changes in enumerate((frozen, {}, frozen))
    ]
    monkeypatch.setattr("companion.bundle.training.SAVE_INTERVAL", 0.0)

    class Killed(Exception):
        pass

    def kill(number, tested):
        if tested.samples >= 24 * 16:
            raise Killed

    with pytest.raises(Killed):
        list(train_bundle(runs, small_network, 3, progress=kill))
    assert Checkpoint(tmp_path / "1").restore(
        Trainer(runs[1].datasets, small_network, runs[1].training, 1)
    )
    assert_same(
        alone(runs[0], small_network, checkpoint=tmp_path / "0"),
        alone(runs[0], small_network),
    )
    for number, bundled, _ in train_bundle(runs[1:], small_network, 2):
        assert_same(bundled, alone(runs[number + 1], small_network))
