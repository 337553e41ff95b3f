"""The memory of each worker over a campaign."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import plotly.graph_objects as go

from emaviz.figures import theme
from emaviz.figures.error_distribution import colour


def figure(memory: Mapping[str, tuple[Sequence[float], Sequence[float]]], *, dark: bool = False) -> go.Figure:
    """memory: by worker, minutes since the first row, and MB."""
    chart = theme.new("Memory of the workers", "Time [min]", "Resident [MB]", dark=dark)
    for i, (name, (minutes, megabytes)) in enumerate(memory.items()):
        line = {"color": colour(i), "width": 1.5}
        chart.add_trace(go.Scatter(x=minutes, y=megabytes, mode="lines", name=theme.plain(name), line=line))
    chart.update_yaxes(rangemode="tozero")
    return chart
