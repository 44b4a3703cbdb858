"""How the methods were tuned: an equal number of tries each, judged by the test loss.

Every try (candidate setting) uses TUNING_SEED, which no figure uses. The preset
`laptop` takes each method's try with the lowest test loss on system 1, at one middle
size; system 2 is a check. A preset with separate tuning motion, such as `study`, has
LITTLE_TRIES at a small size; LITTLE names the best of these tries.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pandas as pd

from companion.engine.store import Results
from companion.figures.style import system_label
from companion.methods import FOR_LITTLE, METHODS
from companion.presets import MOST_SEEDS, Preset
from companion.statistics.tables import wide
from companion.study import Study
from companion.trials import Trial
from sidm.systems import PAPER_SYSTEMS

TUNING_SEED = MOST_SEEDS  # the seeds of figures are lower

#: Changes of a preset: setting -> value.
Changes = dict[str, Any]


def rate_and_batch(batch: int, learning_rate: float) -> Changes:
    """Settings for a batch size, which Algorithm 2 shares, and a learning rate.

    The test loss is taken after as many samples as in the preset.
    """
    return dict(
        batch=batch,
        discriminator_batch=batch,
        matching_batch=batch,
        learning_rate=learning_rate,
        test_interval=200 // batch,
    )


def _fine_tuned(**values: Any) -> Changes:
    """Settings for fine-tuning, but not for its pretraining."""
    tuned = (("pretrain_finetune", name, value) for name, value in values.items())
    return {"tuned": tuple(tuned)}


_ALL: dict[str, Changes] = {
    "batch 8, rate 0.001 (the base)": rate_and_batch(8, 1e-3),
    "batch 8, rate 0.0005": rate_and_batch(8, 5e-4),
    "batch 4, rate 0.001": rate_and_batch(4, 1e-3),
    "batch 4, rate 0.0005": rate_and_batch(4, 5e-4),
    "patience 450,000": {"patience": 450_000},
}

#: Method -> name of each try -> changes of the untuned preset, for all trainings of the
#: method.
TRIES: dict[str, dict[str, Changes]] = {
    "novice_only": _ALL
    | {
        "batch 2, rate 0.0003": rate_and_batch(2, 3e-4),
        "weight decay 0.1": {"weight_decay": 0.1},
    },
    "sidm": _ALL
    | {
        "the other system's p_e": {"p_expert_system1": 0.5, "p_expert_system2": 0.75},
        "5 matching iterations": {"matching_iterations": 5},
    },
    "pretrain_finetune": _ALL
    | {
        "rate 0.0003 of the fine-tuning alone": _fine_tuned(learning_rate=3e-4),
        "rate 0.0001 of the fine-tuning alone": _fine_tuned(learning_rate=1e-4),
    },
}

_P_90 = {"p_expert_system1": 0.9, "p_expert_system2": 0.9}

#: The tries of presets with separate motion for tuning, as TRIES. The base has a rate
#: of 0.001, batches of 8, the paper's p_e and 20 matching iterations.
LITTLE_TRIES: dict[str, dict[str, Changes]] = {
    "novice_only": {
        "the base": {},
        "rate 0.0003": {"learning_rate": 3e-4},
        "batch 4": rate_and_batch(4, 1e-3),
        "batch 4, rate 0.0003": rate_and_batch(4, 3e-4),
        "weight decay 0.1": {"weight_decay": 0.1},
        "weight decay 0.1, rate 0.0003": {"weight_decay": 0.1, "learning_rate": 3e-4},
    },
    "sidm": {
        "the base": {},
        "rate 0.0003": {"learning_rate": 3e-4},
        "p_e 0.9": _P_90,
        "5 matching iterations": {"matching_iterations": 5},
        "100 matching iterations": {"matching_iterations": 100},
        "p_e 0.9, 100 matching iterations": _P_90 | {"matching_iterations": 100},
    },
    "pretrain_finetune": {
        "the base": {},
        "fine-tuning at 0.0003": _fine_tuned(learning_rate=3e-4),
        "fine-tuning at 0.0001": _fine_tuned(learning_rate=1e-4),
        "fine-tuning at 0.00003": _fine_tuned(learning_rate=3e-5),
        "fine-tuning at 0.0001, weight decay 0.1": _fine_tuned(
            learning_rate=1e-4, weight_decay=0.1
        ),
        "pretraining at 0.0003, fine-tuning at 0.0001": {
            "tuned": (
                ("pretraining", "learning_rate", 3e-4),
                ("pretrain_finetune", "learning_rate", 1e-4),
            )
        },
    },
}


#: System -> method -> the try with the lowest test loss at 5 minutes. A method is
#: listed where the loss of Figure 3's settings is more than LITTLE_WORTH above it.
LITTLE = {
    "system1": {"sidm": "p_e 0.9, 100 matching iterations"},
    "system2": {"sidm": "p_e 0.9, 100 matching iterations", "novice_only": "batch 4"},
}
LITTLE_WORTH = 0.01  # share of the loss
LITTLE_MINUTES = 5.0  # the largest size at which Figure 3 is run with these settings


def tries_of(preset: Preset) -> dict[str, dict[str, Changes]]:
    """The tries of a preset: TRIES, or LITTLE_TRIES with separate motion for tuning."""
    separate = preset.tuning_pool_minutes or preset.motion == "tuning"
    return LITTLE_TRIES if separate else TRIES


def untuned(preset: Preset, changes: Changes) -> Preset:
    """The preset without its tuned settings, but with some changes."""
    return preset.replace(**({"tuned": ()} | changes))


def tries(study: Study, system: str) -> list[tuple[str, Trial]]:
    """Name and trial of every try of every method at each of the tuning's sizes."""
    base = study.preset.for_tuning()
    return [
        (
            name,
            Study(untuned(base, changes)).trial(system, method, minutes, TUNING_SEED),
        )
        for minutes in base.tuning_minutes
        for method, tried in tries_of(base).items()
        for name, changes in tried.items()
    ]


