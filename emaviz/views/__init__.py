"""How results are shown: a file for each states its `VIEW`, its sections in reading order.

Report, page, recording and notebook read the same list.  A section is a title and its parts: what the result says in
words, and figures.  What a result has nothing for is left out everywhere.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from numpy.typing import ArrayLike

from ema_model.errors import InputError
from ema_model.members import members
from ema_model.text import Block, InWords
from emaviz.text.results import Meaning

if TYPE_CHECKING:
    import plotly.graph_objects as go

R = TypeVar("R", bound=InWords)


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
    parts: tuple[Words[R] | Figures[R], ...]


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

    def figures(self, result: R) -> list[go.Figure]:
        """All of them, in reading order."""
        return [
            one
            for section in self.sections
            for part in section.parts
            if isinstance(part, Figures)
            for row in part.of(result)
            for one in row
        ]


def view_of(result: R) -> View[R]:
    """The view of a result's kind; InputError where there is none."""
    return view_for(type(result))


def view_for(kind: type[R]) -> View[R]:
    """The same by the class."""
    for view in members("emaviz.views", "VIEW").values():
        if issubclass(kind, view.of):
            return view
    raise InputError(f"a {kind.__name__} has no view; print it instead")
