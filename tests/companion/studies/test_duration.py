"""The length of training: made-up results of both ways to train."""

import pandas as pd
import pytest

from companion import Study
from companion.engine.frame import frame_of
from companion.studies import duration


@pytest.fixture
def every(tmp_path, make_row) -> pd.DataFrame:
    """Results with a saving of 4 as the authors train, without one as the book does."""

    def loss(trial) -> float:
        slow, alone = trial.training.batch == 2, trial.method == "novice_only"
        return 2 / (trial.novice_minutes / (4 if slow and alone else 1)) ** 0.5

    trials = duration.trials(Study("study", tmp_path, tmp_path), "system1")
    return frame_of(make_row(trial, loss(trial)) for trial in trials)


def test_the_two_ways_to_train_are_told_apart(every):
    table = duration.table(every)
    sizes = table.groupby("trained").novice_minutes.apply(set)
    assert sizes[duration.BY_AUTHORS] == set(duration.RELEASED_SEEDS["sidm"])
    assert sizes[duration.BY_BOOK] == {5.0}
    by_authors = duration.by_authors(every)
    assert len(by_authors) == (table.trained == duration.BY_AUTHORS).sum()
    assert set(by_authors.batch) == {2}
