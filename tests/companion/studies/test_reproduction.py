"""Trials on data made again elsewhere, beside the stored trials."""

import dataclasses

import pytest

from companion import Results
from companion.__main__ import main
from companion.engine.known_motion import Known, note
from companion.statistics.pairs import paired_comparison
from companion.studies.reproduction import store_of, with_repeats


def test_the_command_line_holds_results_against_others_and_says_what_has_none(
    laptop, make_row, tmp_path, capsys
):
    mine, theirs = (Results(tmp_path / name) for name in ("mine", "theirs"))
    points = laptop.points("system1", ["sidm"], [5.0])
    for trial in points:
        theirs.put(make_row(trial, 2.0))
        mine.put(make_row(trial, 3.0))
    smaller = laptop.changed(pixels=8).points("system1", ["sidm"], [5.0])
    for trial in smaller:  # another grid in both
        theirs.put(make_row(trial, 2.0))
        mine.put(make_row(trial, 2.0))
    others = laptop.changed(pixels=16).points("system1", ["sidm"], [5.0])
    for trial in (*others, laptop.points("system1", ["sidm"], [20.0])[0]):
        mine.put(make_row(trial, 3.0))
    folders = ["--results", str(mine.folder), "--against", str(theirs.folder)]
    assert main(["show", *folders]) == 0
    first, second, *lines = sorted(capsys.readouterr().out.splitlines(), reverse=True)
    assert "seeds 3  stored 2  here 3  ratio 1.50 (1.50 to 1.50)" in first
    assert "seeds 3  stored 2  here 2  ratio 1.00 (1.00 to 1.00)" in second
    assert lines[0] == "points in both: 2"
    assert lines[2] == "1 trials here alone: no such method and size"
    assert lines[1].startswith("3 trials here alone: pixels 16 (there ")


def test_a_comparison_is_on_the_same_motion_where_it_can_be(laptop, make_row, tmp_path):
    """The loss doubles; on motion that was simulated again all losses are 10 % lower.

    The trials of another size have no repeat and are compared across motions.
    """
    folder, store = tmp_path, Results(tmp_path)
    note([Known(name="novice", digest="first", same=("rounded",))], folder)
    stored = laptop.points("system1", ["sidm"], [5.0, 20.0])
    changed = laptop.changed(pixels=16).points("system1", ["sidm"], [5.0, 20.0])
    for trial in stored:
        store.put(make_row(trial, 1.0 + trial.seed))
        if trial.novice_minutes == 5:
            store_of(folder).put(make_row(trial, 0.9 * (1 + trial.seed)))
    for trial in changed:
        row = make_row(trial, 0.9 * 2 * (1 + trial.seed))
        digests = dataclasses.replace(row.provenance, digests={"novice": "rounded"})
        store.put(dataclasses.replace(row, provenance=digests))
    frame, reference = store.frame(changed), store.frame(stored)
    original = frame.assign(repeated=False)
    for rows, others, ratios in (
        (frame, reference, [1.8, 1.8]),
        (frame, with_repeats(reference, folder), [2.0, 1.8]),
        (original, with_repeats(reference, folder), [1.8, 1.8]),
        (frame, with_repeats(reference, folder / "nowhere"), [1.8, 1.8]),
    ):
        compared = paired_comparison(rows, others)
        assert compared.ratio.tolist() == pytest.approx(ratios)
        assert compared.seeds.tolist() == [3, 3]
    assert len(with_repeats(frame, folder)) == len(frame)  # no repeats with 16 pixels
