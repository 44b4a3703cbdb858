"""Ablations on a page: Figure 3's value beside those asked for, and what is missing."""

import pytest

from companion import Results, Study, grid
from companion.pages.ablation_results import Ablations
from companion.studies import ablations


class FakePage:
    """Says which commands it was asked for."""

    def again(self, figure):
        return f"run {figure}"

    def command(self, **others):
        return f"page {others}"


@pytest.fixture
def study(tmp_path):
    return Study("laptop", tmp_path, tmp_path)


@pytest.mark.parametrize(
    ("name", "values", "usual"),
    [
        ("p_expert", [0.6, None], 0.5),
        ("matching_iterations", [50], 5),
        ("discriminator_iterations", [7], 20),
        ("prediction_iterations", [7], 100),
        ("pixels", [8], 32),
        ("patience", [7], 150_000),
    ],
)
def test_figure_3s_value_is_among_the_trials(study, name, values, usual):
    assert ablations.usual(study.preset, "system2", name) == usual
    trials = Ablations(study, ["system2"], {name: values}).trials()
    tried = {
        getattr(trial.network if name == "pixels" else trial.training, name)
        for trial in trials
    }
    share = ablations.proportional(study.preset, 5.0)
    assert tried == {usual, *(share if value is None else value for value in values)}
    again = Ablations(study, ["system2"], {name: [*values, usual]}).trials()
    assert {trial.key for trial in again} == {trial.key for trial in trials}


def test_values_of_the_grids_are_run_by_their_figures(study):
    names = ("p_expert", *ablations.ITERATIONS)
    values = {name: ablations.VALUES[name] for name in names}
    systems = ["system1", "system2"]
    all_of_grids = Ablations(study, systems, values)
    assert all_of_grids.commands(FakePage()) == ["run p-expert", "run iterations"]
    wanted = {
        trial.key
        for figure in ("p-expert", "iterations")
        for trial in grid("laptop", figure, data=study.data, results=study.results)
    }
    assert {trial.key for trial in all_of_grids.trials()} == wanted
    own = Ablations(study, systems, values | {"p_expert": [0.6]})
    assert own.commands(FakePage(), "matching_iterations") == ["run iterations"]
    assert own.commands(FakePage()) == ["page {'run_missing': True}"]


def test_without_results_pages_have_titles_and_no_numbers(study):
    shown = Ablations(study, ["system1"], {"p_expert": [0.9], "pixels": [8]}, [5.0, 1])
    assert shown.ratio("p_expert", "system1", 0.9) == "not run"
    titles = [title for title, table in shown.page_tables() if table.empty]
    assert titles == [
        f"{name}, {size} min of novice data"
        for name in ("$p_e$", "Pixels")
        for size in (1, 5)
    ]
    assert len(shown.figure("p_expert", "pixels").axes) == 2


def test_ratios_are_to_figure_3s_value_seed_by_seed(study, make_row):
    shown = Ablations(study, ["system1"], {"matching_iterations": [0, 20]})
    losses = {0: 0.3, 20: 0.1, 5: 0.2}
    store = Results(study.results)
    for trial in shown.trials():
        regularised = trial.training.regularise
        value = trial.training.matching_iterations if regularised else 0
        store.put(make_row(trial, losses[value]))
    assert shown.ratio("matching_iterations", "system1", 20).startswith("0.50 ")
    assert shown.ratio("matching_iterations", "system1", 0).startswith("1.5 ")
    ((_, table),) = shown.page_tables()
    assert table.value.tolist() == ["0", "5", "20"]
    assert table.iloc[:, -1].str[:5].tolist() == ["1.50 ", "-", "0.500"]
