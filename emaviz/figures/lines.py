"""Lines over time in full resolution, of which charts draw a window; their spectra and their difference as figures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from ema_model.errors import InputError
from ema_model.recordings import signals
from emaviz.colours import DIFFERENCE
from emaviz.figures import theme
from emaviz.figures.theme import envelope, line, plain

Array = NDArray[np.float64]
Window = tuple[float, float]  # from and to, s
POINTS = 384  # of a line of a live chart, at most: a part's least and most for each two pixels of its width


@dataclass(frozen=True, eq=False)
class Line:
    """time_s and values (n,), in the unit of its chart."""

    name: str
    colour: str
    time_s: Array
    values: Array
    dash: str = "solid"


@dataclass(frozen=True, eq=False)
class Lines:
    """Of one chart.  difference: which line less which is its difference, None where that has no meaning; time: what
    stands below."""

    title: str
    unit: str
    lines: Sequence[Line]
    difference: tuple[int, int] | None = None
    time: str = "Time [s]"

    @property
    def every_time_s(self) -> Array:
        """Of all lines, rising."""
        return np.unique(np.concatenate([one.time_s for one in self.lines]))

    @classmethod
    def of(
        cls,
        title: str,
        unit: str,
        time_s: Array,
        *named: tuple[str, str, Array],
        difference: tuple[int, int] | None = None,
    ) -> Lines:
        """On one time base; named: name, colour and values of each."""
        return cls(title, unit, [Line(name, colour, time_s, values) for name, colour, values in named], difference)


def within(time_s: Array, window_s: Window | None) -> slice:
    """The samples of a window, two at least; all where there is none."""
    if window_s is None:
        return slice(0, len(time_s))
    first = int(np.searchsorted(time_s, window_s[0] - 1e-9))
    last = int(np.searchsorted(time_s, window_s[1] + 1e-9, side="right"))
    first = max(min(first, len(time_s) - 2), 0)
    return slice(first, max(last, first + 2))


def clipped(window_s: Window | None, time_s: Array) -> Window | None:
    """The part of a window in which there are samples, three steps of them at least; None where that is all."""
    if window_s is None or len(time_s) < 2:
        return None
    start, end = float(time_s[0]), float(time_s[-1])
    least = min(3.0 * (end - start) / (len(time_s) - 1), end - start)
    low = min(max(window_s[0], start), end - least)
    high = max(min(window_s[1], end), low + least)
    return (low, high) if low > start or high < end else None


class LiveLines:
    """Live charts of one time base, from above; each draws a window of its lines with all points there is room for."""

    def __init__(self) -> None:
        self.handles: list[Any] = []
        self._drawn: list[Lines] = []
        self._window_s: Window | None = None

    def lines(self, place: int) -> Lines | None:
        """What a chart draws, whole; None before there is anything."""
        return self._drawn[place] if place < len(self._drawn) else None

    def zoom(self, window_s: Window | None) -> None:
        """Draws this window from now on; None: all."""
        self._window_s = clipped(window_s, self._drawn[0].lines[0].time_s) if self._drawn else window_s
        self._redraw()

    def draw(self, every: Sequence[Lines]) -> None:
        """A chart's lines each; another length of time is shown whole."""
        before, self._drawn = self._drawn, list(every)
        if before and not np.array_equal(_ends(before[0]), _ends(every[0])):
            self._window_s = None
        self._redraw()

    def _redraw(self) -> None:
        for handle, one in zip(self.handles, self._drawn):
            time_s = one.lines[0].time_s
            part = within(time_s, self._window_s)
            handle.data = envelope(time_s[part], [each.values[part] for each in one.lines], POINTS)


def _ends(one: Lines) -> Array:
    return one.lines[0].time_s[[0, -1]]


# --- figures of a window ----------------------------------------------------------------------------------------------

_FLOOR = 1e-6  # of the largest amplitude, below which none is drawn


def of_window(one: Lines, window_s: Window | None) -> Lines:
    """The lines in it, without those that have no values there."""
    inside = []
    for each in one.lines:
        if len(each.time_s) > 1:
            part = within(each.time_s, window_s)
            if np.any(np.isfinite(each.values[part])):
                inside.append(replace(each, time_s=each.time_s[part], values=each.values[part]))
    return Lines(one.title, one.unit, inside)


def _seen(one: Line) -> bool | str:
    """Dotted lines are told in the legend, where a click shows them."""
    return "legendonly" if one.dash == "dot" else True


def _said(window_s: Window | None) -> str:
    return "" if window_s is None else f", {window_s[0]:.4g} … {window_s[1]:.4g} s"


def drawn(one: Lines, window_s: Window | None = None) -> go.Figure:
    """The lines of a chart in a window; dotted ones wait in the legend for a click."""
    chart = theme.new(one.title, one.time, f"[{one.unit}]")
    for each in of_window(one, window_s).lines:
        x, y = line(each.time_s, each.values, theme.POINTS)
        look = {"width": 1.4, "color": each.colour, "dash": each.dash}
        more = {"hovertemplate": "%{y:.4g}", "visible": _seen(each)}
        chart.add_trace(go.Scatter(x=x, y=y, mode="lines", name=plain(each.name), line=look, **more))
    return chart


def spectrum(one: Lines, window_s: Window | None) -> go.Figure:
    """Amplitude against frequency of each line in a window, s; None: of all.  InputError: it is too short."""
    chart = theme.new(f"Spectrum: {one.title}{_said(window_s)}", "Frequency [Hz]", f"Amplitude [{one.unit}]")
    found = [(each, *signals.spectrum(each.time_s, each.values)) for each in of_window(one, window_s).lines]
    most = max((float(np.max(amplitude)) for _, _, amplitude in found), default=0.0)
    if most <= 0.0:
        raise InputError("nothing changes in this window; choose another")
    for each, frequency, amplitude in found:
        peak = frequency[int(np.argmax(amplitude))]
        x, y = line(frequency, np.maximum(amplitude, _FLOOR * most), theme.POINTS)
        name, look = f"{each.name}, largest at {peak:.4g} Hz", {"width": 1.3, "color": each.colour, "dash": each.dash}
        hover = {"hovertemplate": "%{x:.4g} Hz: %{y:.3g} " + plain(one.unit), "visible": _seen(each)}
        chart.add_trace(go.Scatter(x=x, y=y, mode="lines", name=plain(name), line=look, **hover))
    chart.update_xaxes(type="log")
    chart.update_yaxes(type="log", exponentformat="power", nticks=7)
    return chart


def difference(one: Lines, window_s: Window | None) -> go.Figure:
    """One line less another in a chart of its own.  InputError: this chart has no such pair."""
    if one.difference is None:
        raise InputError("this chart has no two lines whose difference means something")
    more, less = (one.lines[place] for place in one.difference)
    part = within(more.time_s, window_s)
    time_s = more.time_s[part]
    left = more.values[part] - np.interp(time_s, less.time_s, less.values, left=np.nan, right=np.nan)
    x, y = line(time_s, left, theme.POINTS)
    title = f"{one.title}: {more.name} − {less.name}"
    chart = theme.new(title, one.time, f"Δ [{one.unit}]")
    rms = float(np.sqrt(np.nanmean(left**2))) if np.any(np.isfinite(left)) else np.nan
    name, look = f"rms {rms:.4g} {one.unit}", {"width": 1.3, "color": DIFFERENCE}
    chart.add_trace(go.Scatter(x=x, y=y, mode="lines", name=plain(name), line=look, showlegend=True))
    chart.update_yaxes(exponentformat="power")
    if window_s is not None:
        chart.update_xaxes(range=list(window_s))
    return chart
