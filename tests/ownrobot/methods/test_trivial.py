"""The yardsticks: nothing changes, and the mean of the training data."""

import torch

from ownrobot.methods.trivial import learn
from sidm.body import ROVER, Body
from sidm.learning import Datasets
from sidm.learning.dataset import Windows
from sidm.learning.evaluation import rollout

CART = Body(
    name="cart",
    pose="planar",
    columns=(("speed", "m/s"),),
    actions=(("throttle", "1"),),
)


def test_nothing_changes_stays_where_it_is(make_motion):
    motion = make_motion(4, 1)
    model = learn(Datasets(motion, motion, motion), ROVER, "nothing_changes").model
    state = torch.tensor([1.0, 2.0, 3.0, 0.0, 0.0, 0.6, 0.8, *range(6)]).double()
    path = rollout(model, torch.zeros(9, 9), state, torch.ones(5, 2), 8)
    assert torch.allclose(path, state.expand(6, -1))


def test_the_mean_is_the_training_datas(rng):
    inputs, targets = (torch.from_numpy(rng.normal(size=(6, 5, n))) for n in (2, 4))
    windows = Windows(inputs.float(), targets.float(), torch.zeros(6, 5, 0, 0))
    train, test = windows.take([0, 1, 2]), windows.take([3, 4, 5])
    trained = learn(Datasets(train, test, test), CART, "mean", torch.ones(4))
    predicted, _ = trained.model("novice", test.inputs, test.maps)
    mean = train.targets.mean((0, 1))
    assert torch.allclose(predicted, mean.expand_as(predicted))
    loss = (test.targets - mean).square().sum(-1).mean()
    assert torch.isclose(torch.tensor(trained.best_test_loss), loss)
