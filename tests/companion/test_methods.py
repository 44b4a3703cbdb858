"""Every method is a configuration of one loop; related methods begin alike."""

import pytest

from companion import METHODS, perform, run, run_trial
from companion.engine.bundles import bundles, fits
from companion.methods import ANY_BODIES, FIGURE3
from companion.numerics import NUMERICS
from ownrobot.methods.least_squares import LeastSquares
from ownrobot.methods.residual import Corrected
from sidm.config import ConfigError


@pytest.fixture
def trial(study):
    """Function that makes a trial of system 1: trial(method)."""
    return lambda method: study.trial("system1", method, 0.75)


def test_no_two_methods_are_the_same_trial(trial):
    keys = {trial(method).replace(method="one").key for method in METHODS}
    assert len(keys) == len(METHODS)


def test_the_experts_model_is_judged_as_it_is(trial, data):
    """The novice's data do not change it."""
    expert = trial("expert_only")
    less, whole, other = (
        perform(one, data)[0]
        for one in (
            expert.replace(novice_minutes=0.25),
            expert,
            trial("pretrain_finetune"),
        )
    )
    assert less.validation_loss == whole.validation_loss
    assert whole.iterations == 0 and whole.curve_samples == (0,)
    assert whole.pretraining_samples == other.pretraining_samples
    assert whole.validation_loss != other.validation_loss


@pytest.mark.parametrize(
    ("method", "kind"), [("residual", Corrected), ("corrected", LeastSquares)]
)
def test_the_experts_model_is_corrected_and_kept(trial, data, method, kind):
    model, expert = (
        perform(trial(name), data)[1].model for name in (method, "expert_only")
    )
    assert isinstance(model, kind)
    base = model.base.state_dict()
    kept = expert.state_dict().items()
    assert all((tensor == base[name]).all() for name, tensor in kept)
    if method == "residual":
        learnt = model.correction.state_dict().items()
        assert any((tensor != base[name]).any() for name, tensor in learnt)


def test_what_is_solved_depends_on_how_it_is_solved(trial, data):
    solved, trained = (
        run_trial(trial(method), data).provenance
        for method in ("least_squares", "expert_only")
    )
    version = {"least_squares": NUMERICS["least_squares"]}
    assert solved.numerics == trained.numerics | version
    assert not solved.stale and not trained.stale


def test_bundles_take_methods_of_one_loop_and_refuse_others(trial):
    for method in (*FIGURE3, *ANY_BODIES, "finetune_parts"):
        assert fits(trial(method))
    for method in ("pooled", "mmd", "residual", "expert_only", "least_squares"):
        assert not fits(trial(method))
        with pytest.raises(ConfigError, match=f"{method} .*train it alone"):
            bundles([trial(method)])


def test_what_no_bundle_can_train_is_run_alone_beside_the_bundles(
    trial, data, tmp_path
):
    trials = [trial("sidm"), trial("pooled")]
    store = run(trials, data=data, results=tmp_path, progress=False, bundle=2)
    assert [row.provenance.bundle for row in store.rows(trials)] == [2, 0]
