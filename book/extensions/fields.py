"""Sphinx extension: show fields and constants in the reference with their texts.

The text of a field stands in the `Attributes` section of its class or in the comment at
the end of its line. Sphinx alone would show the section without types and defaults, and
it reads only comments that begin with `#:`.
"""

from __future__ import annotations

import ast
import dataclasses
import io
import tokenize
from typing import Any

import docstring_parser
from docstring_parser import DocstringStyle
from sphinx.application import Sphinx
from sphinx.pycode import ModuleAnalyzer

FOR_TOOLS = ("type:", "noqa", "fmt:", "pragma")  # comments that document nothing


def trailing_comments(code: str) -> dict[int, str]:
    """Comments at the end of lines of code, by the number of the line."""
    comments = {}
    for token in tokenize.generate_tokens(io.StringIO(code).readline):
        text = token.string.lstrip("#: ")
        if token.type == tokenize.COMMENT and token.line[: token.start[1]].strip():
            text = text.split("  # ")[0].split(" # type:")[0]
            if not text.startswith(FOR_TOOLS):
                comments[token.start[0]] = text
    return comments


def attributes(node: ast.ClassDef) -> dict[str, str]:
    """Texts of the fields in the `Attributes` section of a class, by name."""
    docstring = ast.get_docstring(node) or ""
    items = docstring_parser.parse(docstring, DocstringStyle.GOOGLE).params
    return {
        item.arg_name: " ".join((item.description or "").split())
        for item in items
        if item.args[0] == "attribute"
    }


def field_docs(code: str) -> dict[tuple[str, str], list[str]]:
    """Texts of a module's fields ('Class', 'field') and constants ('', 'NAME')."""
    comments, docs = trailing_comments(code), {}
    tree = ast.parse(code)
    classes = [node for node in tree.body if isinstance(node, ast.ClassDef)]
    texts = {node.name: attributes(node) for node in classes}
    for name, body in [("", tree.body), *((node.name, node.body) for node in classes)]:
        for node in body:
            ends = getattr(node, "lineno", 0), getattr(node, "end_lineno", 0)
            comment = comments.get(ends[0]) or comments.get(ends[1])
            if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
                text = texts.get(name, {}).get(node.target.id) or comment
                if text or name:  # a field without a text shows its type
                    docs[name, node.target.id] = [text or "", ""]
            elif isinstance(node, ast.Assign) and comment:
                target = node.targets[0]
                targets = target.elts if isinstance(target, ast.Tuple) else node.targets
                names = [item.id for item in targets if isinstance(item, ast.Name)]
                docs |= {(name, constant): [comment, ""] for constant in names}
    return docs


def without_arguments(
    app: Sphinx,
    what: str,
    name: str,
    thing: Any,
    options: Any,
    signature: str | None,
    returned: str | None,
) -> tuple[str, None] | None:
    """Remove the signature of a class whose fields are listed below it."""
    fields = dataclasses.is_dataclass(thing) or hasattr(thing, "_fields")
    return ("", None) if what == "class" and fields else None


def without_attributes(
    app: Sphinx, what: str, name: str, thing: Any, options: Any, lines: list[str]
) -> None:
    """Remove the `Attributes` section of a class whose fields are listed below it."""
    if what != "class" or "Attributes:" not in lines:
        return
    first = last = lines.index("Attributes:")
    while last + 1 < len(lines) and lines[last + 1][:1] in ("", " "):
        last += 1
    del lines[first : last + 1]


def setup(app: Sphinx) -> dict[str, Any]:
    """Give these texts to autodoc; a comment that begins with `#:` takes precedence."""
    plain = ModuleAnalyzer.analyze

    def analyze(self: ModuleAnalyzer) -> None:
        if not self._analyzed:
            plain(self)
            # base classes of other packages stay as they are
            if self.modname.split(".")[0] in ("sidm", "ownrobot", "companion"):
                docs = field_docs(self.code) | self.attr_docs
                # napoleon takes the text before a colon in the first line for a type
                self.attr_docs = {
                    name: [doc[0].replace(": ", " – "), *doc[1:]]
                    for name, doc in docs.items()
                }

    ModuleAnalyzer.analyze = analyze  # type: ignore[method-assign]
    app.connect("autodoc-process-signature", without_arguments)
    # before napoleon, which would make a list of the section
    app.connect("autodoc-process-docstring", without_attributes, priority=100)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
