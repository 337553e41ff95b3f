"""What was said of the remaining life after each flight, beside what came."""

from __future__ import annotations

import plotly.graph_objects as go

from ema_model.faults import BY_NAME
from ema_model.tracking.history import History
from emaviz.colours import MONITOR, REFERENCE
from emaviz.figures import theme

_BAND = "rgba(240,140,0,0.22)"
_ROOM = 1.1  # of the axis, above what is drawn
_USUAL, _FAR = 1.5, 2.0  # times the middle upper end, to which all are drawn; times that, to which the largest is


def figure(history: History, name: str, number: int, *, dark: bool = False) -> go.Figure:
    """Of one k, by flight; number: of the flight of today, which is marked."""
    title = f"Predicted flights left, {BY_NAME[name].label}"
    left = {n: look.faults[name].remaining for n, look in history.looks.items()}
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
            go.Scatter(**band, fill="toself", fillcolor=_BAND, line={"width": 0}, mode="lines", hoverinfo="skip",
                       name="90 % interval", **first)
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
    chart.update_yaxes(range=[0.0, _ROOM * top])
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
