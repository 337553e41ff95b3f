"""The remaining life as a distribution: the probability that the threshold is crossed within so many flights."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go

from ema_model.tracking.remaining import Remaining
from emaviz.colours import MONITOR
from emaviz.figures import theme

_POINTS = 400


def figure(left: Remaining, *, dark: bool = False) -> go.Figure:
    """Its cumulative distribution, with 5, 50 and 95 %."""
    chart = theme.new("Probability of crossing within the next flights", "Flights from now", "probability", dark=dark)
    x = np.linspace(0.0, max(1.0, 1.6 * left.p95), _POINTS)
    y = [left.within(one) for one in x]
    chart.add_trace(go.Scatter(x=x, y=y, mode="lines", line={"color": MONITOR, "width": 2}, showlegend=False))
    for share, at in ((0.05, left.p05), (0.5, left.p50), (0.95, left.p95)):
        mark = {"size": 8, "color": theme.MARK}
        label = [f"{share:.0%}: {at:.0f}"]
        chart.add_trace(
            go.Scatter(x=[at], y=[share], mode="markers+text", text=label, textposition="bottom right", marker=mark,
                       showlegend=False)
        )  # fmt: skip
    return chart