def trials(study: Study, system: str) -> list[Trial]:
    """The trials of all tries."""
    return [trial for _, trial in tries(study, system)]


def little_data(study: Study, system: str) -> list[Trial]:
    """Figure 3 with little data, with the settings tuned at 5 minutes (LITTLE).

    A system on which nothing was tuned has those of system 1, as for a preset's p_e.
    """
    preset, trials = study.preset, []
    sizes = [size for size in preset.novice_minutes(system) if size <= LITTLE_MINUTES]
    for method, name in LITTLE.get(system, LITTLE["system1"]).items():
        tuned = Study(untuned(preset, LITTLE_TRIES[method][name]))
        trials += tuned.points(system, [method], sizes, seeds=preset.seeds)
    return trials


def little_data_results(
    study: Study, store: Results, systems: Iterable[str]
) -> pd.DataFrame:
    """Stored results of `little_data`, with the methods' names in figures."""
    frame = store.frame(
        [trial for system in systems for trial in little_data(study, system)]
    )
    return frame.assign(method=frame.method + FOR_LITTLE)


def best_novice_only(frame: pd.DataFrame, little: pd.DataFrame) -> pd.DataFrame:
    """Results of training without SIDM with the better of two settings at each size.

    Results of Figure 3, the `frame`, serve where `little_data_results` has none.
    """
    point = ["system", "novice_minutes"]
    tuned = little[little.method == "novice_only" + FOR_LITTLE]
    usual = frame[frame.method == "novice_only"]
    replaced = usual.set_index(point).index.isin(tuned.set_index(point).index)
    return pd.concat([tuned.assign(method="novice_only"), usual[~replaced]])


def frame(study: Study, store: Results, systems: Iterable[str]) -> pd.DataFrame:
    """The stored tries, each with its name as `try`, and whether it is `used`."""
    base, parts = Study(study.preset.for_tuning()), []
    for system in systems:
        for name, trial in tries(study, system):
            minutes = trial.novice_minutes
            usual = base.trial(system, trial.method, minutes, TUNING_SEED)
            columns = {"try": name, "used": usual.key == trial.key}
            parts.append(store.frame([trial]).assign(**columns))
    return pd.concat(parts)


def table(frame: pd.DataFrame) -> pd.DataFrame:
    """One row per try, with its losses and samples.

    The choice goes by `best_test_loss`, the smoothed test loss of the weights that were
    kept; `lowest` marks its first minimum for each system, size and method. `samples`
    are those of prediction and pretraining.
    """
    groups = frame.groupby(["system", "novice_minutes", "method"]).best_test_loss
    rows = frame.assign(
        samples=frame.samples + frame.pretraining_samples,
        lowest=frame.index == groups.transform("idxmin"),
    )
    names = ["system", "novice_minutes", "method", "try", "best_test_loss"]
    names += ["validation_loss", "samples", "lowest", "used"]
    return rows[names].reset_index(drop=True)


def page_table(tries: pd.DataFrame) -> pd.DataFrame:
    """The tries of `table` with the headings of a page, a column of losses a system."""
    used = tries.used.map({True: ", used", False: ""})
    lowest = tries.lowest.map({True: ", lowest", False: ""})
    losses = tries.best_test_loss.map("{:.3f}".format)
    labels = tries.method.map(lambda name: METHODS[name].label)
    shown = tries.assign(method=labels, loss=losses + used + lowest)
    rows = {"novice_minutes": "novice data (min)", "method": "method", "try": "try"}
    return wide(shown, [*rows], "system", "loss").rename(columns=rows)


#: The tuned settings of a training; the phases of Algorithm 2 have the last two.
TUNED = (
    "learning_rate",
    "batch",
    "weight_decay",
    "patience",
    "prediction_iterations",
    "discriminator_iterations",
    "matching_iterations",
)


def settings(preset: Preset) -> pd.DataFrame:
    """The settings that each method of TRIES was tuned to: one column per method.

    A pretraining's value stands before the fine-tuning's where they differ; p_e has a
    value for each system; '-' is a setting that a method does not use.
    """
    columns = {}
    for name in TRIES:
        method = METHODS[name]
        training = preset.training_of(method, "system1")
        parts = [preset.pretraining_of(method), training]
        shares = {
            system_label(system): preset.training_of(method, system).p_expert
            for system in PAPER_SYSTEMS
        }
        rows = {"p_expert": ", ".join(f"{p:g} ({pair})" for pair, p in shares.items())}
        for setting in TUNED:
            values = [getattr(part, setting) for part in parts if part is not None]
            rows[setting] = ", then ".join(dict.fromkeys(f"{v:,g}" for v in values))
        if not method.expert:
            rows |= dict.fromkeys(["p_expert", "prediction_iterations"], "-")
        if not training.regularise:
            rows |= dict.fromkeys(TUNED[-2:], "-")
        columns[name] = rows
    return pd.DataFrame(columns).rename_axis("setting")


def settings_table(preset: Preset) -> pd.DataFrame:
    """The table of `settings` with the headings of a page."""
    names = {
        "p_expert": "$p_e$",
        "batch": "batch (trajectories)",
        "patience": "patience (samples)",
    }
    table = settings(preset).rename(columns=lambda name: METHODS[name].label)
    table = table.rename(index=lambda name: names.get(name, name.replace("_", " ")))
    return table.reset_index()
