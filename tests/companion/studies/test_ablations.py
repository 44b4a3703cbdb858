"""One value changed at a time: its table and its figure."""

import pytest

from companion import Study
from companion.engine.frame import frame_of
from companion.studies import ablations


@pytest.fixture
def study(tmp_path):
    return Study("laptop", tmp_path, tmp_path)


def test_a_table_has_a_line_a_value(study, make_row):
    rows = [
        make_row(t, 1 + t.training.p_expert + t.seed)
        for t in ablations.p_expert(study, "system1")
    ]
    table = ablations.table(frame_of(rows), "p_expert")
    assert list(table.value) == pytest.approx([0, 0.25, 0.5, 0.75, 0.9, 0.959898])
    assert set(table.trials) == {3}
    assert list(table["mean"]) == pytest.approx(list(2 + table.value))
    assert list(table.minimum) == pytest.approx(list(1 + table.value))


def test_without_regularisation_nothing_is_matched(study, make_row):
    rows = [
        make_row(t, 1.0)
        for t in ablations.iterations(study, "system1", "matching_iterations")
    ]
    assert list(ablations.table(frame_of(rows), "matching_iterations").value) == [
        0,
        5,
        20,
        100,
    ]


def test_methods_have_lines_of_their_own_where_asked(study, make_row):
    some = [
        make_row(t, t.network.pixels / (1 + (t.method == "sidm")))
        for t in ablations.pixels(study, "system1")
    ]
    table = ablations.table(frame_of(some), "pixels", by_method=True)
    lines = ablations.figure(table, "pixels", ["system1"]).axes[0].get_lines()
    # the others are caps
    means = [
        line.get_ydata().tolist() for line in lines if line.get_linestyle() != "None"
    ]
    assert means == [[16, 32, 64], [8, 16, 32]]  # without SIDM, with it


def test_a_probability_has_an_axis_of_its_own(study, make_row):
    rows = [
        make_row(t, 1 + t.training.p_expert)
        for t in ablations.p_expert(study, "system1")
    ]
    table = ablations.table(frame_of(rows), "p_expert")
    figure = ablations.figure(table, "p_expert", ["system1"])
    line = figure.axes[0].get_lines()[0]
    assert line.get_ydata() == pytest.approx(1 + line.get_xdata())
    assert len(line.get_xdata()) == 6


def test_the_figure_marks_the_usual_value(study, make_row):
    """Values stand at equal distances, probabilities at their own.

    The value of Figure 3 is marked.
    """
    name = "prediction_iterations"
    some = [
        make_row(t, 1) for t in ablations.iterations(study, "system1", name, [20, 500])
    ]
    axes = ablations.figure(
        ablations.table(frame_of(some), name), name, ["system1"], usual={"system1": 100}
    ).axes[0]
    assert [tick.get_text() for tick in axes.get_xticklabels()] == ["20", "100", "500"]
    marked = next(
        line for line in axes.get_lines() if line.get_label() == "as in Figure 3"
    )
    assert set(marked.get_xdata()) == {1.0}
    assert axes.get_lines()[0].get_xdata().tolist() == [0.0, 2.0]


def test_ablations_stand_side_by_side_on_one_axis_of_losses(study, make_row):
    """A column has a value and a row a system; each row has one range of losses."""
    names = list(ablations.ITERATIONS)
    trials = {name: ablations.iterations(study, "system1", name) for name in names}
    rows = {
        name: [make_row(t, place + t.seed) for t in trials[name]]
        for place, name in enumerate(names, 1)
    }
    tables = {
        name: ablations.table(frame_of(some), name) for name, some in rows.items()
    }
    panels = ablations.comparison_figure(
        tables, ["system1"], {names[0]: {"system1": 100.0}}
    ).axes
    assert [axes.get_lines()[0].get_ydata()[0] for axes in panels] == [2, 3, 4]
    assert len({axes.get_ylim() for axes in panels}) == 1
    marked = [
        [line.get_label() for line in axes.get_lines()].count("as in Figure 3")
        for axes in panels
    ]
    assert marked == [1, 0, 0]


def test_nothing_stored_is_an_empty_figure():
    empty = ablations.table(frame_of([]), "pixels")
    assert (
        ablations.figure(empty, "pixels").axes[0].texts[0].get_text()
        == "no trials stored"
    )
    figure = ablations.comparison_figure({"pixels": empty, "patience": empty})
    assert figure.axes[3].texts[0].get_text() == "no trials stored"
