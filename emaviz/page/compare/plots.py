"""The plots of a comparison, in tabs; a chosen region and moment are marked in every one of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import plotly.graph_objects as go
import viser

from ema_model.comparison.result import Comparison, Region
from ema_model.estimation.words import calibration_table
from ema_model.quantities.variables import VARIABLES
from emaviz.figures import (
    calibration_scores,
    explained,
    order_spectrum,
    overlay,
    quantity,
    residual_against,
    residual_polar,
    residual_time,
)
from emaviz.figures.theme import why_missing
from emaviz.page.page import Page
from emaviz.text.html import add_html, html
from emaviz.text.notes import note
from emaviz.text.told import shown

_CONFIG = {"displayModeBar": False}
_FIRST = next(iter(VARIABLES))
_EMPTY = "–"


@dataclass(frozen=True, eq=False)
class View:
    """What the plots show."""

    comparison: Comparison
    recording: int = 0
    region: Region | None = None
    moment_s: float | None = None


@dataclass
class _Plot:
    """A place of a figure on the page, and of the line that says why there is none; aspect is height over width."""

    draw: Callable[[View], go.Figure]
    aspect: float
    handle: Any
    why: Any


class ComparePlots:
    """Tabs over time, against a variable, over the motor's turn, what explains it, and the calibration.

    Everything is drawn on the screen's thread.
    """

    def __init__(self, page: Page) -> None:
        self._page = page
        self._view: View | None = None
        gui = page.server.gui
        self._signal = gui.add_dropdown("Signal", [_EMPTY])
        self._titles: dict[str, str] = {}
        self._variables: dict[str, str] = {}
        tabs = gui.add_tab_group()
        with tabs.add_tab("Time", viser.Icon.CHART_LINE):
            self._time = [
                self._add(lambda v: overlay.figure(v.comparison, self._chosen(), v.recording, **_marks(v)), 0.42),
                self._add(lambda v: residual_time.figure(v.comparison, self._chosen(), v.recording, **_marks(v)), 0.42),
            ]
        with tabs.add_tab("Against", viser.Icon.CHART_DOTS):
            self._variable = gui.add_dropdown("Variable", [_EMPTY])
            self._against = [self._add(self._draw_against, 0.66)]
        with tabs.add_tab("Orders", viser.Icon.ROTATE_CLOCKWISE):
            self._turn = [
                self._add(lambda v: order_spectrum.figure(v.comparison, highlight=v.region), 0.42),
                self._add(lambda v: residual_polar.figure(v.comparison, self._chosen(), highlight=v.region), 0.8),
            ]
        with tabs.add_tab("Explained by", viser.Icon.QUESTION_MARK):
            self._why = [self._add(lambda v: explained.figure(v.comparison, highlight=v.region), 0.7)]
        with tabs.add_tab("Calibration", viser.Icon.TARGET):
            self._fit = [self._add(lambda v: calibration_scores.figure(v.comparison), 0.8)]
            self._numbers = add_html(gui)
        self._signal.on_update(lambda event: event.client and self._post([*self._time, *self._against, *self._turn]))
        self._variable.on_update(lambda event: event.client and self._post(self._against))

    def add_against(self) -> None:
        """The figure of `Against` a second time, at this place of the page."""
        self._against.append(self._add(self._draw_against, 0.36))

    def begin(self, view: View) -> None:
        """A new comparison: its signals and variables to choose from, the telling ones first."""
        self._view = view
        comparison = view.comparison
        self._titles = {quantity.of_signal(comparison, name).title: name for name in comparison.recordings[0].measured}
        self._signal.options = tuple(self._titles)
        known = [name for name in VARIABLES if name in comparison.residuals.variables]
        self._variables = {quantity.of_variable(comparison, name).title: name for name in known}
        self._variable.options = tuple(self._variables) or (_EMPTY,)
        first = comparison.explained_by[0].variable if comparison.explained_by else ""
        self._choose(comparison.primary, first)
        fit = comparison.calibration
        table = shown(calibration_table(fit, comparison.actuator.axes) if fit is not None else None)
        self._numbers.content = html('<div style="overflow-x:auto;font-size:11px;padding:0 2px">{}</div>', table)
        self._draw(list(self._all()))

    def show(self, view: View) -> None:
        """Another region, moment or recording of the same comparison."""
        self._view = view
        if view.region is not None:
            self._choose(view.region.signal, view.region.variable)
        self._draw(list(self._all()))

    def move(self, view: View) -> None:
        """Only the play-head has moved."""
        self._view = view
        self._draw(self._time)

    def _choose(self, signal: str, variable: str) -> None:
        for dropdown, names, wanted in (
            (self._signal, self._titles, signal),
            (self._variable, self._variables, variable),
        ):
            title = next((title for title, name in names.items() if name == wanted), None)
            if title is not None and dropdown.value != title:
                dropdown.value = title

    def _chosen(self) -> str | None:
        return self._titles.get(str(self._signal.value))

    def _draw_against(self, view: View) -> go.Figure:
        variable = self._variables.get(str(self._variable.value), _FIRST)
        return residual_against.figure(view.comparison, variable, self._chosen(), highlight=view.region)

    def _add(self, draw: Callable[[View], go.Figure], aspect: float) -> _Plot:
        """A plot at this place of the page; it is drawn when there is something to draw."""
        gui = self._page.server.gui
        handle = gui.add_plotly(go.Figure(), config=_CONFIG, aspect=aspect, visible=False)
        return _Plot(draw, aspect, handle, add_html(gui, visible=False))

    def _all(self) -> Iterator[_Plot]:
        for group in (self._time, self._against, self._turn, self._why, self._fit):
            yield from group

    def _post(self, plots: list[_Plot]) -> None:
        self._page.screen.post(f"plots {len(plots)}", lambda: self._draw(plots))

    def _draw(self, plots: list[_Plot]) -> None:
        if self._view is None:
            return
        for plot in plots:
            figure = plot.draw(self._view)
            why = why_missing(figure)
            if why:
                plot.why.content = note(why)
            else:
                plot.handle.figure = figure
            for one, seen in ((plot.handle, not why), (plot.why, bool(why))):
                if one.visible != seen:
                    one.visible = seen


def _marks(view: View) -> dict[str, Any]:
    return {"highlight": view.region, "moment_s": view.moment_s}
