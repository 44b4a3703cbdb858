"""Tables as the commands print them."""

from __future__ import annotations

from typing import Any


def errors_text(table: Any) -> str:
    """The table of `Model.evaluate` as text, with the first and every fifth horizon."""
    rows = table[(table.horizon == 1) | (table.horizon % 5 == 0)]
    return rows.to_string(index=False, float_format="{:.3g}".format)
