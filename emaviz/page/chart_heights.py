"""Charts over time that stand below each other, as high in each window as fills it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from emaviz.server.viser_private import Inside
from emaviz.text.html import Html, unescaped

# Heights by which windows are told apart: charts are laid out for the tallest that is no taller than the window.
WINDOWS_PX = (600, 640, 680, 700, 740, 780, 820, 860, 900, 940, 980, 1020, 1060, 1100, 1150, 1200, 1300, 1400)
_USUAL_PX = 900  # of a window, for which charts are built
_LEAST_PX = 64
_LOW_PX, _TITLE_SAVED_PX = 800, 2  # in windows lower than that, a chart's title is so much smaller


class ChartHeights:
    """Stacks of charts, each of which shares among its own what a window has more, or less, than the usual one."""

    def __init__(self, inside: Inside) -> None:
        self._inside = inside
        self._stacks: list[list[tuple[Any, int]]] = []

    def add(self, charts: Sequence[Any], spare_px: int = 0) -> None:
        """A stack of uPlot charts; spare_px: what the usual window has left below it."""
        more = spare_px // max(len(charts), 1)
        self._stacks.append([(one, int(one.height) + more) for one in charts])

    def fit(self, client: int, window_px: int) -> None:
        """Lays one window out for its height, one of `WINDOWS_PX`."""
        for stack in self._stacks:
            more = (window_px - _USUAL_PX) // len(stack) + (_TITLE_SAVED_PX if window_px < _LOW_PX else 0)
            for chart, usual in stack:
                self._inside.set_height(client, chart, max(usual + more, _LEAST_PX))


def style() -> Html:
    """Titles in low windows, which leave the height to the charts."""
    title = "font-size:13px;line-height:16px"
    return unescaped(f"<style>@media (max-height:{_LOW_PX - 1}px){{.u-title{{{title}}}}}</style>")
