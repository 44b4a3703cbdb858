"""Checks that a page's claims agree with the results; a false claim stops the page."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from IPython.display import Markdown


class Outdated(AssertionError):
    """A claim that the stored results contradict; the message names the claim."""


def check_claims(
    claims: Mapping[str, Callable[[], bool]],
    preset: str,
    written_for: str = "laptop",
    subject: str = "the preset",
) -> Markdown | None:
    """Check the claims of a page against the results that the page was written for.

    Args:
        claims: a claim in the page's words -> a function that returns whether the
            results agree. It is called only where `preset` is `written_for`.
        preset: the preset whose results the page shows now.
        written_for: the preset whose results the page's text describes.
        subject: what `preset` and `written_for` are, where they are no presets.

    Returns:
        None; for other results a line that says that the text does not describe them.

    Raises:
        Outdated: a claim is false.
    """
    if preset != written_for:
        return Markdown(
            f"*The words of this page are about results of {subject} `{written_for}`; "
            f"these are of `{preset}`.*"
        )
    for claim, holds in claims.items():
        if not holds():
            raise Outdated(
                f"the stored results no longer bear out '{claim}': write the page anew"
            )
    return None
