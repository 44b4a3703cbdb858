"""Clumsy and hostile input ends in one line of error.

Nothing that is typed or lies in a file is executed.
"""

import dataclasses
import json
from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from companion import PRESETS, load_preset
from companion.__main__ import main
from companion.engine.lines import line_of
from companion.pages import parameters
from sidm.config import ConfigError
from sidm.learning import Network, Training

ROOT = Path(__file__).parents[2]
KINDS = type(PRESETS["smoke"]), Network, Training
NAMES = sorted({field.name for kind in KINDS for field in dataclasses.fields(kind)})
NASTY = [
    *"|>%@`'\":-?*0~",
    ".nan",
    "-.inf",
    "1e308",
    "1e999",
    "99999999999999999999",
    "true",
    "null",
    "[nan]",
    "{a: 1}",
    "../../x",
    "$(touch sprung)",
    "!!python/name:os.system",
    "!!python/object/apply:os.system ['touch sprung']",
    "&a [*a]",
    "!!binary aGk=",
    "2026-11-21",
    "\x00",
]
values = st.one_of(
    st.sampled_from(NASTY),
    st.text(max_size=20),
    st.floats().map(str),
    st.integers().map(str),
)
words = st.text(max_size=8)
documents = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | words,
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(words, inner, max_size=4)
    ),
    max_leaves=8,
)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty working folder inside a folder that must not change."""
    (tmp_path / "inside").mkdir()
    monkeypatch.chdir(tmp_path / "inside")
    return tmp_path


def tree(folder: Path) -> set[Path]:
    return {path for path in folder.rglob("*") if path != folder / "inside"}


def run(words, capsys) -> int:
    """Exit status of a command line, whose error must be one line."""
    try:
        status = main(words)
    except SystemExit as end:  # argparse
        status = end.code
    error = capsys.readouterr().err
    assert status in (0, 1, 2)
    assert error.count("\n") == (status != 0) and "Traceback" not in error, error
    return status


@given(name=st.one_of(st.sampled_from(NAMES), st.text(max_size=12)), value=values)
def test_any_value_of_a_preset(folder, capsys, name, value):
    run(["show", "--preset", "smoke", "--set", f"{name}={value}"], capsys)
    assert tree(folder) == set()


@given(
    words=st.lists(
        st.one_of(
            values,
            st.sampled_from(["--preset", "--set", "--figure", "--minutes", "--seeds"]),
        )
    )
)
def test_any_words(folder, capsys, words):
    run(["show", *words], capsys)
    assert tree(folder) == set()


@pytest.mark.parametrize(
    "value", [float("nan"), float("inf"), -1, 10**30, "x", None, [], {}]
)
def test_no_size_is_nonsense(value):
    """A preset accepts only numbers that a study can have."""
    for name in NAMES:
        if name in ("name", "network", "training"):
            continue
        try:
            preset = load_preset("smoke", **{name: value})
        except ConfigError as error:
            assert "\n" not in str(error)
        else:
            parts = (preset, preset.network, preset.training)
            taken = next(getattr(part, name) for part in parts if hasattr(part, name))
            assert taken in (-1, [], ()) or (
                taken is None and name.endswith("_body")
            ), (name, taken)


@given(document=st.one_of(documents.map(yaml.safe_dump), values, st.text(max_size=60)))
def test_any_parameter_file(folder, document):
    path = folder / "inside" / "any.yaml"
    chapter = ROOT / "notebooks" / "04-figure3.ipynb"
    path.write_text(document, encoding="utf-8", errors="replace")
    try:
        parameters.merge_parameters(chapter, {}, [path])
    except ConfigError as error:
        assert "\n" not in str(error)
    assert tree(folder) == {path}


@given(
    content=st.one_of(
        st.binary(max_size=200), documents.map(lambda made: json.dumps(made).encode())
    )
)
@pytest.mark.parametrize("what", ["trials", "datasets", "failures"])
def test_any_file_in_the_store(folder, capsys, content, what):
    """`show` names a bad file in one line, also one with a correct checksum."""
    path = Path("results") / f"{what}.jsonl"
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(content + b"\n")
    run(["show", "--preset", "smoke"], capsys)
    text = content.decode("latin1")
    for values in ({"key": text, "trial": text}, {"name": [text]}, {text: None}):
        path.write_text(line_of(values))
        run(["show", "--preset", "smoke"], capsys)
    path.unlink()


def test_a_preset_does_not_lead_out_of_the_folder(folder, capsys):
    for text in ("policy=../../../x", "policy=/tmp", "name=../x"):
        assert run(["collect", "--preset", "smoke", "--set", text], capsys) == 2
    assert tree(folder) == set()
