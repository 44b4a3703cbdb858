"""Tables as the commands print them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

#: Times ahead that are printed, s: those nearest to them that the table has.
HORIZONS = (0.5, 1.0, 2.0, 3.0, 5.0)
TITLES = {
    "horizon": "horizon [s]",
    "rmse": "error (rms)",
    "median": "error (median)",
    "nothing_changes": "nothing changes",
    "mean": "the mean",
}


def csv_text(table: Any) -> str:
    """The table as CSV, with six digits, and at least four after the point."""
    return table.to_csv(index=False, float_format=_number)


def _number(value: float) -> str:
    """Six digits; a large number, as a position in a map's frame, has more."""
    if abs(value) < 100:
        return f"{value:.6g}"
    return f"{value:.4f}".rstrip("0").rstrip(".")


def write_csv(path: str, table: Any) -> None:
    """Write the table as a CSV file."""
    from sidm.storage import write_atomically  # which imports NumPy

    content = csv_text(table).encode()
    # A link of the user stays a link.
    write_atomically(Path(path).resolve(), lambda file: file.write(content))


def errors_text(table: Any) -> str:
    """The table of `Model.evaluate` as text: one step, and some horizons."""
    from ownrobot.fitting.errors import ONE_STEP, OPEN_LOOP

    one_step = table[table.prediction == ONE_STEP]
    ahead = table[table.prediction == OPEN_LOOP]
    step = float(one_step.horizon.iloc[0])
    chosen = {round(horizon / step) for horizon in HORIZONS}
    if len(ahead):
        chosen.add(round(ahead.horizon.max() / step))
    ahead = ahead[(ahead.horizon / step).round().isin(chosen)]
    parts = [f"one step ahead ({step:g} s)", _text(one_step.drop(columns="horizon"))]
    if len(ahead):
        parts += ["open loop", _text(ahead)]
    return "\n".join(parts)


def worst_text(by_drive: Any, count: int = 3) -> str:
    """The drives with the largest losses in the table of `Model.evaluate_drives`."""
    worst = by_drive.head(count).drop(columns="session")
    worst = worst.dropna(axis="columns", how="all")  # older models know no mean
    worst = worst.rename(columns={"mean": "the mean", "worst": "mostly in"})
    table = worst.to_string(index=False, float_format="{:.3g}".format)
    return f"drives with the largest loss of {len(by_drive)}\n{table}"


def _text(rows: Any) -> str:
    shown = rows.drop(columns=["prediction", "average"]).rename(columns=TITLES)
    return shown.to_string(index=False, float_format="{:.3g}".format)
