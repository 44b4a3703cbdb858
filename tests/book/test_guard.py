"""Words are held against results."""

import pytest

from sidm.book.guard import Outdated, hold


def test_words_that_hold_need_no_word():
    assert hold({"more is less": lambda: True}, "laptop") is None


def test_a_sentence_that_no_longer_holds_is_named():
    with pytest.raises(Outdated, match="no longer bear out 'more is less': write the page anew"):
        hold({"less is more": lambda: True, "more is less": lambda: False}, "laptop")


def test_words_are_about_the_results_that_they_were_written_for():
    assert "about results of the preset `laptop`" in hold({"more is less": lambda: False}, "smoke").data


def test_words_may_be_about_other_things_than_a_preset():
    found = hold({"less is more": lambda: False}, "seed 4", "seed 3", of="the parameters")
    assert found is not None and "about results of the parameters `seed 3`; these are of `seed 4`" in found.data
