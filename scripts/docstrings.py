"""Docstrings in the manner of Google, taken apart, and written as Markdown."""

import inspect
import re
import textwrap
from dataclasses import dataclass


@dataclass
class Doc:
    """A docstring in its parts.

    Args:
        summary: the first sentence.
        body: what comes between it and the first section.
        arguments: texts of the section "Args", by name.
        returned: text of the section "Returns" or "Yields".
        raised: texts of the section "Raises", by name.
    """

    summary: str
    body: str
    arguments: dict
    returned: str
    raised: dict

    @property
    def line(self):
        """What it says before its sections, on one line."""
        return flowing(f"{self.summary} {self.body}")


def doc_of(text):
    """A docstring in its parts."""
    head, *rest = re.split(
        r"^(Args|Returns|Raises|Yields):\n", inspect.cleandoc(text or ""), flags=re.MULTILINE
    )
    sections = dict(zip(rest[::2], map(textwrap.dedent, rest[1::2]), strict=True))
    summary, _, body = head.strip().partition("\n\n")
    returned = sections.get("Returns") or sections.get("Yields") or ""
    return Doc(
        flowing(summary),
        body.strip(),
        items(sections.get("Args", "")),
        flowing(returned),
        items(sections.get("Raises", "")),
    )


def items(text):
    """Texts by name, of a section of `name: text` whose further lines are indented."""
    found = re.findall(r"^(\w+): (.*(?:\n(?:    .*)?)*)", text, flags=re.MULTILINE)
    return {name: flowing(said) for name, said in found}


def flowing(text):
    """A text on one line."""
    return " ".join(text.split())


def prose(text):
    """A text whose signs are no HTML, apart from its code."""
    pieces = re.split(r"(`[^`]*`)", text)
    pieces[::2] = [piece.replace("<", "&lt;") for piece in pieces[::2]]
    return "".join(pieces)


def cell(text):
    """The same in a cell of a table, which a bar would end."""
    return prose(text).removesuffix(".").replace("|", "&#124;")


def code(text):
    """Code in a cell of a table; between types a bar means or."""
    return f"`{text.replace(' | ', ' or ')}`" if text else ""


def python(value):
    """A value as we write it."""
    return repr(value).replace("'", '"')


def table(head, rows):
    """A table, or nothing without rows; cells are Markdown."""
    lines = [f"| {' | '.join(row)} |".replace("|  |", "| |") for row in (head, *rows)]
    return ["\n".join([lines[0], "|" + "---|" * len(head), *lines[1:]])] if rows else []


def explained(doc, arguments=True):
    """Summary, body, arguments, results and errors of a docstring."""
    parts = [prose(doc.summary), *([prose(doc.body)] if doc.body else [])]
    if arguments:
        parts += table(("argument", ""), [(f"`{name}`", cell(text)) for name, text in doc.arguments.items()])
    if doc.returned:
        parts.append(f"Returns: {prose(doc.returned)}")
    if doc.raised:
        parts.append("\n".join(f"- Raises `{name}`: {prose(text)}" for name, text in doc.raised.items()))
    return parts
