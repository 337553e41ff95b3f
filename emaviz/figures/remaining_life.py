"""The remaining life as a distribution: the probability that the threshold is crossed within so many flights."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go

from ema_model.tracking.remaining import Remaining
from emaviz.colours import MONITOR, REFERENCE
from emaviz.figures import theme

_POINTS = 400
_ROOM = 0.15  # of the axis, that a label left of its point needs
_TITLE = "Probability that the threshold is reached"


def figure(left: Remaining, *, came: int | None = None, dark: bool = False) -> go.Figure:
    """Its cumulative distribution, with 5, 50 and 95 %; came: after how many flights it was crossed, where known."""
    chart = theme.new(_TITLE, "Flights from now", "Probability [-]", dark=dark)
    x = np.linspace(0.0, max(1.0, 1.6 * left.p95, 1.1 * (came or 0.0)), _POINTS)
    y = [left.within(one) for one in x]
    chart.add_trace(go.Scatter(x=x, y=y, mode="lines", line={"color": MONITOR, "width": 2}, showlegend=False))
    for share, at in ((0.05, left.p05), (0.5, left.p50), (0.95, left.p95)):
        mark = {"size": 8, "color": theme.MARK}
        label = [f"{100.0 * share:.0f} %: {at:.0f}"]
        beside = "top left" if at > _ROOM * x[-1] else "top right"  # of the curve, and inside of the axes
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
