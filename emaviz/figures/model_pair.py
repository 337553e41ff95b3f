"""Both models' signal over time, and what lies between them on an axis of its own below."""

from __future__ import annotations

import plotly.graph_objects as go

from ema_model.quantities.axes import ROTARY, Axes
from ema_model.quantities.shown import of_signal
from ema_model.recordings import Measurement
from emaviz.figures import theme
from emaviz.figures.lines import line

_POINTS = 1500
_SPLIT = 0.42  # of the height, for the difference
_GAP = 0.06


def figure(
    title: str,
    reference: Measurement,
    monitor: Measurement,
    signal: str,
    *,
    axes: Axes = ROTARY,
    dark: bool = False,
) -> go.Figure:
    """Reference and Monitor Model on one time base; monitor − reference below, in the prefix that it needs."""
    whole = of_signal(signal, axes)
    shown = whole.scaled(reference[signal])
    difference = monitor[signal] - reference[signal]
    finer = whole.scaled(difference)
    chart = theme.new(title, "Time [s]", shown.short_label, dark=dark)
    for name, colour, factor, values, axis in (
        ("reference model", theme.MEASURED, shown.factor, reference[signal], "y"),
        ("monitor model", theme.MODEL, shown.factor, monitor[signal], "y"),
        ("monitor − reference", theme.RESIDUAL, finer.factor, difference, "y2"),
    ):
        x, y = line(reference.time_s, factor * values, _POINTS)
        drawn = {"color": colour, "width": 1.3}
        chart.add_trace(go.Scatter(x=x, y=y, yaxis=axis, mode="lines", name=name, line=drawn, hovertemplate="%{y:.4g}"))
    chart.update_layout(
        margin={"l": 62},
        yaxis={"domain": [_SPLIT + _GAP, 1.0]},
        yaxis2={"domain": [0.0, _SPLIT - _GAP], "title": {"text": f"difference [{finer.unit}]"}, "anchor": "x"},
        xaxis={"anchor": "y2"},
    )
    return chart
