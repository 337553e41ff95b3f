"""The preview of a mapping: each signal as it would be read, in SI units, one small chart above another."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from ema_model.errors import InputError
from ema_model.recordings import SIGNALS, ColumnMapping, apply_mapping
from emaviz.colours import COMMAND, REFERENCE
from emaviz.figures.decimate import envelope

_POINTS = 1200
_ROW_PX = 92
_WIDTH_PX = 520


def figure(columns: dict[str, np.ndarray], mapping: ColumnMapping) -> tuple[go.Figure, float]:
    """The figure and its height over its width; `columns` as they stand in the file, (n,) each.

    Values that are no numbers leave gaps.  InputError if the mapping does not fit the columns.
    """
    signals, _ = apply_mapping(columns, mapping)
    time = signals.pop("time_s", None)
    if not signals:
        raise InputError("no column is used yet; say which column is which signal")
    rows = len(signals)
    chart = make_subplots(rows=rows, cols=1, shared_xaxes=True, vertical_spacing=0.26 / max(rows, 2))
    titles = []
    for row, (name, values) in enumerate(signals.items(), start=1):
        x = np.arange(float(len(values))) if time is None else time
        at, drawn = envelope(x, [values], _POINTS)
        colour = COMMAND if name.startswith("command") else REFERENCE
        chart.add_trace(go.Scatter(x=at, y=drawn, mode="lines", line={"width": 1, "color": colour}), row=row, col=1)
        signal = SIGNALS[name]
        unit = f" [{signal.unit}]" if signal.unit else ""
        titles.append(
            {
                "text": f"<b>{signal.title}</b>{unit}",
                "xref": "paper",
                "yref": f"y{row if row > 1 else ''} domain",
                "x": 0.0,
                "y": 1.0,
                "yanchor": "bottom",
                "xanchor": "left",
                "showarrow": False,
                "font": {"size": 12},
            }
        )
    chart.update_yaxes(nticks=4, gridcolor="#86868640", zeroline=False, tickfont={"size": 10})
    chart.update_xaxes(gridcolor="#86868640", zeroline=False, tickfont={"size": 10})
    chart.update_xaxes(title={"text": "Time [s]" if time is not None else "Sample", "font": {"size": 11}}, row=rows)
    chart.update_layout(
        annotations=titles,
        showlegend=False,
        margin={"l": 52, "r": 12, "t": 24, "b": 36},
        paper_bgcolor="rgba(0,0,0,0)",
        plot_bgcolor="rgba(0,0,0,0)",
    )
    return chart, (rows * _ROW_PX + 60) / _WIDTH_PX
