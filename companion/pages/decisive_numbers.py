"""Numbers of the decisive experiment that pages quote, as texts by their names."""

from __future__ import annotations

import pandas as pd

from companion.pages.markdown import known_text
from companion.statistics.efficiency import NO_VALUE, DataRatio
from companion.studies.decisive import along, verdicts
from companion.studies.decisive.arms import FINETUNING
from companion.studies.decisive.verdicts import AT, END, RELEASED, SMALL

#: Name -> recipe, pair of robots, stopping rule and min of novice data of an SIDM, and
#: the recipe of its rival where it is another one.
SAVINGS: dict[str, tuple] = {
    "released-saving": ("R", "system1", RELEASED, AT),
    "released-saving-2": ("R", "system2", RELEASED, AT),
    "end-saving": ("R", "system1", END, AT),
    "end-saving-2": ("R", "system2", END, AT),
    "one-saving": ("R", "system1", RELEASED, 1.0),
    "one-saving-2": ("R", "system2", RELEASED, 1.0),
    "tuned-saving": ("T", "system1", END, AT),
    "tuned-released": ("T", "system1", RELEASED, AT),
    "tuned-early": ("T", "system1", "patience", AT),
    "tuned-one": ("T", "system1", END, 1.0),
    "mixed-saving": ("R", "system1", END, AT, "T"),
}
#: Name -> pair of robots and min of training alone at which each seed has the loss of
#: the best, since our cap ended it.
CAPPED = {
    "capped-60": ("system1", (60.0, 120.0)),
    "capped-20": ("system1", (20.0, 60.0, 120.0)),
    "capped-2": ("system2", (20.0, 60.0, 120.0)),
}


def texts(frame: pd.DataFrame) -> dict[str, str]:
    """Ratios with their intervals, and a p-value; 'not run' where trainings lack."""
    ratios = {
        name: verdicts.sidm_saving(frame, *where) for name, where in SAVINGS.items()
    }
    for name, (system, sizes) in CAPPED.items():
        ratios[name] = along.ratio_at_best(frame, system, sizes)
    found = {name: _text(ratio, 2) for name, ratio in ratios.items()}
    tuned = frame[(frame.recipe == "T") & (frame.system == "system1")]
    losses = verdicts.losses_by(tuned, END)
    for minutes in SMALL:
        _, value, low, high = verdicts.loss_ratio(losses, minutes)
        found[f"tuned-loss-{minutes:g}"] = _text(DataRatio(value, low, high), 3)
    _, finetuned = verdicts.ratio_of_data(losses, FINETUNING)
    judged = verdicts.verdicts(frame).query("verdict == 'T2' and system == 'system1'")
    p = judged[judged.method == "sidm"].corrected.min()
    return found | {
        "finetuned-saving": _text(finetuned, 3),
        "tuned-p": known_text("{:.2f}", p),
    }


def unit_texts(frame: pd.DataFrame) -> dict[str, str]:
    """Losses with standardised units over those with raw ones, seed by seed."""
    found = {}
    for method, name in (("sidm", "units-sidm"), ("novice_only", "units-alone")):
        trained = frame[frame.method == method].set_index("seed")
        raw, standardised = (
            trained[trained.units == kind].validation_loss
            for kind in ("raw", "standardised")
        )
        ratios = (standardised / raw).dropna()
        found[name] = " and ".join(f"{ratio:.2f}" for ratio in ratios) or "not run"
    return found


def _text(ratio: DataRatio, digits: int) -> str:
    return ratio.text(digits).replace(NO_VALUE, "not run")
