"""Results behind the page on Figure 3, and what it keeps for other pages."""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from typing import Any

import pandas as pd
from IPython.display import HTML

from companion.engine.store import Results
from companion.figures.style import METHOD_STYLES, html_plots, system_label
from companion.methods import FIGURE3, FOR_LITTLE
from companion.pages import all_savings, readings
from companion.pages.markdown import known_text, provenance_html, table_html
from companion.pages.page import Page
from companion.statistics import claims, coverage
from companion.statistics.savings import NO_VALUE, DataRatio, ratio_texts, savings
from companion.statistics.tables import loss_summary, wide
from companion.studies import tuning
from companion.studies.decisive import (
    ablated,
    length_curves,
    search,
    stopping_charts,
    stopping_point,
    verdicts,
)
from companion.studies.decisive.arms import FINETUNING
from companion.studies.decisive.verdicts import AT, END, RELEASED, SMALL
from companion.study import Study
from companion.trials import Trial
from sidm.systems import FREE_STRUTS, FREE_SYSTEMS, PAPER_SYSTEMS

FINETUNED, CLOSED_FORM = FIGURE3[-1], "least_squares"
POINT = ["system", "novice_minutes", "method"]
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
#: the movable stopping point in words
STOPPING = (
    "Data ratio and loss ratio of an SIDM with 5 minutes against samples seen. With "
    "the released settings, the data ratio is about 1 at 1.5 million samples on system "
    "1 and 5 from 4 million on; on system 2 it is 1 at 0.9 million and 2.8 from 2 "
    "million on. With tuned settings, on system 1, it is above 2 from 0.3 to 0.9 "
    "million samples, 1 at 3 million and 0.9 at the end."
)


class Figure3:
    """Results of recipe Q by the preset of a `study`, and of recipes R and T.

    R and T have one preset, `study`, and motion of their own.
    """

    def __init__(self, study: Study, store: Results, systems: Sequence[str]) -> None:
        self.study, self.store, self.systems = study, store, systems
        self.long = Study("study")

    def trials(self) -> list[Trial]:
        """The trials of recipe Q."""
        parts = self.study.figure3, self.study.references
        return [
            trial for part in parts for name in self.systems for trial in part(name)
        ]

    @functools.cached_property
    def quick(self) -> pd.DataFrame:
        """Results of recipe Q, of Figure 3 and the methods beside it."""
        return self.store.frame(self.trials())

    @functools.cached_property
    def little(self) -> pd.DataFrame:
        """Recipe Q with settings for little data."""
        return tuning.little_data_results(self.study, self.store, self.systems)

    @functools.cached_property
    def free(self) -> pd.DataFrame:
        """Recipe Q with free struts."""
        pairs = (name + FREE_STRUTS for name in self.systems)
        known = [name for name in pairs if name in FREE_SYSTEMS]
        return self.store.frame([t for s in known for t in self.study.free_struts(s)])

    @functools.cached_property
    def all_quick(self) -> pd.DataFrame:
        """All results of recipe Q."""
        return pd.concat([self.quick, self.little, self.free])

    @functools.cached_property
    def long_trained(self) -> pd.DataFrame:
        """Recipes R and T."""
        return verdicts.results(self.long, self.store)

    @functools.cached_property
    def searched(self) -> pd.DataFrame:
        """The search behind recipe T."""
        return self.store.frame(search.first_search(self.long), curves=True)

    @functools.cached_property
    def along(self) -> pd.DataFrame:
        """What an SIDM saves along the training of recipes R and T."""
        return length_curves.along_training(self.long_trained)

    @functools.cached_property
    def saved(self) -> pd.DataFrame:
        """Data that methods save with recipe Q, of `statistics.savings`."""
        best_alone = tuning.best_novice_only(self.quick, self.little)
        tuned = savings(pd.concat([self.little, best_alone]), ["sidm" + FOR_LITTLE])
        usual = savings(self.all_quick, ["sidm", FINETUNED, CLOSED_FORM])
        return pd.concat([usual, tuned])

    def stopping(
        self, systems: Sequence[str] = PAPER_SYSTEMS, names: Sequence[str] = ()
    ) -> str:
        """The movable stopping point of recipes R and T, as HTML.

        Where there is no script, a picture of the `systems` is shown; `names` are the
        charts, as in `stopping_charts.html`.
        """
        trained = self.searched[self.searched.method != CLOSED_FORM]
        numbers = stopping_point.contents(self.long_trained, trained, self.along)
        still = length_curves.figure(self.along, systems)
        return stopping_charts.html(numbers, still, STOPPING, names)

    def losses_table(self) -> pd.DataFrame:
        """All losses of recipe Q as texts, mean (smallest, largest), for a page."""
        means = loss_summary(self.all_quick, POINT)
        columns = means[["mean", "minimum", "maximum"]].itertuples(index=False)
        texts = ["{:.3f} ({:.2f}, {:.2f})".format(*line) for line in columns]
        return _by_method(means.assign(text=texts))

    def savings_table(self) -> pd.DataFrame:
        """All data that methods save with recipe Q as texts, for a page."""
        return _by_method(self.saved.assign(text=ratio_texts(self.saved)))

    def saving(self, method: str, minutes: float, system: str) -> str:
        """The data that a method saves with recipe Q, with its interval."""
        point = dict(system=system, method=method, novice_minutes=minutes)
        rows = self.saved[(self.saved[[*point]] == point).all(axis=1)]
        return next(iter(ratio_texts(rows)), "not run")

    def _quick_numbers(self) -> Iterator[tuple[str, str]]:
        for number, system in enumerate(PAPER_SYSTEMS, 1):
            name = f"system{number}"
            yield f"{name}-sidm-5", self.saving("sidm", AT, system)
            yield f"{name}-finetuned-5", self.saving(FINETUNED, AT, system)
            yield f"{name}-little", self.saving("sidm" + FOR_LITTLE, 1, system)
            free = system + FREE_STRUTS
            yield f"{name}-free-squares", self.saving(CLOSED_FORM, 1, free)
            yield f"{name}-free-finetuned", self.saving(FINETUNED, 1, free)

    def kept(self, page: Page) -> Iterator[tuple[str, Any]]:
        """Name and value of what other pages show; a table follows its numbers."""
        quick, long = page.again("3"), page.again("decisive", "study")
        every = quick, page.again("4"), long, page.again("all", "laptop")
        compared = self.quick[self.quick.method.isin(FIGURE3)]
        figure4 = self.store.frame(self.study.figure4())
        found = claims.figure3_claims(compared, self.study.preset.ablation_minutes[0])
        read = readings.readings(self.store)
        balanced = ablated.results(self.long, self.store)
        both = pd.concat([compared, figure4, self.long_trained, balanced])
        saved = all_savings.table(self.long_trained, self.saved)
        drawn = pd.concat([self.all_quick, self.long_trained])
        judged = verdicts.page_table(verdicts.verdicts(self.long_trained))

        def table(shown: pd.DataFrame, rows: pd.DataFrame, *commands: str) -> HTML:
            once = rows[~rows.index.duplicated()]
            return HTML(table_html(shown) + provenance_html(once, *commands))

        yield from self._quick_numbers()
        yield "claims", table(claims.page_table(found), compared, quick)
        yield "readings", table(readings.page_table(read), both, *every)
        yield "nearest", table(readings.nearest_table(read), both, *every)
        dots = all_savings.figure(self.long_trained, self.saved)
        made = provenance_html(drawn, quick, long)
        yield "saving-dots", HTML(html_plots(dots, all_savings.WORDS) + made)
        others = page.again("little-data"), page.again("free-struts")
        made_by = {"Q": (self.all_quick, quick, *others)}
        for recipe, rows in all_savings.by_recipe(saved).items():
            trained = made_by.get(recipe, (self.long_trained, long))
            yield f"savings-{recipe}", table(rows, *trained)
        yield "coverage", HTML(table_html(coverage.page_table()))
        yield "estimators", HTML(table_html(coverage.estimators_page_table()))
        yield from long_numbers(self.long_trained)
        units = self.store.frame(search.compare_units(self.long), curves=True)
        yield from unit_numbers(units)
        yield "decay-loss", _text(verdicts.with_rivals_decay(self.long, self.store), 3)
        few = self.long_trained.query("system == 'system1' and novice_minutes == @AT")
        for method in ("sidm", FINETUNED):
            chosen = few[(few.recipe == "T") & (few.method == method)]
            loss = known_text("{:.2f}", chosen.validation_loss.mean())
            yield f"loss-T-{method}", loss
        yield "decisive", table(judged, self.long_trained, long)


