"""The numbers that README and pages quote: computed from results, or 'not run'."""

import re
from pathlib import Path

import pandas as pd
import pytest
from pages import ROOT

from companion import Results, Study, grid
from companion.__main__ import build_parser
from companion.pages import all_savings, figure3_results, headline, readings
from companion.pages.ablation_results import Ablations
from companion.pages.figure3_results import Figure3
from companion.pages.page import glued
from companion.statistics import claims
from companion.studies import ablations
from companion.studies.decisive import search, verdicts
from ownrobot.comparison.statistics import Interval
from sidm.systems import PAPER_SYSTEMS

#: number of the page on Figure 3 -> its verdict and its pair of robots
PUBLISHED = {
    "released-saving": ("R1", "system1"),
    "released-saving-2": ("R1", "system2"),
    "end-saving": ("R2", "system1"),
    "end-saving-2": ("R2", "system2"),
    "tuned-released": ("T1", "system1"),
    "tuned-saving": ("T2", "system1"),
}


@pytest.fixture(scope="module")
def store():
    return Results(ROOT / "results")


@pytest.fixture(scope="module")
def decisive(store):
    """The long trainings."""
    return verdicts.results(Study("study"), store)


def ratios(rows) -> list[str]:
    """Texts of the ratios of verdicts."""
    return [Interval(r.value, r.low, r.high).text(2) for r in rows.itertuples()]


def test_quoted_numbers_are_the_verdicts(decisive):
    judged = verdicts.verdicts(decisive)
    judged = judged[judged.method == "sidm"].set_index(["verdict", "system"])
    texts = dict(figure3_results.long_numbers(decisive))
    shown = [texts[name] for name in PUBLISHED]
    assert shown == ratios(judged.loc[list(PUBLISHED.values())])
    assert "not run" not in texts.values()


@pytest.mark.parametrize("count", [0, 8])
def test_what_lacks_results_is_not_run(tmp_path, make_row, count):
    store, study = Results(tmp_path), Study("study")
    for trial in search.compare_units(study)[:count:3]:
        store.put(make_row(trial))
    frame = verdicts.results(study, store)
    assert {text for _, text in figure3_results.long_numbers(frame)} == {"not run"}
    units = figure3_results.unit_numbers(store.frame(search.compare_units(study)))
    assert {text for _, text in units} == {"not run"}
    assert not len(readings.page_table(readings.readings(store)))
    table = all_savings.table(frame, Figure3(study, store, PAPER_SYSTEMS).saved)
    assert not len(table) and list(table.columns) == all_savings.COLUMNS
    assert list(map(len, all_savings.by_recipe(table).values())) == [0, 0, 0]


def test_the_table_of_all_savings_has_the_verdicts_and_the_claims(store, decisive):
    saved = Figure3(Study("study"), store, PAPER_SYSTEMS).saved
    table = all_savings.table(decisive, saved)
    assert not table.duplicated(["Settings", "Stopped by", "Pair"]).any()
    assert table.notna().all(axis=None)
    parts = pd.concat(all_savings.by_recipe(table), names=["recipe"])
    assert set(parts.index.get_level_values("recipe")) == {"R", "T", "Q"}
    sizes = parts.droplevel(0).sort_index()[table.columns.drop("Settings")]
    pd.testing.assert_frame_equal(sizes, table.drop(columns="Settings"))
    judged = verdicts.data_ratios(decisive).query("method == 'sidm' and value == value")
    shown = table[table["Stopped by"].isin([verdicts.RELEASED, verdicts.END])]
    shown = shown[shown.Settings != all_savings.MIXED]
    assert sorted(shown["5 min"]) == sorted(ratios(judged)) and len(shown) >= 6
    figure3 = store.frame(grid("study", "3"))
    quick = table[table.Settings == "quick (Q)"].set_index("Pair")["5 min"]
    for system, label in (("system1", "system 1"), ("system2", "system 2")):
        assert [quick[label]] == ratios(claims.data_saving_claim(figure3, system))


def losses(method, factor, **columns):
    """Losses of three seeds on system 1 with 5 minutes."""
    about = {"system": "system1", "method": method, "novice_minutes": 5.0}
    values = [factor, 1.02 * factor, 0.99 * factor]
    about |= {"seed": range(3), "validation_loss": values}
    return pd.DataFrame(about | columns)


@pytest.mark.parametrize(
    ("tuned", "kept", "core", "verdict"),
    [
        (0.5, 0.6, 0.7, claims.CONTRARY),
        (2.0, 1.5, 1.2, claims.DIRECTION),
        (1.0, 1.0, 1.0, claims.NOT_SEEN),
    ],
)
def test_pretraining_has_three_readings(tuned, kept, core, verdict):
    """The narrowest comes first, at two sizes."""
    factors = {"sidm": 1.0, "pretrain_finetune": tuned, "finetune_parts": kept}
    baselines = pd.concat(losses(*item) for item in factors.items())
    bodies = pd.concat(
        losses(method, factor * scale, novice_body=body, novice_minutes=minutes)
        for method, factor in (("sidm", 1.0), ("core_finetune", core))
        for body, scale in (("no map", 1.0), ("planar", 3.0))
        for minutes in (1.0, 5.0)
    )
    rows = pd.concat(readings.pretraining(baselines, bodies))
    assert rows.verdict.tolist() == [verdict] * 4
    assert rows.reading.is_unique
    narrow = rows.reading.str.startswith("core alone")
    assert narrow.tolist() == [True, True, False, False]


