"""The length of training: what is trained for long."""

from companion import Study
from companion.studies import duration


def test_both_methods_train_past_the_presets_patience(tmp_path):
    study = Study("study", tmp_path, tmp_path)
    trials = duration.trials(study, "system1")
    kinds = {(t.method, t.training.p_expert) for t in trials}
    paper = study.preset.p_expert("system1")
    assert kinds == {
        ("novice_only", 0.0),
        ("sidm", paper),
        ("sidm", duration.MANY_EXPERTS),
    }
    assert len(trials) == duration.SEEDS * len(kinds)
    assert all(t.training.patience > study.preset.training.patience for t in trials)
