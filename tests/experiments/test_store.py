"""The store: rows come back as they were put, and nothing damaged is read."""

import shutil

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sidm.experiments import Results, StoreError, Study
from sidm.experiments import provenance as provenance_module
from sidm.experiments.datasets import note_datasets
from sidm.experiments.provenance import canonical, modules_of, source_hash
from sidm.experiments.store import Row, rounded
from sidm.storage import read_record, write_record


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
    assert store.missing(trials) == [trials[0], *trials[3:]]
    assert {row.trial.key for row in store.all()} == {trial.key for trial in trials[1:3]}


def test_stale_rows_are_shown(trials, make_row, tmp_path):
    """A row made by other code is stale; one made by today's is not."""
    store, row = Results(tmp_path), make_row(trials[0])
    store.put(row)
    old = {f.name: getattr(row.provenance, f.name) for f in row.provenance.__dataclass_fields__.values()}
    old["learning_source"] = "0" * 12
    store.put(Row(trial=trials[1], outcome=row.outcome, provenance=type(row.provenance)(**old)))
    assert store.stale(trials) == [trials[1]]


def another_seed(values):
    values["trial"]["seed"] = 7


def mistyped(values):
    values["outcome"]["iteratons"] = values["outcome"].pop("iterations")


@pytest.mark.parametrize(
    "spoil, words",
    [
        (lambda values: values.pop("outcome"), "damaged|not a row of results"),
        (lambda values: values.update(schema=99), "has schema 99, this version reads 2"),
        (lambda values: values.update(trial=[]), "must be Trial, not list"),
        (another_seed, "holds another trial"),
        (mistyped, "did you mean 'iterations'"),
    ],
)
def test_what_is_not_the_row_is_named_in_one_line(trials, make_row, tmp_path, spoil, words):
    """Whatever was written into the file by others, the error names it and the mend."""
    store = Results(tmp_path)
    path = store.put(make_row(trials[0]))
    values = read_record(path)
    spoil(values)
    write_record(path, values)
    with pytest.raises(StoreError, match=words) as caught:
        store.get(trials[0])
    assert str(path) in str(caught.value) and "\n" not in str(caught.value) and "delete it" in str(caught.value)


@given(where=st.floats(0, 1, exclude_max=True), bit=st.integers(0, 7))
@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
def test_every_flipped_bit_is_seen(trials, make_row, tmp_path, where, bit):
    store = Results(tmp_path)
    path = store.put(make_row(trials[0]))
    content = bytearray(path.read_bytes())
    content[int(where * len(content))] ^= 1 << bit
    path.write_bytes(content)
    with pytest.raises(StoreError, match="damaged") as caught:
        store.get(trials[0])
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


def test_stores_merge_by_copying(trials, make_row, tmp_path):
    """Two people who run different trials write different files."""
    stores = [Results(tmp_path / name) for name in ("one", "other", "both")]
    for store, mine in zip(stores, (trials[:2], trials[2:]), strict=False):
        for trial in mine:
            store.put(make_row(trial))
        note_datasets(mine, store.folder)
        shutil.copytree(store.folder, stores[2].folder, dirs_exist_ok=True)
    assert stores[2].missing(trials) == [] and [row.trial for row in stores[2].rows(trials)] == trials
    names = [{path.name for path in (store.folder / "trials").iterdir()} for store in stores[:2]]
    assert not names[0] & names[1]


def test_divergence_is_not_stored(trials, make_row, tmp_path):
    """JSON has no infinity, and a mean must not meet one."""
    with pytest.raises(StoreError, match="not finite; the training diverged"):
        Results(tmp_path).put(make_row(trials[0], loss=float("inf")))
    assert Results(tmp_path).missing(trials) == trials


def test_rekey_moves_rows_whose_trial_learnt_a_value(trials, make_row, tmp_path):
    """A row stored before Trial had one of its values takes the default and today's key."""
    store = Results(tmp_path)
    path = store.put(make_row(trials[0]))
    old = read_record(path)
    del old["trial"]["policy"]
    path.unlink()
    write_record(path.with_stem("0" * 20), old)
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
    elsewhere = modules_of(provenance_module.WINGS["elsewhere"])  # whose recordings are known by their checksum
    assert "sidm.learning.recorded" in elsewhere and not any(name.startswith("sidm.recordings") for name in elsewhere)
    assert len(source_hash("learning")) == 12 and source_hash("learning") != source_hash("simulation")
