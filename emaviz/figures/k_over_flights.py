"""One k over the flights of a unit, with its band, its jumps, and the fan to its threshold."""

from __future__ import annotations

from collections.abc import Mapping

import plotly.graph_objects as go

from ema_model.faults import BY_NAME
from ema_model.quantities.interval import HALF_90
from ema_model.tracking.result import FaultTrack, Tracked
from emaviz.colours import COMMAND, MONITOR, REFERENCE
from emaviz.figures import theme

CLICKED = "flights"  # by which a page knows the chart, of which a point's text is its flight
_BAND = "rgba(240,140,0,0.18)"
_FAN = "rgba(240,140,0,0.30)"
_BESIDE_AXIS_PX = 24  # to the right of the line at no flight


def figure(
    result: Tracked,
    name: str,
    *,
    last: Tracked | None = None,
    levels: Mapping[int, tuple[float, float, float]] | None = None,
    dark: bool = False,
) -> go.Figure:
    """k by flight, as identified but for what the unit's base parameters add; a flight that was left out is a gap.

    last: what is known after all flights, of which those since `result` are drawn pale; levels: by flight, the level as
    it was known then, and the ends of its 90 % interval.
    """
    one = result.faults[name]
    chart = theme.new(BY_NAME[name].label, "Flight", f"{name} [-]", dark=dark)
    chart.update_layout(meta=CLICKED)
    at = [i for i, flight in enumerate(result.flights, 1) if not flight.excluded]
    if levels:
        x, (middle, low, high) = [*levels], zip(*levels.values())
        edge = {"line": {"width": 0}, "mode": "lines", "hoverinfo": "skip"}
        band = {"x": [*x, *x[::-1]], "y": [*low, *high[::-1]], "fill": "toself", "fillcolor": _BAND}
        chart.add_trace(go.Scatter(**band, **edge, name="level, 90 %"))
        line = {"color": MONITOR, "width": 1}
        chart.add_trace(go.Scatter(x=x, y=middle, mode="lines", line=line, name="level then", showlegend=False))
    names = [theme.plain(flight.name) for flight in result.usable]
    error = {"type": "data", "array": HALF_90 * one.sigma, "thickness": 0.7, "width": 0}
    dots = {"size": 4, "color": REFERENCE}
    said = "%{text}: %{y:.4f} ± %{error_y.array:.2g}<extra></extra>"
    identified = {"x": at, "y": one.k, "error_y": error, "text": names, "hovertemplate": said}
    chart.add_trace(go.Scatter(**identified, mode="markers", marker=dots, name="identified"))
    now = len(result.flights)
    if last is not None and len(last.flights) > now:
        since = [(i, flight.name) for i, flight in enumerate(last.flights, 1) if not flight.excluded]
        later = [(i, theme.plain(called), k) for (i, called), k in zip(since, last.faults[name].k) if i > now]
        x, called, k = zip(*later) if later else ((), (), ())
        pale = {"size": 4, "color": COMMAND, "opacity": 0.5}
        chart.add_trace(go.Scatter(x=x, y=k, mode="markers", marker=pale, text=called, name="later flights",
                                   hovertemplate="%{text}: %{y:.4f}<extra></extra>"))  # fmt: skip
        theme.moment(chart, now + 0.5)
    if one.trend:
        start = _since(result, one)
        line = {"color": MONITOR, "width": 2}
        back = one.level - one.drift * (now - start)
        chart.add_trace(go.Scatter(x=[start, now], y=[back, one.level], mode="lines", line=line, name="trend"))
    for jump in one.jumps:
        number = next(i for i, flight in enumerate(result.flights, 1) if flight.name == jump.flight)
        chart.add_vline(x=number - 0.5, line={"width": 1, "dash": "dot", "color": theme.EDGE})
    if one.threshold is not None:
        chart.add_hline(
            y=one.threshold,
            line={"width": 1, "dash": "dash", "color": theme.MARK},
            annotation={"text": "threshold", "font": {"color": theme.MARK}, "xshift": _BESIDE_AXIS_PX},
            annotation_position="bottom left",
        )
    if one.remaining is not None and one.threshold is not None:
        left, end = one.remaining, one.threshold
        hidden = {"line": {"width": 0}, "hoverinfo": "skip", "mode": "lines", "showlegend": False}
        fan = go.Scatter(
            x=[now, now + left.p05, now + left.p95, now],
            y=[one.level, end, end, one.level],
            fill="toself",
            fillcolor=_FAN,
            **hidden,
        )
        chart.add_trace(fan)
        middle = {"color": MONITOR, "width": 1.5, "dash": "dash"}
        x, y = [now, now + left.p50], [one.level, end]
        chart.add_trace(go.Scatter(x=x, y=y, mode="lines", line=middle, name="forecast"))
    return chart


def _since(result: Tracked, one: FaultTrack) -> int:
    """The first flight that today's trend can be drawn through: no longer ago than k moves by what it has grown."""
    start = max((i for i, f in enumerate(result.flights, 1) for jump in one.jumps if f.name == jump.flight), default=1)
    grown = abs(one.level - BY_NAME[one.name].healthy)
    return max(start, len(result.flights) - int(grown / max(abs(one.drift), 1e-9)))