def test_the_books_readings_are_those_of_its_parts(store, decisive):
    rows = readings.readings(store)
    named = ["statement", "reading", "system"]
    assert not rows.duplicated(named).any()
    judged = verdicts.verdicts(decisive)
    first = judged[(judged.verdict == "R1") & (judged.system == "system1")].iloc[0]
    assert rows.verdict[0] == first.says and f"{first.value:.1f}" in rows.ours[0]
    assert len(readings.page_table(rows)) == len(rows) > 9


def named(names) -> list[tuple[Path, str]]:
    """The notebook of each number's chapter, and the number's name."""
    return [(headline.NOTEBOOKS / f"{page}.ipynb", name) for page, name in names]


def test_the_readme_says_what_is_stored(monkeypatch):
    """The numbers in bold are those of chapters, each with its interval."""
    monkeypatch.chdir(ROOT)
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    texts = [glued(page, name)[0] for page, name in named(headline.README)]
    numbers = re.findall(r"[\d.]+", " ".join(texts))
    bold = re.findall(r"\*\*([\d.]+)\*\*", text)
    assert bold == numbers and len(bold) == 15, "write its sentences anew"
    assert (ROOT / headline.FIGURE).stat().st_size < 200_000


def test_every_number_of_readme_and_first_page_has_its_command(monkeypatch):
    monkeypatch.chdir(ROOT)
    text = headline.FIRST_PAGE.read_text(encoding="utf-8")
    names = headline.GLUED.findall(text)
    assert len(names) == text.count("{glue:text}") > 0
    for page, name in named([*headline.README, *names]):
        number, command = glued(page, name)
        assert re.match(r"(at least )?-?\d", number), name
        build_parser().parse_args(command.split()[1:])


class FakePage:
    """Says which commands it was asked for."""

    def again(self, figure):
        return f"run {figure}"

    def command(self, **others):
        return f"page {others}"


@pytest.mark.parametrize(
    ("name", "values", "usual"),
    [
        ("p_expert", [0.6, None], 0.5),
        ("matching_iterations", [50], 5),
        ("pixels", [8], 32),
        ("patience", [7], 150_000),
    ],
)
def test_figure_3s_value_is_among_its_trials(laptop, store, name, values, usual):
    assert ablations.usual(laptop.preset, "system2", name) == usual
    trials = Ablations(laptop, store, ["system2"], {name: values}).trials()
    tried = {
        getattr(trial.network if name == "pixels" else trial.training, name)
        for trial in trials
    }
    share = ablations.proportional(laptop.preset, 5.0)
    assert tried == {usual, *(share if value is None else value for value in values)}
    again = Ablations(laptop, store, ["system2"], {name: [*values, usual]}).trials()
    assert {trial.key for trial in again} == {trial.key for trial in trials}


def test_values_of_the_grids_are_run_by_their_figures(laptop, store):
    names = ("p_expert", *ablations.ITERATIONS)
    values = {name: ablations.VALUES[name] for name in names}
    systems = ["system1", "system2"]
    all_of_grids = Ablations(laptop, store, systems, values)
    assert all_of_grids.commands(FakePage()) == ["run p-expert", "run iterations"]
    own = Ablations(laptop, store, systems, values | {"p_expert": [0.6]})
    assert own.commands(FakePage(), "matching_iterations") == ["run iterations"]
    assert own.commands(FakePage()) == ["page {'run_missing': True}"]


def test_without_results_ablations_have_titles_and_no_numbers(laptop, tmp_path):
    values = {"p_expert": [0.9], "pixels": [8]}
    shown = Ablations(laptop, Results(tmp_path), ["system1"], values, [5.0, 1])
    assert shown.ratio("p_expert", "system1", 0.9) == "not run"
    titles = [title for title, table in shown.page_tables() if table.empty]
    assert titles == [
        f"{name}, {size} min of novice data"
        for name in ("$p_e$", "Pixels")
        for size in (1, 5)
    ]
    assert len(shown.figure("p_expert", "pixels").axes) == 2


def test_ratios_are_to_figure_3s_value_seed_by_seed(laptop, make_row, tmp_path):
    store = Results(tmp_path)
    shown = Ablations(laptop, store, ["system1"], {"matching_iterations": [0, 20]})
    losses = {0: 0.3, 20: 0.1, 5: 0.2}
    for trial in shown.trials():
        regularised = trial.training.regularise
        value = trial.training.matching_iterations if regularised else 0
        store.put(make_row(trial, losses[value]))
    assert shown.ratio("matching_iterations", "system1", 20).startswith("0.50 ")
    assert shown.ratio("matching_iterations", "system1", 0).startswith("1.5 ")
    ((_, table),) = shown.page_tables()
    assert table.value.tolist() == ["0", "5", "20"]
    assert table.iloc[:, -1].str[:5].tolist() == ["1.50 ", "-", "0.500"]
