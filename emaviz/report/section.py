"""What a report is made of: sections that write HTML, and the figures that they place."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, Generic, TypeVar

import plotly.graph_objects as go

from ema_model.members import classes
from emaviz.report.markup import escape

Subject = TypeVar("Subject")


class Figures:
    """The figures of a page in their order; drawn in the browser when they come into sight."""

    def __init__(self) -> None:
        self.placed: list[go.Figure] = []

    def place(self, figure: go.Figure, height_px: int = 320, anchor: str = "") -> str:
        """The element in which the figure will stand; anchor: what links to it name."""
        self.placed.append(figure)
        named = f' id="{escape(anchor)}"' if anchor else ""
        return f'<div class="figure"{named} style="height:{height_px}px" data-figure="{len(self.placed) - 1}"></div>'


def pair(*figures: str) -> str:
    """Placed figures side by side where there is room, else one below the other."""
    return f'<div class="pair">{"".join(figures)}</div>'


class Section(ABC, Generic[Subject]):
    """One part of a report, with a heading of its own and an anchor to link to."""

    title: str
    anchor: str
    place: int  # among the sections of its report

    @abstractmethod
    def body(self, subject: Subject, figures: Figures) -> str:
        """The HTML below the heading; "" leaves the section out."""


def sections(package: str) -> tuple[Any, ...]:
    """The sections that the files of a report's folder define, in their order."""
    found: list[Any] = classes(package, Section)
    return tuple(sorted((one() for one in found), key=lambda one: one.place))
