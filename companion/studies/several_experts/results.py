"""Tables, claims and a figure of novices whose SIDM was trained on several experts."""

from __future__ import annotations

import dataclasses

import pandas as pd
from matplotlib.figure import Figure

from companion.figures.dots import dot_plots, name_rows
from companion.figures.style import METHOD_LABELS, SIZE_STYLES, legend_below
from companion.statistics.claims import COLUMNS, claim_rows
from companion.statistics.pairs import pooled_comparison
from companion.statistics.savings import with_savings, with_savings_texts
from companion.studies.several_experts.measure import WAYS
from ownrobot.plots import finish, styled
from sidm.systems import Robot, family_robot, find_system

#: What the paper says of the loss and of the length of the training (section 6).
PAPER = "'may lead to a more accurate' one"
FASTER = "'may also lead to faster training'"
#: Labels of Figure 3's methods, which have no pretrained SIDM.
REFERENCES = {
    "novice_only": METHOD_LABELS["novice_only"],
    "sidm": "with SIDM, all at once",
}
#: Ways of training the novice that the figure shows -> titles of their plots.
SHOWN = {
    "all": "from the nearest expert's parts",
    "fresh_parts": "fresh encoder and decoder",
}
#: Labels of the two single experts.
PAPER_EXPERT, MEMBER = "the paper's expert", "1 of the family"


def label(number: int, paper: bool) -> str:
    """The experts that an SIDM was trained on, in figures and tables."""
    return f"{number} experts" if number > 1 else PAPER_EXPERT if paper else MEMBER


def table(frame: pd.DataFrame) -> pd.DataFrame:
    """A row per novice.

    There are the `experts` that its SIDM was trained on and their `number`; the `way`
    of its own training, `novice_minutes` and `seed`; its validation `loss`; the
    `samples` seen by its training, with the patience of early stopping, and the
    `minutes` of processor time of this training.
    """
    values = ["validation_loss", "samples", "found_seconds"]  # by way and size
    rows = frame.assign(way=[list(WAYS)] * len(frame), number=frame.experts)
    rows["experts"] = [
        label(number, paper)
        for number, paper in zip(rows.number, rows.paper, strict=True)
    ]
    rows = rows.explode(["way", *values]).explode(["sizes", *values])
    rows["order"] = rows.experts.map({PAPER_EXPERT: 0, MEMBER: 1}).fillna(rows.number)
    rows = rows.sort_values(["order", "seed"], kind="stable", ignore_index=True)
    numbers = {
        "novice_minutes": rows.sizes,
        "loss": rows.validation_loss,
        "samples": rows.samples,
        "minutes": rows.found_seconds.astype(float) / 60,
    }
    numbers = {name: column.astype(float) for name, column in numbers.items()}
    columns = ["system", "experts", "number", "seed", "way"]
    return rows[columns].assign(**numbers)


def by_size(table: pd.DataFrame) -> pd.DataFrame:
    """Means over seeds, compared with the paper's expert alone.

    A row per `experts`, `way` and size: `seeds`, mean `loss`, `samples` and `minutes`;
    the `ratio` of the losses with `low` and `high`; and `saved`, `saved_low`,
    `saved_high` and `bound`: how many times as much data of the novice is needed with
    the SIDM of the paper's expert.
    """
    means = _means(table, ["system", "experts", "way"]).reset_index()
    is_paper = table.experts == PAPER_EXPERT
    others, paper = table[~is_paper], table[is_paper]
    return with_savings(means, others, paper, ["system", "way"], ["experts"])


def costs(joint: pd.DataFrame) -> pd.DataFrame:
    """The means of `by_size` for Figure 3's methods: a row per method and size.

    `joint` are results of these methods, whose parts are all trained at once.
    """
    rows = joint[joint.method.isin(list(REFERENCES))]
    rows = rows.assign(loss=rows.validation_loss, minutes=rows.seconds / 60)
    return _means(rows, ["method"]).reset_index()


def _means(rows: pd.DataFrame, by: list[str]) -> pd.DataFrame:
    """Number of seeds and means of novices' numbers, by group and size."""
    groups = rows.groupby([*by, "novice_minutes"], sort=False)
    means = groups[["loss", "samples", "minutes"]].mean()
    means.insert(0, "seeds", groups.size())
    return means


def page_table(rows: pd.DataFrame) -> pd.DataFrame:
    """Rows of `by_size` or `costs` for a page: numbers and intervals as text."""
    formats = {"loss": "{:.3f}", "samples": "{:,.0f}", "minutes": "{:.1f}"}
    texts = {name: rows[name].map(text.format) for name, text in formats.items()}
    page = rows.rename(columns={"novice_minutes": "novice (min)"}).assign(**texts)
    columns = ["novice (min)", "seeds", *formats]
    if "experts" in rows:
        return page[["experts", *columns]].join(with_savings_texts(rows))
    labels = [REFERENCES[method] for method in rows.method]
    page.insert(0, "as in Figure 3", labels)
    return page[["as in Figure 3", *columns]]


