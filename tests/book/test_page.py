"""A notebook says what it was run with, and its text has the numbers of its run."""

import json
import shlex

import myst_nb
import pytest
from IPython.display import HTML
from IPython.utils.capture import capture_output
from pages import ROOT

from companion.__main__ import build_parser
from companion.pages.page import Page, glue
from companion.pages.parameters import inspect
from sidm.config import ConfigError

NAME = "02-collecting"


@pytest.fixture
def make_page(monkeypatch, shell):
    """Function that makes the page of a chapter with some parameters changed."""
    monkeypatch.chdir(ROOT)

    def make(name: str = NAME, **changes):
        path = ROOT / "notebooks" / f"{name}.ipynb"
        values = {key: one.value for key, one in inspect(path).items()} | changes
        with capture_output() as shown:
            page = Page(name, values)
        return page, [output.data["text/markdown"] for output in shown.outputs]

    return make


def test_with_its_own_parameters_a_page_has_no_banner(make_page):
    page, shown = make_page(data=str(ROOT / "data"))
    assert shown == [] and page.changed == {}


def test_the_banner_names_what_differs(make_page):
    _, (banner,) = make_page(system="system2", count=12)
    assert "`system = system2`, `count = 12`" in banner and "seed" not in banner
    _, shown = make_page(data="elsewhere")  # where it works changes nothing
    assert shown == []


def test_a_value_out_of_range_stops_plain_papermill_too(make_page):
    with pytest.raises(ConfigError, match="'count' must be at least 1, not 0"):
        make_page(count=0)
    with pytest.raises(ConfigError, match="'count' must be int, not str"):
        make_page(count="4")


def test_text_has_numbers_in_place_of_names(make_page):
    page, _ = make_page(ratio=1.5, share=0.1 + 0.2, words="five")
    with capture_output():
        page.glue("system1-saving", "1.3 (0.97 to 1.7)")
    assert page.fill(
        "{system1-saving} and {ratio} and {share}, {words}, `{count}`, {role}"
    ) == ("1.3 (0.97 to 1.7) and 1.5 and 0.3, five, `4`, novice")


@pytest.mark.parametrize(
    "text",
    [
        "{py:func}`~sidm.train` {cite}`wang2021domain`",
        "```{dropdown} The data",
        r"$\hat{x}_{n}^{2}$ and $x_{count}$",
        "```{literalinclude} ../sidm/terrain.py",
    ],
)
def test_roles_directives_and_equations_stay(make_page, text):
    assert make_page()[0].fill(text) == text


def test_a_number_that_is_not_there_is_an_error(make_page):
    page, _ = make_page()
    with pytest.raises(NameError, match="the text has '{sedes}'"):
        page.fill("{sedes}")


def test_another_pages_number_is_the_stored_one(make_page):
    page, _ = make_page()
    text = page.fill("{04-figure3::tuned-saving}")
    stored = (ROOT / "notebooks" / "04-figure3.ipynb").read_text(encoding="utf-8")
    assert text and json.dumps(f"'{text}'") in stored
    with pytest.raises(ValueError, match="04-figure3.ipynb glues no 'nothing'"):
        page.fill("{04-figure3::nothing}")


@pytest.mark.parametrize("thing", [HTML("<p>3</p>"), "text", 2.5])
def test_what_is_glued_is_what_myst_nb_takes_over(thing, shell):
    with capture_output() as kept:
        glue("saving", thing)
        myst_nb.glue("saving", thing, display=False)
    output, expected = kept.outputs
    assert output.data == expected.data and output.metadata == expected.metadata
    assert not any(kind.startswith("text/") for kind in output.data)


def test_commands_run_the_page_again_as_it_was_run(make_page):
    page, _ = make_page(
        "04-figure3", preset="laptop seeds=2", systems=["system1"], results="my results"
    )
    words = shlex.split(page.command("out.ipynb"))
    assert words[:4] == ["companion", "notebook", "04-figure3", "out.ipynb"]
    given = dict(zip(words[5::3], words[6::3], strict=True))
    assert given == {
        "preset": "laptop seeds=2",
        "systems": '["system1"]',
        "results": "my results",
    }
    build_parser().parse_args(words[1:])
    arguments = build_parser().parse_args(shlex.split(page.again("3"))[1:])
    assert (arguments.preset, arguments.figure) == ("laptop seeds=2", "3")
    assert (arguments.system, arguments.results) == ("system1", "my results")


def test_by_default_a_command_has_no_folders(make_page):
    page, _ = make_page("04-figure3")
    assert page.again("3") == "companion run --preset study --figure 3"
    assert page.again("decisive", "study", "--steps", "A1") == (
        "companion run --preset study --figure decisive --steps A1"
    )
