"""What was found, in short, from made-up measurements."""

from sidm.experiments.findings import TOLD, in_short
from sidm.experiments.methods import CHOICES, RELEASED
from sidm.experiments.overlap import Neighbourhood
from sidm.experiments.statistics import Interval
from sidm.experiments.suspects import REPLACED, Suspect


def test_sentences_carry_the_numbers():
    better = Suspect("system1", 5.0, REPLACED["pretrain_finetune"], 3, 0.3, 0.2, Interval(0.667, 0.6, 0.7), "better so")
    both = {"expert": Neighbourhood(0.6, 0.053, 0.345), "novice": Neighbourhood(0.5, 0.05, 0.243)}
    text = in_short([better], [], {"system1": both})
    assert "system1, 5 min: 0.667 [0.6, 0.7]" in text and "5.3%" in text and "0.345" in text and "0.243" in text
    assert "in 0 of 0 models" in text and len(text.splitlines()) == 5


def test_what_is_missing_is_said():
    text = in_short([], [], {})
    assert "Not measured" in text and text.count("not run") == 3 + len(TOLD)


def test_what_is_told_are_choices_that_touch_sidm():
    assert all("sidm" in (CHOICES | RELEASED)[name][1] for name in TOLD)
