"""Tables of stored trials."""

import numpy as np
import pandas as pd
import pytest

from companion import Results, Study
from companion.engine.frame import frame_of
from companion.statistics.tables import (
    COMPONENTS,
    component_errors,
    costs,
    loss_summary,
    overview,
    wide,
)
from companion.studies import ablations
from sidm.learning.observation import TARGET_SIZE


@pytest.fixture
def trials(tiny):
    study = Study(tiny)
    return study.figure3("system1") + study.figure3("system2")


def test_spread_is_over_the_rows_of_a_key(trials, make_row):
    pairs = zip(trials[3:], (1.0, 2.0, 3.0, 4.0, 5.0, 6.0), strict=True)
    rows = [make_row(trial, loss) for trial, loss in pairs]
    lines = loss_summary(frame_of(rows), ["system"])
    assert lines.values.tolist() == [
        ["system1", 3, 2.0, 1.0, 3.0],
        ["system2", 3, 5.0, 4.0, 6.0],
    ]
    assert list(lines.columns) == ["system", "trials", "mean", "minimum", "maximum"]
    assert len(loss_summary(frame_of([]), ["system"])) == 0


def test_costs_are_by_system_and_method(trials, make_row):
    # each trial takes 12 s
    rows = [make_row(trial) for trial in trials if trial.system == "system1"]
    lines = costs(frame_of(rows))
    assert set(lines.method) == {"sidm", "novice_only", "pretrain_finetune"}
    assert lines.trials.sum() == len(rows)
    assert set(lines["mean (min)"]) == set(lines["longest (min)"]) == {0.2}


def test_component_errors_are_roots_of_mean_squares():
    rows = component_errors(
        {
            "few": [[4.0] * TARGET_SIZE, [14.0] * TARGET_SIZE],
            "many": [[1.0] * TARGET_SIZE],
        }
    )
    assert len(rows) == len(COMPONENTS) + 1 == TARGET_SIZE + 1
    assert rows.component[3] == "quaternion x" and rows.unit[12] == "rad/s"
    np.testing.assert_allclose(
        rows[["few", "many"]][:-1].astype(float), [[3.0, 1.0]] * TARGET_SIZE
    )
    assert rows.few.iloc[-1] == 9 * TARGET_SIZE
    assert len(component_errors({})) == TARGET_SIZE + 1


def test_an_overview_counts_what_is_stored_and_names_what_is_changed(
    figure3_rows, laptop, tmp_path
):
    store = Results(tmp_path)
    store.put(figure3_rows[0])
    lines = overview(store, ablations.p_expert(laptop, "system1"), laptop)
    assert any("(p_expert=0.25)" in text for text in lines)
    assert all("of 3" in text for text in lines)
    assert (
        "stored 1 of 3  stale 0  loss 0.5"
        in overview(store, laptop.figure3("system1"), laptop)[0]
    )


def test_a_wide_table_has_rows_and_columns_in_their_order_and_a_dash_where_nothing_is():
    long = pd.DataFrame(
        {
            "size": [5, 5, 1],
            "method": ["sidm", "alone", "sidm"],
            "loss": ["0.3 (0 to 1)", "0.4", "0.5"],
        }
    )
    table = wide(long, ["size"], "method", "loss")
    assert table.columns.tolist() == ["size", "sidm", "alone"]
    assert table.to_numpy().tolist() == [
        [5, "0.3 (0\N{NO-BREAK SPACE}to\N{NO-BREAK SPACE}1)", "0.4"],
        [1, "0.5", "-"],
    ]
    assert len(wide(long[:0], ["size"], "method", "loss")) == 0
