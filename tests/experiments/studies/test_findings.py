"""What was found, in short, from made-up measurements."""

from types import SimpleNamespace

from sidm.experiments import Study
from sidm.experiments.statistics.intervals import Interval
from sidm.experiments.studies.findings import ORDER, in_short, summary, tally
from sidm.experiments.studies.hypotheses import (
    ADVERSARY,
    ALIKE,
    APART,
    BETTER,
    CROSSED,
    NO_DIFFERENCE,
    NO_VERDICT,
    STOPPING,
    WORSE,
    Finding,
    grid,
)
from sidm.experiments.studies.overlap import Neighbourhood

FINETUNED = Finding(ALIKE, "system1", 5.0, "the expert first", 3, 0.3, 0.2, Interval(0.667, 0.6, 0.7), BETTER)
PATIENT = Finding(STOPPING, "system1", 5.0, "patience", 3, 0.3, 0.3, Interval(1.0, 0.9, 1.1), NO_DIFFERENCE)


def crossed(name, ratio, said):
    return Finding(APART, "system1", 5.0, CROSSED[name], 3, 0.3, 0.3 * ratio, Interval(ratio, ratio, ratio), said)


def test_every_suspect_has_its_line():
    text = in_short([FINETUNED], {ALIKE: {"baselines": 6}}, [], {})
    assert len(text.splitlines()) == len(ORDER) and text.count("No change of it is measured") == len(ORDER) - 1
    assert {change.suspect for change in grid(Study("laptop"), "system1")} == set(ORDER)
    assert "better in 1; 0.67 times SIDM's loss" in text
    assert "Trials not run: 6 of `sidm run --preset laptop --figure baselines`" in text
    assert text.count("not measured") == 3


def test_sentences_carry_the_numbers():
    both = {"expert": Neighbourhood(0.6, 0.053, 0.345), "novice": Neighbourhood(0.5, 0.05, 0.243)}
    models = [SimpleNamespace(discriminator_accuracy=one) for one in (0.99, 0.96, 0.5)]
    parts = [crossed("expert_encoder_loss", 5.0, WORSE), crossed("expert_decoder_loss", 4.0, WORSE)]
    parts.append(crossed("expert_path_loss", 1.0, NO_DIFFERENCE))
    text = in_short(parts, {}, models, {"system1": both})
    assert "5.3%" in text and "0.345" in text and "0.243" in text
    assert "does not make the latents alike" in text and "in 2 of 3 models" in text
    assert "like two models: " in text and "is 4 to 5 times as large, larger by the whole interval in 2 of 2" in text
    assert "exchanged, it is so in 0 of 1." in text
    models[0].discriminator_accuracy = 0.5
    other = in_short([one._replace(verdict=BETTER) for one in parts], {}, models, {})
    assert "seems to make the latents alike" in other and "like one model that both" in other
    few = in_short([one._replace(verdict=NO_VERDICT) for one in parts], {}, models, {})
    assert "stand in for the novice's is not measured with enough seeds" in few


def test_verdicts_are_counted():
    several = [PATIENT, PATIENT._replace(minutes=20.0), PATIENT._replace(ratio=Interval(1.2, 1.1, 1.3), verdict=WORSE)]
    assert tally(several) == (
        "1 change in 3 comparisons: no difference seen in 2, worse in 1; 1 to 1.2 times SIDM's loss"
    )


def test_the_summary_ranks_the_changes():
    few = PATIENT._replace(suspect=ADVERSARY, instead="matching", verdict=NO_VERDICT)
    other = FINETUNED._replace(minutes=20.0, ratio=Interval(0.8, 0.7, 0.9))
    once = [FINETUNED._replace(instead="coral"), PATIENT._replace(instead="coral", verdict=WORSE)]
    found = [other, FINETUNED, PATIENT, few, *once, crossed("expert_encoder_loss", 0.5, BETTER)]
    assert summary(found).splitlines() == [
        "- A lower loss than SIDM's in every comparison: *the expert first* (2 of 2, 0.67 to 0.8 times)",
        "- In some: *coral* (1 of 2, 0.67 to 1 times)",
        "- No difference seen: *patience* (0 of 1, 1 times)",
    ]
    assert summary([few]) == "No change is measured.\n"
