"""The error of each unit's own model on each unit's recordings, in floors."""

from __future__ import annotations

import plotly.graph_objects as go

from ema_model.quantities.numbers import number
from ema_model.units.result import UnitsCompared
from emaviz.figures import theme


def figure(result: UnitsCompared, *, dark: bool = False) -> go.Figure:
    """A row for each model, a column for each unit's recordings."""
    chart = theme.new("Error, × floor", "Recordings of", "Model of", dark=dark)
    names = [theme.plain(name) for name in result.units]
    floors = result.transfer.floors
    text = [[number(value, 2) for value in row] for row in floors] if len(names) <= 12 else None
    chart.add_trace(
        go.Heatmap(
            z=floors, x=names, y=names, text=text, texttemplate="%{text}" if text else None, colorscale="Viridis"
        )
    )
    chart.update_yaxes(autorange="reversed")
    return chart