def experts_table(frame: pd.DataFrame) -> pd.DataFrame:
    """A row per pretraining for a page: its losses, and the nearest expert by size."""
    order = {"experts": True, "paper": False, "seed": True}
    rows = []
    for record in frame.sort_values([*order], ascending=[*order.values()]).itertuples():
        roles = ["expert"] if record.paper else []
        roles += [f"member{number}" for number in range(len(record.roles))]
        nearest = [
            f"{role} {losses[roles.index(role)]:.3g}"
            for role, losses in zip(record.nearest, record.before, strict=True)
        ]
        losses = record.experts_loss
        line = (
            label(record.experts, record.paper),
            record.seed,
            f"{record.experts_samples:,}",
            f"{losses[0]:.3f}" if record.paper else "-",
            f"{max(losses):.3f}",
            ", ".join(nearest),
        )
        rows.append(line)
    names = ["experts", "seed", "samples of the SIDM"]
    names += ["test loss of the paper's", "of the worst"]
    names += ["nearest by size, and the loss with its parts as they are"]
    return pd.DataFrame(rows, columns=names)


def robots_table(system: str, members: int) -> tuple[list[str], list[tuple]]:
    """Head and rows of a table: parameters of a pair's robots and of family members."""
    pair = find_system(system)
    robots = {"novice": pair.novice, PAPER_EXPERT: pair.expert}
    robots |= {f"member {number}": family_robot(number) for number in range(members)}
    rows = []
    for field in dataclasses.fields(Robot):
        values = [f"{getattr(robot, field.name):.3g}" for robot in robots.values()]
        rows.append((f"`{field.name}`", *(f"{float(value):g}" for value in values)))
    return ["parameter", *robots], rows


def claims(table: pd.DataFrame, joint: pd.DataFrame) -> pd.DataFrame:
    """Claims that the SIDM of most experts gives a smaller loss and shorter trainings.

    The loss is compared with that after the paper's expert alone, and after a single
    one of the family, which is as near to the novice as the others are; a claim for
    each way, all sizes together. The training of encoder and decoder alone is compared
    with the training of all parts together with an SIDM that was not pretrained, of
    which `joint` are results.
    """
    most = table[(table.number == table.number.max()) & (table.number > 1)]
    if not len(most):
        return pd.DataFrame(columns=list(COLUMNS))
    name, parts = most.experts.iloc[0], []
    for way, text in WAYS.items():
        novices = most[most.way == way]
        for single in (PAPER_EXPERT, MEMBER):
            others = table[(table.experts == single) & (table.way == way)]
            compared = pooled_comparison(novices, others, by=["way"], value="loss")
            claim = f"loss after {name} / after {single}; {text}"
            parts.append(claim_rows(compared, claim, PAPER))
    together = joint[joint.method == "sidm"]
    for way in ("parts", "fresh_parts"):
        novices = most[most.way == way]
        compared = pooled_comparison(novices, together, by=["way"], value="samples")
        claim = f"samples after {name} / with SIDM as in Figure 3; {WAYS[way]}"
        parts.append(claim_rows(compared, claim, FASTER))
    return pd.concat(parts, ignore_index=True)


@styled
def figure(table: pd.DataFrame, joint: pd.DataFrame) -> Figure:
    """Validation losses with the SIDM of one or more experts, a row for each.

    A plot for each way of SHOWN, a dot for the mean of each size with a bar from the
    lowest to the highest loss. `joint`, results of Figure 3's methods on the same
    sizes, are the last rows.
    """
    alike = joint.rename(columns={"validation_loss": "loss"})
    alike = alike.assign(experts=alike.method.map(REFERENCES)).dropna(subset="experts")
    experts = list(dict.fromkeys([*table.experts, *alike.experts]))
    sizes = sorted(table.novice_minutes[table.number > 1].unique())
    figure, panels = dot_plots(len(SHOWN), len(experts))
    if len(table):
        panels[1].sharex(panels[0])
    for axes, (way, title) in zip(panels, SHOWN.items(), strict=True):
        rows = pd.concat([table[table.way == way], alike]) if len(table) else table
        for number, minutes in enumerate(sizes):
            groups = rows[rows.novice_minutes == minutes].groupby("experts").loss
            means = groups.agg(["mean", "min", "max"])
            heights = [experts.index(name) for name in means.index]
            bars = [means["mean"] - means["min"], means["max"] - means["mean"]]
            style = SIZE_STYLES[number % len(SIZE_STYLES)] | {"linestyle": ""}
            style |= {"label": f"{minutes:g} min", "capsize": 2, "elinewidth": 1}
            axes.errorbar(means["mean"], heights, xerr=bars, **style)
        axes.set(title=title, xlabel="validation loss (-)")
        finish(axes, legend=False)
        if len(rows):
            name_rows(axes, experts)
    legend_below(figure, panels)
    return figure
