"""Every method is a configuration of one loop; related methods begin alike."""

import pytest

from companion import METHODS, perform, run, run_trial
from companion.engine.bundles import bundles, fits
from companion.methods import ANY_BODIES, FIGURE3
from companion.numerics import NUMERICS
from ownrobot.methods.least_squares import LeastSquares
from ownrobot.methods.residual import Corrected
from sidm.config import ConfigError
from sidm.learning import DynamicsModel


@pytest.fixture
def trial(study):
    """Function that makes a trial of system 1: trial(method)."""
    return lambda method: study.trial("system1", method, 0.75)


def test_no_two_methods_are_the_same_trial(trial):
    keys = {trial(method).replace(method="one").key for method in METHODS}
    assert len(keys) == len(METHODS)


def test_the_experts_model_is_judged_as_it_is(trial, data):
    """The novice's data do not change it."""
    trained, other = (
        perform(one, data)[0]
        for one in (trial("expert_only"), trial("pretrain_finetune"))
    )
    less = perform(trial("expert_only").replace(novice_minutes=0.25), data)[0]
    assert less.validation_loss == trained.validation_loss
    assert trained.iterations == 0 and trained.curve_samples == (0,)
    assert trained.pretraining_samples == other.pretraining_samples
    assert trained.validation_loss != other.validation_loss


@pytest.mark.parametrize(
    ("method", "kind"), [("residual", Corrected), ("corrected", LeastSquares)]
)
def test_the_experts_model_is_corrected_and_kept(trial, data, method, kind):
    model, expert = (
        perform(trial(name), data)[1].model for name in (method, "expert_only")
    )
    assert isinstance(model, kind) and type(expert) is DynamicsModel
    base = model.base.state_dict()
    assert all(
        (tensor == base[name]).all() for name, tensor in expert.state_dict().items()
    )
    if method == "residual":
        assert any(
            (tensor != base[name]).any()
            for name, tensor in model.correction.state_dict().items()
        )


def test_what_is_solved_depends_on_how_it_is_solved(trial, data):
    """A solved method also names its solver's version; a trained method does not."""
    solved, trained = (
        run_trial(trial(method), data).provenance
        for method in ("least_squares", "expert_only")
    )
    assert solved.numerics == trained.numerics | {
        "least_squares": NUMERICS["least_squares"]
    }
    assert not solved.stale and not trained.stale


def test_bundles_take_the_methods_of_figure_3_and_of_any_bodies_and_refuse_others(
    trial,
):
    assert all(
        fits(trial(method)) for method in (*FIGURE3, *ANY_BODIES, "finetune_parts")
    )
    for method in (
        "pooled",
        "mmd",
        "residual",
        "expert_only",
        "least_squares",
        "corrected",
    ):
        assert not fits(trial(method))
        with pytest.raises(ConfigError, match=f"{method} .*train it alone"):
            bundles([trial(method)])


def test_what_no_bundle_can_train_is_run_alone(trial, data, tmp_path):
    """Such a trial runs beside the bundles, so that a whole grid can be requested."""
    store = run(
        [trial("sidm"), trial("pooled")],
        data=data,
        results=tmp_path,
        progress=False,
        bundle=2,
    )
    assert [
        row.provenance.bundle for row in store.rows([trial("sidm"), trial("pooled")])
    ] == [2, 0]
