"""The flights of a unit: what drifts, the way to each threshold, k over the flights."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import ArrayLike

from ema_model.estimation.problem import to_k
from ema_model.faults import BY_NAME, NAMES
from ema_model.quantities import HALF_90
from ema_model.tracking.flights import Flight
from ema_model.tracking.track import TRACKED, FaultTrack, History, Tracked, headline
from ema_model.tracking.trends import LEAST_FLIGHTS, Remaining
from emaviz.colours import CASES, COMMAND, MONITOR, REFERENCE
from emaviz.figures import theme
from emaviz.text.verdicts import Meaning
from emaviz.views import ANSWER, Figures, Section, View

# --- one k over the flights of a unit, with its band, its jumps, and the fan to its threshold -------------------------

CLICKED = "flights"  # by which a page knows the chart, of which a point's text is its flight
_K_OVER_FLIGHTS_BAND = "rgba(240,140,0,0.18)"
_FAN = "rgba(240,140,0,0.30)"
_BESIDE_AXIS_PX = 24  # to the right of the line at no flight


def k_over_flights(
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
        band = {"x": [*x, *x[::-1]], "y": [*low, *high[::-1]], "fill": "toself", "fillcolor": _K_OVER_FLIGHTS_BAND}
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
    if one.remaining_flights is not None and one.threshold is not None:
        left, end = one.remaining_flights, one.threshold
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


def k_so_far(flights: Sequence[Flight], count: int, *, dark: bool = False) -> go.Figure:
    """Each k of the first flights, too few for a trend, as identified; count: flights in all."""
    chart = theme.new("k of each flight so far", "Flight", "k [-]", dark=dark)
    at = [i for i, one in enumerate(flights, 1) if not one.excluded]
    k = to_k(np.array([one.k for one in flights if not one.excluded]).reshape(-1, len(NAMES)))
    for i, name in enumerate(TRACKED):
        line = {"color": CASES[i % len(CASES)], "width": 1.5, "dash": "dot" if i >= len(CASES) else "solid"}
        y, style = k[:, NAMES.index(name)], {"mode": "lines+markers", "marker": {"size": 5}, "line": line}
        chart.add_trace(go.Scatter(x=at, y=y, name=BY_NAME[name].label, **style))
    chart.update_xaxes(range=[0.5, max(count, LEAST_FLIGHTS) + 0.5])
    chart.update_yaxes(range=[-0.05, 1.05])
    return chart


def _since(result: Tracked, one: FaultTrack) -> int:
    """The first flight that today's trend can be drawn through: no longer ago than k moves by what it has grown."""
    start = max((i for i, f in enumerate(result.flights, 1) for jump in one.jumps if f.name == jump.flight), default=1)
    grown = abs(one.level - BY_NAME[one.name].healthy)
    return max(start, len(result.flights) - int(grown / max(abs(one.drift), 1e-9)))


# --- what was said of the remaining life after each flight, beside what came ------------------------------------------

_PREDICTED_LIFE_BAND = "rgba(240,140,0,0.22)"
_PREDICTED_LIFE_ROOM = 1.1  # of the axis, above what is drawn
_USUAL, _FAR = 1.5, 2.0  # times the middle upper end, to which all are drawn; times that, to which the largest is


def predicted_life(history: History, name: str, number: int, *, dark: bool = False) -> go.Figure:
    """Of one k, by flight; number: of the flight of today, which is marked."""
    title = f"Predicted flights left, {BY_NAME[name].label}"
    left = {n: look.faults[name].remaining_flights for n, look in history.looks.items()}
    runs = _runs([(n, one) for n, one in left.items() if one is not None])
    if not runs:
        return theme.missing(title, "no remaining life was said after any flight", dark=dark)
    chart = theme.new(title, "Flight", "Flights left", dark=dark)
    cut, top = _drawn(runs, history.crossed(name))
    for place, run in enumerate(runs):
        at = [n for n, _ in run]
        first = {"showlegend": place == 0}
        band = {"x": [*at, *at[::-1]], "y": [min(one.p05, top) for _, one in run]}
        band["y"] += [min(one.p95, top) for _, one in run[::-1]]
        chart.add_trace(
            go.Scatter(**band, fill="toself", fillcolor=_PREDICTED_LIFE_BAND, line={"width": 0}, mode="lines",
                       hoverinfo="skip", name="90 % interval", **first)
        )  # fmt: skip
        middle = [one.p50 if one.p50 <= top else None for _, one in run]
        line = {"color": MONITOR, "width": 2}
        chart.add_trace(go.Scatter(x=at, y=middle, mode="lines", line=line, name="median", **first))
    crossed = history.crossed(name)
    if crossed is not None:
        start = min(min(n for n, _ in run) for run in runs)
        x, line = [min(start, crossed), crossed], {"color": REFERENCE, "width": 2, "dash": "dash"}
        chart.add_trace(go.Scatter(x=x, y=[crossed - x[0], 0], mode="lines", line=line, name="what came"))
    theme.moment(chart, number)
    chart.update_yaxes(range=[0.0, _PREDICTED_LIFE_ROOM * top])
    if cut:
        told = f"Upper ends above {top:.0f} flights are cut"
        chart.add_annotation(
            text=told, x=1.0, xref="x domain", xanchor="right", y=top, yanchor="bottom", showarrow=False,
            font={"size": 10},
        )  # fmt: skip
    return chart


