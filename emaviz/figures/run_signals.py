"""A run as one figure for documents: four signals of both models, below one another."""

from __future__ import annotations

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from ema_model.quantities.axes import ROTARY, Axes
from ema_model.recordings import Measurement
from emaviz.colours import COMMAND, GHOST, MONITOR, REFERENCE
from emaviz.figures.lines import line
from emaviz.figures.signal_charts import charts
from emaviz.figures.signals import at
from emaviz.figures.theme import DARK, LIGHT

_POINTS = 2500


def figure(
    reference: Measurement,
    monitor: Measurement,
    ghost: Measurement | None = None,
    window_s: tuple[float, float] | None = None,
    *,
    axes: Axes = ROTARY,
    dark: bool = False,
) -> go.Figure:
    """Reference, monitor and a frozen run over time, from and to the window's times."""
    every = charts(axes)
    drawn = make_subplots(rows=len(every), cols=1, shared_xaxes=True, vertical_spacing=0.045)
    theme = DARK if dark else LIGHT
    time = reference.time_s
    for row, chart in enumerate(every, 1):
        lines = [
            ("reference model (the plant)", REFERENCE, "solid", reference[chart.signal]),
            ("monitor model", MONITOR, "solid", monitor[chart.signal]),
        ]
        if chart.with_command:
            lines.append(("command", COMMAND, "dot", reference["command_rad"]))
        if ghost is not None:
            lines.append(("frozen run", GHOST, "dash", at(ghost, chart.signal, time)))
        for name, colour, dash, values in lines:
            x, y = line(time, chart.scale * values, _POINTS)
            first = row == (2 if name == "command" else 1)
            drawn.add_trace(
                go.Scatter(x=x, y=y, name=name, mode="lines", line={"color": colour, "width": 1.5, "dash": dash},
                           legendgroup=name, showlegend=first),
                row=row, col=1,
            )  # fmt: skip
        drawn.update_yaxes(title_text=f"{chart.title}<br>[{chart.unit}]", row=row, col=1)
    drawn.update_xaxes(title_text="Time [s]", row=len(every), col=1)
    if window_s is not None:
        drawn.update_xaxes(range=list(window_s))
    drawn.update_layout(
        template=theme.template(),
        paper_bgcolor=theme.paper,
        plot_bgcolor=theme.paper,
        margin={"l": 60, "r": 16, "t": 34, "b": 44},
        legend={"orientation": "h", "x": 0.0, "y": 1.02, "yanchor": "bottom"},
    )
    return drawn
