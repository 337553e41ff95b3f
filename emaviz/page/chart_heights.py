"""Charts over time that stand below each other, and figures, as high in each window as fills it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from emaviz.figures.signals import LEAST_SPACE_PX
from emaviz.page.docked import LEFT_PX, TWO_COLUMNS_PX
from emaviz.server.viser_private import Inside, id_of
from emaviz.text.html import Html, unescaped

# Heights by which windows are told apart: charts are laid out for the tallest that is no taller than the window.
WINDOWS_PX = (600, 640, 680, 700, 740, 780, 820, 860, 900, 940, 980, 1020, 1060, 1100, 1150, 1200, 1300, 1400)
_USUAL_WIDTH_PX, _USUAL_PX = 1400, 900  # of a window, for which charts are built
_LEAST_PX = 64
_FRAME_PX = 45  # of a column, beside a figure in a folder
_VALUES = 6  # of a chart's height, which its title shares: at most so many values stand at an axis
_LOW_PX, _TITLE_SAVED_PX = 800, 2  # in windows lower than that, a chart's title is so much smaller


@dataclass(frozen=True)
class _Stack:
    """Charts with their heights in the usual window, and what they share besides in a window of two columns, px."""

    charts: tuple[tuple[Any, int], ...]
    beside_px: int


@dataclass(frozen=True)
class _Figure:
    """The height that a figure needs, that it is read at easily, and that it takes at most; what stands besides, px."""

    figure: Any
    least_px: int
    usual_px: int
    most_px: int
    beside_px: int

    def aspect(self, width_px: int, window_px: int) -> float:
        """In a window; where one column holds everything, and is scrolled, no more than is read easily."""
        columns = 2 if width_px >= TWO_COLUMNS_PX else 1
        room = window_px - self.beside_px if columns == 2 else self.usual_px
        return min(self.most_px, max(self.least_px, room)) / ((width_px - LEFT_PX) / columns - _FRAME_PX)


class ChartHeights:
    """Stacks of charts, each of which shares among its own what a window has more, or less, than the usual one."""

    def __init__(self, inside: Inside) -> None:
        self._inside = inside
        self._stacks: list[_Stack] = []
        self._figures: dict[str, _Figure] = {}
        self._windows: dict[int, tuple[int, int]] = {}  # width and height, px, by client, as far as they have told

    def add(self, charts: Sequence[Any], spare_px: int = 0, beside_px: int = 0) -> None:
        """A stack of uPlot charts, with their axes; spare_px: what the usual window has left below it.

        beside_px: what it has left besides where the parts of its tab stand in two columns.
        """
        more = spare_px // max(len(charts), 1)
        self._stacks.append(_Stack(tuple((one, int(one.height) + more) for one in charts), beside_px))

    def set_figure(self, figure: Any, least_px: int, usual_px: int, most_px: int, beside_px: int) -> None:
        """A Plotly figure alone in its column, from now on as high as that leaves it, between these heights.

        usual_px: where one column holds everything; beside_px: of a window, what else stands above and below it.
        """
        one = self._figures[id_of(figure)] = _Figure(figure, least_px, usual_px, most_px, beside_px)
        figure.aspect = one.aspect(_USUAL_WIDTH_PX, _USUAL_PX)
        for client in self._inside.pages():
            self._set_aspects(client)

    def fit(self, client: int, window_px: int) -> None:
        """Lays one window out for its height, one of `WINDOWS_PX`."""
        self._windows[client] = self._windows.get(client, (_USUAL_WIDTH_PX, 0))[0], window_px
        self._lay_out(client)
        self._set_aspects(client)

    def fit_width(self, client: int, window_px: int) -> None:
        """Lays one window out for its width."""
        before, height = self._window(client)
        self._windows[client] = window_px, height
        if (before >= TWO_COLUMNS_PX) != (window_px >= TWO_COLUMNS_PX):
            self._lay_out(client)
        self._set_aspects(client)

    def set_axes(self, chart: Any, axes: Sequence[Any]) -> None:
        """Other axes of a chart, in every window as its height asks for."""
        chart.axes = tuple(axes)
        for client in self._inside.pages():
            self._lay_out(client, chart)

    def forget(self, client: int) -> None:
        """A window was closed."""
        self._windows.pop(client, None)

    def _set_aspects(self, client: int) -> None:
        for one in list(self._figures.values()):  # the screen adds one
            self._inside.set_aspect(client, one.figure, one.aspect(*self._window(client)))

    def _window(self, client: int) -> tuple[int, int]:
        return self._windows.get(client, (_USUAL_WIDTH_PX, _USUAL_PX))

    def _lay_out(self, client: int, only: Any = None) -> None:
        width, window_px = self._window(client)
        for stack in self._stacks:
            spare = window_px - _USUAL_PX + (stack.beside_px if width >= TWO_COLUMNS_PX else 0)
            more = spare // len(stack.charts) + (_TITLE_SAVED_PX if window_px < _LOW_PX else 0)
            for chart, usual in stack.charts:
                if only is None or chart is only:
                    height = max(usual + more, _LEAST_PX)
                    self._inside.lay_out(client, chart, height, spaced(chart.axes, height))


def spaced(axes: Sequence[Any], height_px: int) -> tuple[dict[str, Any], ...]:
    """A chart's axes for its height: those that say a least space between values, px, get it in proportion.

    A high chart would else have a value for every line of text; a low one needs that to have two.
    """
    space = max(LEAST_SPACE_PX, height_px // _VALUES)
    return tuple({**axis, "space": space} if "space" in axis else dict(axis) for axis in axes)


def style() -> Html:
    """Titles in low windows, which leave the height to the charts."""
    title = "font-size:13px;line-height:16px"
    return unescaped(f"<style>@media (max-height:{_LOW_PX - 1}px){{.u-title{{{title}}}}}</style>")