def _drawn(runs: list[list], crossed: int | None) -> tuple[bool, float]:
    """Whether more flights were said than are drawn, and how many are: the first ones say little."""
    tops = sorted(one.p95 for run in runs for _, one in run if one.p95 > 0.0) or [0.0]
    came = 0 if crossed is None else crossed - runs[0][0][0]
    usual = max(_USUAL * tops[len(tops) // 2], float(came), 1.0)
    cut = tops[-1] > _FAR * usual
    return cut, usual if cut else max(usual, tops[-1])


def _runs(said: list) -> list[list]:
    """Cut where nothing was said of a flight in between."""
    runs: list[list] = []
    for n, one in said:
        if runs and runs[-1][-1][0] == n - 1:
            runs[-1].append((n, one))
        else:
            runs.append([(n, one)])
    return runs


# --- the remaining life as a distribution -----------------------------------------------------------------------------
# The remaining life as a distribution: the probability that the threshold is crossed within so many flights.

_POINTS = 400
_REMAINING_LIFE_ROOM = 0.15  # of the axis, that a label left of its point needs
_TITLE = "Probability that the threshold is reached"


def remaining_life(left: Remaining, *, came: int | None = None, dark: bool = False) -> go.Figure:
    """Its cumulative distribution, with 5, 50 and 95 %; came: after how many flights it was crossed, where known."""
    chart = theme.new(_TITLE, "Flights from now", "Probability [-]", dark=dark)
    x = np.linspace(0.0, max(1.0, 1.6 * left.p95, 1.1 * (came or 0.0)), _POINTS)
    y = [left.within(one) for one in x]
    chart.add_trace(go.Scatter(x=x, y=y, mode="lines", line={"color": MONITOR, "width": 2}, showlegend=False))
    for share, at in ((0.05, left.p05), (0.5, left.p50), (0.95, left.p95)):
        mark = {"size": 8, "color": theme.MARK}
        label = [f"{100.0 * share:.0f} %: {at:.0f}"]
        # Of the curve, and inside of the axes.
        beside = "top left" if at > _REMAINING_LIFE_ROOM * x[-1] else "top right"
        side = beside if share < 0.1 else "bottom right"
        chart.add_trace(
            go.Scatter(x=[at], y=[share], mode="markers+text", text=label, textposition=side, marker=mark,
                       showlegend=False)
        )  # fmt: skip
    if came is not None:
        line = {"color": REFERENCE, "width": 2, "dash": "dash"}
        told = {"text": ["", f"came: {came}"], "textposition": "bottom left", "showlegend": False}
        chart.add_trace(go.Scatter(x=[came, came], y=[0.0, 1.0], mode="lines+text", line=line, **told))
    return chart


def none(why: str, *, dark: bool = False) -> go.Figure:
    """Where nothing is said of the remaining life."""
    return theme.missing(_TITLE, why, dark=dark)


# --- the view ---------------------------------------------------------------------------------------------------------


def _remaining(result: Tracked) -> Sequence[Sequence[go.Figure]]:
    """Of each k with a remaining life: the way to the threshold, and the distribution."""
    return [
        [k_over_flights(result, name), remaining_life(one.remaining_flights)]
        for name, one in result.faults.items()
        if one.remaining_flights is not None
    ]


def _others(result: Tracked) -> Sequence[Sequence[go.Figure]]:
    """Those without a remaining life, which stands above with its k."""
    return [[k_over_flights(result, name)] for name, one in result.faults.items() if one.remaining_flights is None]


def _lead(result: Tracked) -> str:
    return ", ".join(filter(None, (result.actuator, f"{len(result.flights)} flights")))


def _meaning(result: Tracked) -> Meaning:
    return "warning" if not result.trusted or any(one.trend for one in result.faults.values()) else "good"


def _columns(result: Tracked) -> Mapping[str, ArrayLike]:
    """k of each flight that counts, with 1 σ of its own noise."""
    found: dict[str, ArrayLike] = {"flight": np.array([one.name for one in result.usable])}
    for name, one in result.faults.items():
        found |= {name: one.k, f"{name}_sigma": one.sigma}
    return found


def _record(result: Tracked, path: Path, configuration: Mapping[str, Any]) -> None:
    """On the timeline of the flights."""
    from emaviz.recording.identification import write_tracking  # rerun takes a second to import

    write_tracking(result, path, configuration)


VIEW = View(
    of=Tracked,
    name="track",
    title=headline,
    lead=_lead,
    sections=(
        ANSWER,
        Section("Remaining life", "remaining", (Figures(_remaining),)),
        Section("k over the flights", "flights", (Figures(_others, 220),)),
    ),
    meaning=_meaning,
    columns=_columns,
    record=_record,
)
