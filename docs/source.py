"""What the reference pages take from the source: the fields of classes with their comments."""

import ast
import html
import inspect
import io
import re
import textwrap
import tokenize
from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Field:
    """A field as the source has it: its annotation, and the comment beside or above it."""

    annotation: str
    comment: str


def fields_of(cls: type) -> dict[str, Field]:
    """The annotated fields in the body of a class, by name."""
    text = textwrap.dedent(inspect.getsource(cls))
    (node,) = ast.parse(text).body
    assert isinstance(node, ast.ClassDef)
    comments = _comments(text)
    alone = {n for n, line in enumerate(text.splitlines(), 1) if line.lstrip().startswith("#")}
    return {
        part.target.id: Field(ast.unparse(part.annotation), _comment(part, comments, alone))
        for part in node.body
        if isinstance(part, ast.AnnAssign) and isinstance(part.target, ast.Name)
    }


def _comments(text: str) -> dict[int, str]:
    """By the number of their line."""
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    return {t.start[0]: t.string.lstrip("# ") for t in tokens if t.type == tokenize.COMMENT}


def _comment(part: ast.AnnAssign, comments: dict[int, str], alone: set[int]) -> str:
    first, last = part.lineno, part.end_lineno or part.lineno
    while first - 1 in alone:
        first -= 1
    return " ".join(comments[n] for n in range(first, last + 1) if n in comments)


def table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """A table in Markdown."""
    names = tuple(head)
    first, *others = (f"| {' | '.join(map(_cell, row))} |\n" for row in (names, *rows))
    return "".join([first, f"|{'---|' * len(names)}\n", *others])


def _cell(text: str) -> str:
    """A text whose bars do not end the cell, in code neither."""
    text = re.sub(r"`([^`]*\|[^`]*)`", lambda m: f"<code>{html.escape(m[1])}</code>", text)
    return text.replace("|", "&#124;")
