"""How results are shown: a file for each states its `VIEW`, or several: sections in reading order.

Report, page, recording and notebook read the same list.  A section is a title and its parts: what the result says in
words, and figures.  Where that depends on what was found, a function of the result tells what the section holds, piece
by piece.  What a result has nothing for is left out everywhere.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, Literal, TypeVar

from numpy.typing import ArrayLike

from ema_model.errors import InputError
from ema_model.members import members
from ema_model.text import Block, InWords
from emaviz.text.html import Html
from emaviz.text.verdicts import Meaning

if TYPE_CHECKING:
    import plotly.graph_objects as go

R = TypeVar("R", bound=InWords)

# --- the pieces that a section holds ----------------------------------------------------------------------------------

Tone = Literal["", "answer", "small", "dim", "bad", "warning"]  # how a text stands out, or steps back


@dataclass(frozen=True)
class Verdict:
    """The result in two words."""

    text: str
    meaning: Meaning


@dataclass(frozen=True)
class Line:
    """A paragraph."""

    text: str
    tone: Tone = ""


@dataclass(frozen=True)
class Bullets:
    """A line for each, in a list; marks: the name and the sign of that which stands before each."""

    lines: Sequence[str]
    tone: Tone = ""
    marks: Sequence[tuple[str, str]] = ()


@dataclass(frozen=True)
class Links:
    """Where else in the same view something is seen: titles by anchor."""

    lead: str
    to: Mapping[str, str]


@dataclass(frozen=True)
class Columns:
    """A table that has several columns of text; others are a `Table` of the result's document."""

    head: Sequence[str]
    rows: Sequence[Sequence[object]]
    text_columns: int = 2
    marked: str = ""  # the sign before a cell that is set strongly


@dataclass(frozen=True)
class Markup:
    """What is neither words nor a figure: an equation, a drawing."""

    html: Html


@dataclass(frozen=True)
class Row:
    """Figures side by side where there is room; anchors: what links to them name."""

    figures: Sequence[go.Figure]
    height_px: int = 320
    anchors: Sequence[str] = ()


@dataclass(frozen=True)
class Group:
    """Pieces below a heading of their own; folded: seen after a click, framed: as a card."""

    title: str
    pieces: Sequence[Piece]
    anchor: str = ""
    folded: bool = False
    framed: bool = False


Piece = Block | Verdict | Line | Bullets | Links | Columns | Markup | Row | Group


def figures_of(pieces: Iterable[Piece]) -> Iterator[go.Figure]:
    """Those in them, in reading order."""
    for one in pieces:
        if isinstance(one, Row):
            yield from one.figures
        elif isinstance(one, Group):
            yield from figures_of(one.pieces)


# --- sections and views -----------------------------------------------------------------------------------------------


def _everything(result: InWords) -> Sequence[Block]:
    return result.document.blocks


@dataclass(frozen=True)
class Words(Generic[R]):
    """Blocks of what a result says; all of them, unless it is told which."""

    of: Callable[[R], Sequence[Block]] = _everything


@dataclass(frozen=True)
class Figures(Generic[R]):
    """Figures below each other; in a row of several they stand side by side where there is room."""

    of: Callable[[R], Sequence[Sequence[go.Figure]]]
    height_px: int | Callable[[R], int] = 320

    def height(self, result: R) -> int:
        """Of each row, px."""
        return self.height_px if isinstance(self.height_px, int) else self.height_px(result)


@dataclass(frozen=True)
class Section(Generic[R]):
    """A part of a view, with a heading of its own and an anchor to link to."""

    title: str
    anchor: str
    parts: tuple[Words[R] | Figures[R], ...] = ()
    of: Callable[[R], Iterable[Piece]] | None = None  # in the place of parts

    def pieces(self, result: R) -> Iterator[Piece]:
        """All that it holds; none leaves the section out."""
        if self.of is not None:
            yield from self.of(result)
        for part in self.parts:
            if isinstance(part, Words):
                yield from part.of(result)
            else:
                yield from (Row(row, part.height(result)) for row in part.of(result))


ANSWER: Section[Any] = Section("The answer", "answer", (Words(),))


@dataclass(frozen=True)
class View(Generic[R]):
    """Of one kind of result."""

    of: type[R]
    name: str  # of what is written, and of its entities in a recording
    title: Callable[[R], str]  # the headline
    lead: Callable[[R], str]  # a line below it: of what it is
    sections: tuple[Section[R], ...]
    meaning: Callable[[R], Meaning]  # which colours the headline
    columns: Callable[[R], Mapping[str, ArrayLike]] | None = None  # of a table (.csv), units in the names
    record: Callable[[R, Path, Mapping[str, Any]], None] | None = None  # writes .rrd on a timeline of its own
    made: Callable[[R, Mapping[str, Any]], Iterable[Piece]] | None = None  # how, by which options: ends a report

    def figures(self, result: R) -> list[go.Figure]:
        """All of them, in reading order."""
        return [one for section in self.sections for one in figures_of(section.pieces(result))]


def view_of(result: R) -> View[R]:
    """The view of a result's kind; InputError where there is none."""
    return view_for(type(result))


def view_for(kind: type[R]) -> View[R]:
    """The same by the class."""
    for stated in members("emaviz.views", "VIEW").values():
        for view in stated if isinstance(stated, tuple) else (stated,):
            if issubclass(kind, view.of):
                return view
    raise InputError(f"a {kind.__name__} has no view; print it instead")
