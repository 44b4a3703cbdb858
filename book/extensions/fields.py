"""Fields and constants in the reference: a comment at the end of their line is what autodoc says of them.

Sphinx reads comments that begin with `#:` alone; here the units and shapes of fields
stand in plain ones.
"""

from __future__ import annotations

import ast
import dataclasses
import io
import tokenize
from typing import Any

from sphinx.application import Sphinx
from sphinx.pycode import ModuleAnalyzer


def trailing_comments(code: str) -> dict[int, str]:
    """Comments at the end of a line of code, by the line's number; those for tools are none."""
    found = {}
    for token in tokenize.generate_tokens(io.StringIO(code).readline):
        words = token.string.lstrip("#: ")
        if token.type == tokenize.COMMENT and token.line[: token.start[1]].strip():
            words = words.split("  # ")[0].split(" # type:")[0]
            if not words.startswith(("type:", "noqa", "fmt:", "pragma")):
                found[token.start[0]] = words
    return found


def field_docs(code: str) -> dict[tuple[str, str], list[str]]:
    """What the comments of a module say of its classes' fields ('Class', 'field') and of its constants ('', 'NAME')."""
    comments, found = trailing_comments(code), {}
    tree = ast.parse(code)
    for name, body in [
        ("", tree.body),
        *((n.name, n.body) for n in tree.body if isinstance(n, ast.ClassDef)),
    ]:
        for node in body:
            line = comments.get(getattr(node, "lineno", 0)) or comments.get(
                getattr(node, "end_lineno", 0)
            )
            if (
                isinstance(node, ast.AnnAssign)
                and isinstance(node.target, ast.Name)
                and (line or name)
            ):
                # a field without a comment shows its type
                found[name, node.target.id] = [line or "", ""]
            elif isinstance(node, ast.Assign) and line:
                targets = (
                    node.targets[0].elts
                    if isinstance(node.targets[0], ast.Tuple)
                    else node.targets
                )
                found |= {
                    (name, one.id): [line, ""]
                    for one in targets
                    if isinstance(one, ast.Name)
                }
    return found


def without_arguments(
    app: Sphinx,
    what: str,
    name: str,
    thing: Any,
    options: Any,
    signature: str | None,
    returned: str | None,
) -> tuple[str, None] | None:
    """A class of fields lists them below, with types and defaults; its signature would say the same again."""
    fields = dataclasses.is_dataclass(thing) or hasattr(thing, "_fields")
    return ("", None) if what == "class" and fields else None


def setup(app: Sphinx) -> dict[str, Any]:
    """Let the reader of modules know these comments, too; what has a `#:` keeps it."""
    plain = ModuleAnalyzer.analyze

    def analyze(self: ModuleAnalyzer) -> None:
        if not self._analyzed:
            plain(self)
            # bases from elsewhere keep their own ways
            if self.modname.split(".")[0] in ("sidm", "companion"):
                found = field_docs(self.code) | self.attr_docs
                # What stands before a colon of the first line napoleon would call a
                # type.
                self.attr_docs = {
                    name: [doc[0].replace(": ", " – "), *doc[1:]]
                    for name, doc in found.items()
                }

    ModuleAnalyzer.analyze = analyze  # type: ignore[method-assign]
    app.connect("autodoc-process-signature", without_arguments)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
