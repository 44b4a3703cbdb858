"""The store: rows come back as they were put, and nothing damaged is read."""

import json

import pytest

from sidm.experiments import Results, StoreError, Study
from sidm.experiments import provenance as provenance_module
from sidm.experiments.provenance import canonical, modules_of, source_hash
from sidm.experiments.store import Row, rounded


@pytest.fixture
def trials(tiny, tmp_path):
    """Four trials of a tiny study."""
    return Study(tiny, tmp_path / "no-data", tmp_path).figure3("system1")


def test_rows_come_back(trials, make_row, tmp_path):
    """A row put is the row got, to 6 significant digits; rewriting it changes no byte."""
    store, row = Results(tmp_path), make_row(trials[0], loss=2.123456789)
    path = store.put(row)
    assert path == tmp_path / "trials" / f"{trials[0].key}.json"
    back = store.get(trials[0])
    assert back.outcome.validation_loss == 2.12346 and back.trial == row.trial and back.provenance == row.provenance
    before = path.read_bytes()
    assert store.put(back).read_bytes() == before and len(before) < 5000
    assert not list(path.parent.glob(".*"))


def test_missing_and_rows(trials, make_row, tmp_path):
    """What is stored and what is not partition the trials, in their order."""
    store = Results(tmp_path)
    assert store.missing(trials) == trials and store.rows(trials) == [] and store.get(trials[0]) is None
    for trial in trials[1:3]:
        store.put(make_row(trial))
    assert [row.trial for row in store.rows(trials)] == trials[1:3]
    assert store.missing(trials) == [trials[0], trials[3]]
    assert {row.trial.key for row in store.all()} == {trial.key for trial in trials[1:3]}


def test_stale_rows_are_shown(trials, make_row, tmp_path):
    """A row made by other code is stale; one made by today's is not."""
    store, row = Results(tmp_path), make_row(trials[0])
    store.put(row)
    old = {f.name: getattr(row.provenance, f.name) for f in row.provenance.__dataclass_fields__.values()}
    old["learning_source"] = "0" * 12
    store.put(Row(trial=trials[1], outcome=row.outcome, provenance=type(row.provenance)(**old)))
    assert store.stale(trials) == [trials[1]]


@pytest.mark.parametrize(
    "spoil, words",
    [
        (lambda text: text[: len(text) // 2], "damaged"),
        (lambda text: "[]", "not a row of results"),
        (lambda text: text.replace('"schema": 1', '"schema": 99'), "has schema 99, this version reads 1"),
        (lambda text: text.replace('"seed": 0', '"seed": 7'), "holds another trial"),
        (lambda text: text.replace('"iterations"', '"iteratons"'), "did you mean 'iterations'"),
    ],
)
def test_damage_is_one_line(trials, make_row, tmp_path, spoil, words):
    """Whatever is wrong with a file, the error names it and the mend in one line."""
    store = Results(tmp_path)
    path = store.put(make_row(trials[0]))
    path.write_text(spoil(path.read_text()))
    with pytest.raises(StoreError, match=words) as caught:
        store.get(trials[0])
    assert str(path) in str(caught.value) and "\n" not in str(caught.value) and "delete it" in str(caught.value)


def test_divergence_is_not_stored(trials, make_row, tmp_path):
    """JSON has no infinity, and a mean must not meet one."""
    with pytest.raises(StoreError, match="not finite; the training diverged"):
        Results(tmp_path).put(make_row(trials[0], loss=float("inf")))
    assert Results(tmp_path).missing(trials) == trials


def test_rekey_moves_rows_whose_trial_learnt_a_value(trials, make_row, tmp_path):
    """A row stored before Trial had one of its values takes the default and today's key."""
    store = Results(tmp_path)
    path = store.put(make_row(trials[0]))
    old = json.loads(path.read_text())
    del old["trial"]["policy"]
    path.rename(path.with_stem("0" * 20))
    path.with_stem("0" * 20).write_text(json.dumps(old))
    assert store.missing(trials[:1]) and store.rekey() == 1
    assert not store.missing(trials[:1]) and store.rekey() == 0
    assert store.get(trials[0]).trial == trials[0]


def test_rounding():
    """Floats alone are rounded, at any depth."""
    given = {"a": [1.23456789, 3, "x", True], "b": (1e-9 / 3,)}
    assert rounded(given) == {"a": [1.23457, 3, "x", True], "b": [3.33333e-10]}


def test_source_hash_ignores_words_and_feels_code(tmp_path, monkeypatch):
    """Comments, docstrings and layout may change; a constant may not."""
    package = tmp_path / "sidm"
    (package / "learning").mkdir(parents=True)
    entry = package / "learning" / "training.py"

    def digest(text: str) -> str:
        entry.write_text(text)
        return str({name: canonical(tree) for name, tree in modules_of(["sidm.learning.training"]).items()})

    monkeypatch.setattr(provenance_module, "PACKAGE", package)
    plain = digest('"""Doc."""\nfrom sidm.terrain import a\n\ndef f(x):\n    """Doc."""\n    return x + 1\n')
    assert digest("# why\nfrom sidm.terrain import a\ndef f(x):\n  return (x +\n 1)\n") == plain
    assert digest("from sidm.terrain import a\ndef f(x):\n  return x + 2\n") != plain
    (package / "terrain.py").write_text("a = 1")
    assert digest("from sidm.terrain import a\ndef f(x):\n  return x + 1\n") != plain


def test_source_hash_covers_what_results_depend_on():
    """Training leads to networks, losses and terrain; bookkeeping and simulation are not among them."""
    names = set(modules_of(provenance_module.WINGS["learning"]))
    assert {"sidm.learning.networks", "sidm.learning.losses", "sidm.terrain", "sidm.trajectory"} <= names
    assert not any(name.startswith("sidm.simulation") or name == "sidm.experiments.store" for name in names)
    assert "sidm.simulation.simulator" in modules_of(provenance_module.WINGS["simulation"])
    assert len(source_hash("learning")) == 12 and source_hash("learning") != source_hash("simulation")
