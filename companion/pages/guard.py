"""Words of a page held against the results that they speak of: a sentence that no longer holds stops the page."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from IPython.display import Markdown


class Outdated(AssertionError):
    """A sentence that the results do not bear out; the message names it."""


def hold(
    claims: Mapping[str, Callable[[], bool]],
    preset: str,
    written_for: str = "laptop",
    of: str = "the preset",
) -> Markdown | None:
    """Check the claims of a page that was written for the stored results of a preset.

    Args:
        claims: a claim in the page's own words -> whether the results bear it out,
            asked for these results alone.
        preset: whose results the page shows now.
        written_for: whose results the words are about.
        of: what the two are, where it is no preset.

    Returns:
        Nothing, or for other results a line that the words are not about them.

    Raises:
        Outdated: a claim does not hold.
    """
    if preset != written_for:
        words = f"The words of this page are about results of {of} `{written_for}`; these are of `{preset}`."
        return Markdown(f"*{words}*")
    for claim, holds in claims.items():
        if not holds():
            raise Outdated(
                f"the stored results no longer bear out '{claim}': write the page anew"
            )
    return None