def long_numbers(frame: pd.DataFrame) -> Iterator[tuple[str, str]]:
    """Numbers of recipes R and T by name; 'not run' where trainings lack.

    Data ratios with their intervals, ratios of losses and a p-value.
    """
    ratios = {
        name: verdicts.sidm_saving(frame, *where) for name, where in SAVINGS.items()
    }
    for name, (system, sizes) in CAPPED.items():
        ratios[name] = length_curves.ratio_at_best(frame, system, sizes)
    yield from ((name, _text(ratio, 2)) for name, ratio in ratios.items())
    tuned = frame[(frame.recipe == "T") & (frame.system == "system1")]
    losses = verdicts.losses_by(tuned, END)
    for minutes in SMALL:
        _, value, low, high = verdicts.loss_ratio(losses, minutes)
        yield f"tuned-loss-{minutes:g}", _text(DataRatio(value, low, high), 3)
    _, finetuned = verdicts.ratio_of_data(losses, FINETUNING)
    yield "finetuned-saving", _text(finetuned, 3)
    judged = verdicts.verdicts(frame).query("verdict == 'T2' and system == 'system1'")
    p = judged[judged.method == "sidm"].corrected.min()
    yield "tuned-p", known_text("{:.2f}", p)


def unit_numbers(frame: pd.DataFrame) -> Iterator[tuple[str, str]]:
    """Losses with standardised units over those with raw ones, seed by seed."""
    for method, name in (("sidm", "units-sidm"), ("novice_only", "units-alone")):
        trained = frame[frame.method == method].set_index("seed")
        raw, standardised = (
            trained[trained.units == kind].validation_loss
            for kind in ("raw", "standardised")
        )
        ratios = (standardised / raw).dropna()
        yield name, " and ".join(f"{ratio:.2f}" for ratio in ratios) or "not run"


def _text(ratio: DataRatio, digits: int) -> str:
    return ratio.text(digits).replace(NO_VALUE, "not run")


def _by_method(table: pd.DataFrame) -> pd.DataFrame:
    """A table's `text` by pair and size, a column a method, both in their order."""
    place = {name: number for number, name in enumerate(METHOD_STYLES)}
    ordered = table.sort_values(
        POINT, key=lambda column: column.map(lambda value: place.get(value, value))
    )
    shown = ordered.assign(
        method=ordered.method.map(lambda name: METHOD_STYLES[name]["label"]),
        pair=ordered.system.map(system_label),
    )
    shown = shown.rename(columns={"novice_minutes": "novice data (min)"})
    return wide(shown, ["pair", "novice data (min)"], "method", "text")
