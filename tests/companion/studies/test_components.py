"""Components of the loss with SIDM beside those without."""

import dataclasses

import pytest

from companion import Study
from companion.engine.frame import frame_of
from companion.studies import components


@pytest.fixture
def frame(tiny, tmp_path, make_row):
    """Losses in which SIDM halves the first component and leaves the others."""
    rows = []
    for trial in components.trials(
        Study(tiny.replace(seeds=3), tmp_path, tmp_path), "system1"
    ):
        row, losses = make_row(trial), [1.0 + trial.seed] * 13
        if trial.method == "sidm":
            losses[0] /= 2
        rows.append(
            dataclasses.replace(
                row,
                outcome=dataclasses.replace(
                    row.outcome, component_losses=tuple(losses)
                ),
            )
        )
    return frame_of(rows)


def test_a_line_a_component_and_size(frame):
    table = components.table(frame)
    assert len(table) == 2 * 13
    assert set(table.component) == set(components.NAMES)
    assert set(table.seeds) == {3}
    first = table[table.component == "translation x"]
    assert list(first.ratio) == pytest.approx([0.5, 0.5])
    assert list(table.ratio[table.component != "translation x"]) == pytest.approx(
        [1.0] * 24
    )


def test_the_figure_numbers_what_lies_to_one_side(frame):
    left, right = components.figure(components.table(frame)).axes
    assert [text.get_text() for text in left.texts] == ["0.50", "0.50"]
    assert [text.get_text() for text in left.get_yticklabels()] == components.NAMES
    assert right.texts[0].get_text() == "no trials stored"
