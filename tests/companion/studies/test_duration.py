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


def test_losses_by_size_stand_beside_figure_3(every, tmp_path):
    """On the left, training without SIDM needs four times the data.

    On the right nothing is stored.
    """
    figure = duration.by_size(every, every[:0])
    left, right = figure.axes
    curves = {line.get_label(): line.get_xydata() for line in left.lines}
    assert [minutes for minutes, _ in curves["with SIDM"]] == sorted(
        duration.RELEASED_SEEDS["sidm"]
    )
    assert curves["without SIDM"][:, 1] == pytest.approx(2 * curves["with SIDM"][:, 1])
    assert not right.lines and right.texts[0].get_text() == "no trials stored"
