"""Trials on data made again elsewhere, beside the stored trials."""

import dataclasses

import pytest

from companion import Results, Study
from companion.__main__ import main
from companion.engine.known_motion import Known, note
from companion.statistics.pairs import paired_comparison
from companion.studies.reproduction import store_of, table, with_repeats


def test_the_same_trials_are_found_by_all_but_their_data(tmp_path, make_row):
    """Losses are two per cent lower, seed by seed.

    Trials that one side lacks are left out.
    """
    study, store = Study("laptop", tmp_path, tmp_path), Results(tmp_path)
    for trial in study.points("system1", ["novice_only", "sidm"], [5.0, 20.0]):
        store.put(make_row(trial, 1.0 + trial.seed))
        if trial.novice_minutes == 5 and trial.method == "sidm":
            store_of(tmp_path).put(make_row(trial, 0.98 * (1 + trial.seed)))
    (line,) = table(store, store_of(tmp_path)).itertuples()
    expected = ("system1", "sidm", 5, 3)
    assert (line.system, line.method, line.novice_minutes, line.seeds) == expected
    assert (line.ratio, line.low, line.high) == pytest.approx((0.98, 0.98, 0.98))
    assert line.reference == pytest.approx(2)


def test_the_command_line_holds_results_against_others(tmp_path, make_row, capsys):
    study = Study("laptop", tmp_path, tmp_path)
    reproduced = Results(tmp_path / "mine")
    stored = Results(tmp_path / "theirs")
    for trial in study.points("system1", ["sidm"], [5.0]):
        reproduced.put(make_row(trial, 3.0))
        stored.put(make_row(trial, 2.0))
    folders = ["--results", str(reproduced.folder), "--against", str(stored.folder)]
    assert main(["show", *folders]) == 0
    line, last = capsys.readouterr().out.splitlines()
    assert (
        line.split()
        == "system1 sidm 5 min seeds 3 stored 2 here 3 "
        "ratio 1.50 (1.50 to 1.50)".split()
    )
    assert last == "points in both: 1"


def test_it_says_why_other_trials_have_no_counterpart(tmp_path, make_row, capsys):
    study, stored = Study("laptop", tmp_path, tmp_path), Results(tmp_path / "theirs")
    mine = Results(tmp_path / "mine")
    for trial in study.points("system1", ["sidm"], [5.0]):
        stored.put(make_row(trial, 2.0))
    for trial in study.changed(pixels=16).points("system1", ["sidm"], [5.0]):
        mine.put(make_row(trial, 3.0))
    for trial in study.points("system1", ["sidm"], [20.0])[:1]:
        mine.put(make_row(trial, 3.0))
    folders = ["--results", str(mine.folder), "--against", str(stored.folder)]
    assert main(["show", *folders]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "3 trials here alone: pixels 16 (there 32)",
        "1 trials here alone: no such method and size",
        "points in both: 0",
    ]


def test_a_comparison_is_on_the_same_motion_where_it_can_be(tmp_path, make_row):
    """The loss doubles; on motion that was simulated again all losses are 10 % lower.

    The trials of another size have no repeat and are compared across motions.
    """
    study, store = Study("laptop", tmp_path, tmp_path), Results(tmp_path)
    changed = study.changed(pixels=16)
    note([Known(name="novice", digest="first", same=("rounded",))], tmp_path)
    for one, factor in ((study, 1.0), (changed, 2.0)):
        for trial in one.points("system1", ["sidm"], [5.0, 20.0]):
            row = make_row(trial, factor * (1 + trial.seed))
            if one is changed:
                lower = make_row(trial, 0.9 * factor * (1 + trial.seed))
                made = dataclasses.replace(
                    row.provenance, digests={"novice": "rounded"}
                )
                row = dataclasses.replace(lower, provenance=made)
            elif trial.novice_minutes == 5:
                store_of(tmp_path).put(make_row(trial, 0.9 * (1 + trial.seed)))
            store.put(row)
    frame, reference = (
        store.frame(one.points("system1", ["sidm"], [5.0, 20.0]))
        for one in (changed, study)
    )
    plain = paired_comparison(frame, reference)
    assert plain.ratio.tolist() == pytest.approx([1.8, 1.8])
    alike = paired_comparison(frame, with_repeats(reference, tmp_path))
    assert alike.ratio.tolist() == pytest.approx([2.0, 1.8])
    assert alike.seeds.tolist() == [3, 3]
    original = frame.assign(repeated=False)
    assert paired_comparison(
        original, with_repeats(reference, tmp_path)
    ).ratio.tolist() == pytest.approx([1.8, 1.8])
    nowhere = with_repeats(reference, tmp_path / "nowhere")
    assert paired_comparison(frame, nowhere).ratio.tolist() == plain.ratio.tolist()
    other = with_repeats(frame, tmp_path)  # no repeats with 16 pixels
    assert len(other) == len(frame)
