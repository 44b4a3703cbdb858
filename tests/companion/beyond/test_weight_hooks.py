"""Changes of the weights after a step: the pull to the start, the running average."""

import torch

from companion.beyond.weight_hooks import WARM_UP, PullToStart, WeightAverage
from companion.training import StudyTraining
from sidm.learning.evaluation import mean_loss
from sidm.learning.training import prediction_phase


def test_the_pull_is_a_share_of_the_way_back(make_trainer):
    trainer, hook = make_trainer(learning_rate=0.01), PullToStart(10.0)
    hook.begin(trainer)
    weight = trainer.model.sidm.output[0].weight
    before = weight.detach().clone()
    weight.data += 2.0
    hook.after_step(trainer)
    assert torch.allclose(weight, before + 2.0 * 0.9, atol=1e-6)


def test_the_average_is_that_of_its_formula(make_trainer):
    """Early, the average forgets faster.

    After n updates, the past has at most the weight n / (n + WARM_UP).
    """
    trainer, hook = make_trainer(), WeightAverage(0.9)
    hook.begin(trainer)
    weight = trainer.model.sidm.output[0].weight
    expected = weight.detach().clone()
    for number in range(1, 200):
        weight.data += 0.1
        hook.after_step(trainer)
        past = min(0.9, number / (number + WARM_UP))
        expected = past * expected + (1 - past) * weight.detach()
    after = weight.detach().clone()
    with hook.testing():
        assert torch.allclose(weight, expected, atol=1e-4)
        assert not torch.allclose(weight, after, atol=0.1)
    assert torch.equal(weight, after)


def test_tests_see_the_average_and_training_goes_on_without_it(make_trainer):
    trainer, plain = make_trainer(averaging=0.5), make_trainer()
    prediction_phase(trainer), prediction_phase(plain)
    assert all(
        torch.equal(one, plain.weights()[name])
        for name, one in trainer.weights().items()
    )
    trainer.run_test()
    raw = mean_loss(trainer.model, trainer.test)
    with trainer.hooks[0].testing():
        assert (
            trainer.history[-1].test_loss
            == mean_loss(trainer.model, trainer.test)
            != raw
        )


def test_settings_name_what_they_add():
    def names(**changes):
        return [type(hook).__name__ for hook in StudyTraining(**changes).hooks()]

    assert names() == [] == names(matching="mmd", regularise=False)
    expected = ["DistanceMatching", "PullToStart", "WeightAverage", "Mirroring"]
    assert names(matching="coral", tether=1.0, averaging=0.5, mirror=True) == expected
    assert names(matching="reversal") == ["GradientReversal"]
