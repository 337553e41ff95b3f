"""The error of each unit's own model on each unit's recordings, in floors and in the signal's unit."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go

from ema_model.quantities.numbers import amount, number
from ema_model.quantities.shown import of_signal
from ema_model.quantities.titles import in_sentence
from ema_model.units.result import UnitsCompared
from emaviz.figures import theme

_SHADES = [[0.0, "rgba(224,49,49,0.05)"], [1.0, "rgba(224,49,49,0.6)"]]  # text stays legible, on dark too
_FAR = 1.5  # times the own model's error, from which on a cell is dark
_IN_FULL, _IN_SHORT = 7, 12  # units, up to which a cell has both numbers, and up to which the floors alone


def figure(result: UnitsCompared, *, dark: bool = False) -> go.Figure:
    """A row for each model, a column for each unit's recordings; the darker, the worse than that unit's own model."""
    moved, axes = result.transfer, result.actuator.axes
    shown = of_signal(moved.signal, axes)
    full = len(result.units) <= _IN_FULL
    beside = f", and rms of the {in_sentence(shown.title)}" if full else ""
    chart = theme.new(f"Error, × floor{beside}", "Recordings of", "Model of", dark=dark)
    names = [theme.plain(name) for name in result.units]
    errors = [[amount(value, shown.unit) for value in row] for row in moved.error]
    worse = moved.floors / np.maximum(np.diag(moved.floors), 1e-300)
    text = None
    if len(names) <= _IN_SHORT:
        text = [
            [f"{number(value, 2)} ×" + (f"<br>{error}" if full else "") for value, error in zip(row, beside)]
            for row, beside in zip(moved.floors, errors)
        ]
    chart.add_trace(
        go.Heatmap(
            z=worse,
            zmin=1.0,
            zmax=max(_FAR, float(np.max(worse))),
            x=names,
            y=names,
            text=text,
            texttemplate="%{text}" if text else None,
            customdata=errors,
            hovertemplate="model of %{y} on %{x}: %{customdata}, %{z:.2f} × its own model's<extra></extra>",
            colorscale=_SHADES,
            textfont={"color": (theme.DARK if dark else theme.LIGHT).ink},
            xgap=1,
            ygap=1,
            colorbar={
                "thickness": 10,
                "nticks": 5,
                "exponentformat": "none",
                "separatethousands": True,
                "title": {"text": "× own model's error", "side": "right", "font": {"size": 11}},
            },
        )
    )
    chart.update_yaxes(autorange="reversed", nticks=0, showgrid=False, title={"standoff": 12})
    chart.update_xaxes(nticks=0, showgrid=False)
    return chart
