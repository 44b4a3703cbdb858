"""Results of the benchmark, made up."""

from companion.engine.provenance import record_provenance
from companion.tasks.trial import Entry, EntryResult


def made(method, task, seed, loss, status="ok", code=""):
    """A stored result with a loss."""
    about = Entry(method=method, code=code, task=task, seed=seed)
    values = {"loss": loss, "position": loss, "heading": loss, "seconds": 1.0}
    if status != "ok":
        values = {}
    return EntryResult(
        about=about,
        status=status,
        provenance=record_provenance(1.0, 1, kind="benchmark"),
        **values,
    )
