"""Every method is a configuration of one loop; related methods begin alike."""

import pytest

from companion import METHODS, perform, run_trial
from companion.engine.execute import stored_as
from companion.extensions.residual import Corrected
from companion.numerics import RESULT_VERSIONS, versions
from ownrobot.methods.least_squares import LeastSquares


@pytest.fixture
def trial(study):
    """Function that makes a trial of system 1: trial(method)."""
    return lambda method: study.trial("system1", method, 0.75)


def test_no_two_methods_are_the_same_trial(trial):
    keys = {trial(method).replace(method="one").key for method in METHODS}
    assert len(keys) == len(METHODS)


def test_the_experts_model_is_judged_as_it_is(trial, data):
    """The novice's data do not change it."""
    expert, other = trial("expert_only"), trial("pretrain_finetune")
    trials = expert.replace(novice_minutes=0.25), expert, other
    less, whole, other = (perform(one, data)[0] for one in trials)
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


def test_a_row_depends_on_how_its_trial_is_solved_and_simulated(trial, data, make_row):
    solved, trained = (
        run_trial(trial(method), data).provenance
        for method in ("least_squares", "expert_only")
    )
    version = {"least_squares": RESULT_VERSIONS["least_squares"]}
    assert solved.numerics == trained.numerics | version
    assert not solved.stale and not trained.stale
    row = make_row(trial("sidm"))
    assert stored_as(row.trial, row.outcome, row.provenance) == row
    free = row.trial.replace(system="system1_free_struts")
    numerics = stored_as(free, row.outcome, row.provenance).provenance.numerics
    assert numerics == row.provenance.numerics | versions("free_struts")
