"""The band in which a perfect model would lie, drawn below a residual and its edges above it."""

from __future__ import annotations

import plotly.graph_objects as go
from numpy.typing import NDArray

from emaviz.figures import theme
from emaviz.figures.lines import band, line

_LEGEND = {"name": theme.FLOOR_NAME, "legendgroup": "floor", "hoverinfo": "skip", "mode": "lines"}


def outlined(chart: go.Figure, x: NDArray, y: NDArray) -> None:
    """Fills a closed outline, in the units of the axes."""
    chart.add_trace(go.Scatter(x=x, y=y, fill="toself", fillcolor=theme.FLOOR, line={"width": 0}, **_LEGEND))


def below(chart: go.Figure, time: NDArray, half: NDArray) -> None:
    """± half about zero over time; all are (samples,)."""
    outlined(chart, *band(time, -half, half, theme.POINTS))


def above(chart: go.Figure, time: NDArray, half: NDArray) -> None:
    """The edges once more, because dense noise hides the band below it."""
    for edge in (-half, half):
        x, y = line(time, edge, theme.POINTS // 2)
        drawn = {"width": 1.4, "color": theme.EDGE}
        chart.add_trace(go.Scatter(x=x, y=y, line=drawn, showlegend=False, **_LEGEND))
