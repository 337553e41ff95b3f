"""A result in words: lines, tables, notes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from importlib import import_module
from importlib.util import find_spec
from typing import Literal

# --- what a result says, as data --------------------------------------------------------------------------------------
# What a result says, as data: lines, notes, remarks, facts, tables; a terminal, a page and a notebook show them.

Severity = Literal["good", "bad", "warning", "note"]
# As CSS has it, on light and on dark.  A warning has neither a fault's colour nor a model's.
COLOURS: dict[Severity, str] = {
    "good": "light-dark(#2b8a3e,#51cf66)",
    "bad": "light-dark(#e03131,#ff8787)",
    "warning": "light-dark(#c2255c,#faa2c1)",
    "note": "#868e96",
}
_GAP = 3  # characters between the columns of plain text
_STYLE = "border-collapse:collapse;margin:.6em 0;font-variant-numeric:tabular-nums"
_CELL = "padding:1px 8px 1px 0;text-align:right;border:0;white-space:nowrap"
_FIRST = "padding:1px 8px 1px 0;text-align:left;border:0"
_HEAD = ";font-weight:400;opacity:.65;white-space:normal"
_NAMES = 24  # characters of a fact's name


@dataclass(frozen=True)
class Lines:
    """Sentences that belong together, one below the other."""

    lines: Sequence[str]
    title: str = ""

    @property
    def text(self) -> str:
        """Plain; indented below a title."""
        return "\n".join([self.title, *(f"  {line}" for line in self.lines)] if self.title else self.lines)

    @property
    def html(self) -> str:
        """Escaped."""
        head = f"<b>{escape(self.title)}</b><br>" if self.title else ""
        return f"<p>{head}{'<br>'.join(map(escape, self.lines))}</p>"


@dataclass(frozen=True)
class Note:
    """A warning."""

    line: str

    @property
    def text(self) -> str:
        """'! …'."""
        return f"! {self.line}"

    @property
    def html(self) -> str:
        """Escaped, with a mark before it."""
        return f'<p style="border-left:3px solid {COLOURS["warning"]};padding-left:8px">{escape(self.line)}</p>'


@dataclass(frozen=True)
class Remark:
    """What stands out of a result, in a word or two, and what there is to say of it."""

    head: str
    line: str
    severity: Severity = "note"

    @property
    def text(self) -> str:
        """'not healthy: k1 friction'."""
        return f"{self.head}: {self.line}"


@dataclass(frozen=True)
class Remarks:
    """Those of a result, the one that matters first."""

    remarks: Sequence[Remark]

    @property
    def text(self) -> str:
        """A line for each."""
        return "\n".join(one.text for one in self.remarks)

    @property
    def html(self) -> str:
        """Escaped, a mark of its colour before each."""
        style = "border-left:3px solid {};padding-left:8px"
        lines = ((style.format(COLOURS[one.severity]), escape(one.text)) for one in self.remarks)
        return "".join(f'<p style="{style}">{line}</p>' for style, line in lines)


@dataclass(frozen=True)
class Facts:
    """Names with what is said of each; below them, what is to be said of all."""

    facts: Mapping[str, str]
    title: str = ""
    lines: Sequence[str] = ()

    @property
    def text(self) -> str:
        """A line for each, indented below the title."""
        told = [*(f"{name:{_NAMES}}  {one}" for name, one in self.facts.items()), *self.lines]
        return Lines(told, self.title).text

    @property
    def html(self) -> str:
        """Escaped."""
        return Table(("",), list(self.facts.items()), self.title).html + (Lines(self.lines).html if self.lines else "")


@dataclass(frozen=True)
class Table:
    """Numbers, each written already; the first cell of a row names it."""

    head: Sequence[str]  # of the columns after the first
    rows: Sequence[Sequence[str]]
    title: str = ""
    remarks: Sequence[str] = ()  # beside the rows, or none at all
    unit: str = ""  # what all numbers are in, said beside the head
    severities: Sequence[Severity | None] = ()  # of the rows: the colour of their last number

    @property
    def text(self) -> str:
        """Columns below each other, the first to the left; rows are indented below a title."""
        indent = "  " if self.title else ""
        names = [self.title, *(indent + row[0] for row in self.rows)]
        columns = [[head, *(row[i] for row in self.rows)] for i, head in enumerate(self.head, 1)]
        widths = [max(map(len, column)) + _GAP for column in columns]
        first = max(map(len, names))
        beside = [self.unit, *(self.remarks or [""] * len(self.rows))]
        lines = []
        for i, name in enumerate(names):
            numbers = "".join(column[i].rjust(width) for column, width in zip(columns, widths))
            lines.append(f"{name:{first}}{numbers}{' ' * _GAP}{beside[i]}".rstrip())
        return "\n".join(lines)

    @property
    def html(self) -> str:
        """Escaped."""
        shown = [_cells("th", [self.title, *self.head], self.unit)]
        for i, row in enumerate(self.rows):
            severity = self.severities[i] if self.severities else None
            colour = f";color:{COLOURS[severity]}" if severity else ""
            shown.append(_cells("td", row, self.remarks[i] if self.remarks else "", colour))
        return f'<div style="overflow-x:auto"><table style="{_STYLE}">{"".join(shown)}</table></div>'


def _cells(tag: str, row: Sequence[str], beside: str, colour: str = "") -> str:
    styles = [_FIRST, *([_CELL] * (len(row) - 1)), _FIRST]
    styles[len(row) - 1] += colour
    styles = [style + (_HEAD if tag == "th" else "") for style in styles]
    cells = (f'<{tag} style="{style}">{escape(cell)}</{tag}>' for style, cell in zip(styles, (*row, beside)))
    return f"<tr>{''.join(cells)}</tr>"


Block = Facts | Lines | Note | Remarks | Table


@dataclass(frozen=True)
class Document:
    """Blocks, one after another."""

    blocks: Sequence[Block]

    @property
    def text(self) -> str:
        """For a terminal: an empty line between blocks, but for notes, which follow what they are about."""
        parts = []
        for i, block in enumerate(self.blocks):
            parts += ["\n" if i == 0 or isinstance(block, Note) else "\n\n", block.text]
        return "".join(parts[1:])

    @property
    def html(self) -> str:
        """For a notebook; whatever came from a file is escaped."""
        return f"<div>{''.join(block.html for block in self.blocks)}</div>"


class InWords:
    """A result that shows itself: as text when it is printed, as HTML in a notebook.

    What it says is `document_of(result)`, in the result's own file, in the one of that name with `_words`, or in
    `words.py` beside it.
    """

    @property
    def document(self) -> Document:
        """What it says."""
        own = import_module(type(self).__module__)
        if not hasattr(own, "document_of"):
            beside = f"{own.__name__}_words"
            own = import_module(beside if find_spec(beside) else f"{own.__name__.rpartition('.')[0]}.words")
        return own.document_of(self)

    def __str__(self) -> str:
        return self.document.text

    __repr__ = __str__

    def _repr_html_(self) -> str:
        return self.document.html
