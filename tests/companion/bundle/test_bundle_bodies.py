"""Bundles of other robots, or of two bodies, agree with trials alone."""

import dataclasses

import pytest
import torch

from companion.bundle import train_bundle
from ownrobot.methods.fine_tuning import pretrained_from, pretraining_datasets
from sidm.body import DRIVE, ROVER, TWIST, Body
from sidm.learning import TrainingError
from sidm.learning.resuming import Checkpoint
from sidm.learning.trainer import Trainer
from tests.companion.bundle.test_bundle import alone, assert_same, results
from tests.sidm.learning.test_other_bodies import ARM, BLIND, TRACKED

ALONE = dict(p_expert=0.0, regularise=False)
FINE = Body(
    name="fine map",
    tilt=True,
    columns=TWIST,
    actions=DRIVE,
    map_size=3.0,
    map_pixels=10,
)
PAIRS = [
    (TRACKED, ROVER),
    (ROVER, BLIND),
    (FINE, ROVER),
    (ARM, TRACKED),
    (TRACKED, TRACKED),
    (FINE, FINE),
]


@pytest.fixture
def network_of(small_network):
    return lambda pair: dataclasses.replace(
        small_network, novice_body=pair[0], expert_body=pair[1]
    )


@pytest.mark.parametrize("slots", [1, 3])
@pytest.mark.parametrize(
    "pair", PAIRS, ids=lambda pair: f"{pair[0].name} of {pair[1].name}"
)
def test_a_bundle_of_any_bodies_is_each_of_its_trials(
    make_run, network_of, pair, slots
):
    """The methods are SIDM, SIDM without the adversary, and the novice alone."""
    runs = [
        make_run(0, pair),
        make_run(1, pair, regularise=False, max_samples=24 * 8),
        make_run(2, pair, **ALONE),
    ]
    for number, bundled, _ in train_bundle(runs, network_of(pair), slots):
        assert_same(bundled, alone(runs[number], network_of(pair)))


def test_a_pretrained_core_is_fine_tuned_or_frozen(make_run, network_of):
    """Bundles start from weights that another bundle learnt from the expert alone."""
    pair, first = (TRACKED, ROVER), network_of((ROVER, ROVER))
    made = make_run(0, pair, **ALONE)
    expert = made._replace(datasets=pretraining_datasets(made.datasets, 0))
    ((_, pretrained, _),) = train_bundle([expert], first, 1)
    assert_same(pretrained, alone(expert, first))
    core = pretrained_from(pretrained).core().weights
    runs = [
        make_run(3, pair, start=core, frozen=frozen, weight_decay=0.1, **ALONE)
        for frozen in ("nothing", "sidm")
    ]
    ended = results(train_bundle(runs, network_of(pair), 2))
    for number, run in enumerate(runs):
        assert_same(ended[number], alone(run, network_of(pair)))
        kept = ended[number].model.sidm.state_dict()
        assert all(
            torch.equal(one, core[f"sidm.{name}"]) for name, one in kept.items()
        ) == (number == 1)


def test_weights_of_the_loss_are_the_novices_whatever_it_starts_from(
    make_run, network_of
):
    """Start weights bring their units, but not the weights of the loss's components."""
    network = network_of((TRACKED, TRACKED))
    made = make_run(0, (TRACKED, TRACKED), **ALONE)
    start = pretrained_from(
        alone(made._replace(datasets=pretraining_datasets(made.datasets, 0)), network)
    ).weights
    ((_, bundled, _),) = train_bundle([run := made._replace(start=start)], network, 1)
    assert_same(bundled, alone(run, network))


@pytest.mark.parametrize("pair", [(TRACKED, ROVER), (ROVER, ROVER)])
@pytest.mark.parametrize("bad", ["train", "expert"])
def test_data_of_one_trial_do_not_reach_another(make_run, network_of, bad, pair):
    """This holds also where none of a system's trajectories was drawn."""
    network = network_of(pair)
    runs = [make_run(0, pair), make_run(1, pair, **ALONE), make_run(2, pair)]
    getattr(runs[0].datasets, bad).inputs[:] = float("nan")
    ended = results(train_bundle(runs, network, 3))
    assert isinstance(ended[0], TrainingError)
    for number in (1, 2):
        assert_same(ended[number], alone(runs[number], network))


def test_a_killed_bundle_goes_on(make_run, network_of, tmp_path, monkeypatch):
    """A bundle resumes from its trials' checkpoints, also with a frozen part.

    They are the checkpoints of trials alone.
    """
    pair, network = (TRACKED, ROVER), network_of((TRACKED, ROVER))
    core = (
        pretrained_from(alone(make_run(**ALONE), network_of((ROVER, ROVER))))
        .core()
        .weights
    )
    frozen = dict(start=core, frozen="sidm", **ALONE)
    runs = [
        make_run(
            seed, pair, max_samples=24 * 30, checkpoint=tmp_path / str(seed), **changes
        )
        for seed, changes in enumerate((frozen, {}, frozen))
    ]
    monkeypatch.setattr("companion.bundle.training.SAVE_INTERVAL", 0.0)

    class Killed(Exception):
        pass

    def kill(number, tested):
        if tested.samples >= 24 * 16:
            raise Killed

    with pytest.raises(Killed):
        list(train_bundle(runs, network, 3, progress=kill))
    assert Checkpoint(tmp_path / "1").restore(
        Trainer(runs[1].datasets, network, runs[1].training, 1)
    )
    assert_same(
        alone(runs[0], network, checkpoint=tmp_path / "0"), alone(runs[0], network)
    )
    for number, bundled, _ in train_bundle(runs[1:], network, 2):
        assert_same(bundled, alone(runs[number + 1], network))
