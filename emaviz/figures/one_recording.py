"""One recording at a glance: its current as measured and as modelled, and what the model leaves of it."""

from __future__ import annotations

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from ema_model.recordings import SIGNALS
from emaviz.colours import DIFFERENCE, MONITOR, REFERENCE
from emaviz.figures import cut
from emaviz.figures.lines import line
from emaviz.figures.theme import DARK, LIGHT
from emaviz.recording.read import Recording

_POINTS = 2500
_FIRST = "current_A"
_GROUPS = (
    ("measurement", "measured", REFERENCE, 2.4),
    ("reference", "reference model", REFERENCE, 2.4),
    ("monitor", "model", MONITOR, 1.3),
)


def figure(recording: Recording, *, dark: bool = False) -> go.Figure | None:
    """Two rows on one time base; None for a recording without signals."""
    groups = {name: recording.signals.get(name, {}) for name, *_ in _GROUPS}
    known = [signal for one in groups.values() for signal in one if signal in SIGNALS]
    if not known:
        return None
    signal = _FIRST if _FIRST in known else known[0]
    left = recording.signals.get("residual", {}).get(signal)
    rows = 1 if left is None else 2
    drawn = make_subplots(rows=rows, cols=1, shared_xaxes=True, vertical_spacing=0.08)
    for name, said, colour, width in _GROUPS:
        series = groups[name].get(signal)
        if series is not None:
            x, y = line(series.time_s, series.values, _POINTS)
            look = {"color": colour, "width": width}
            drawn.add_trace(go.Scatter(x=x, y=y, name=said, mode="lines", line=look), row=1, col=1)
    title, unit = SIGNALS[signal].title, SIGNALS[signal].unit or "-"
    drawn.update_yaxes(title_text=f"{title}<br>[{unit}]", row=1, col=1)
    if left is not None:
        x, y = line(left.time_s, left.values, _POINTS)
        look = {"color": DIFFERENCE, "width": 1.3}
        drawn.add_trace(go.Scatter(x=x, y=y, name="residual", mode="lines", line=look), row=2, col=1)
        drawn.update_yaxes(title_text=f"Residual<br>[{unit}]", row=2, col=1)
        cut.cut(drawn, left.values, unit, row=2, col=1)
    drawn.update_xaxes(title_text="Time [s]", row=rows, col=1)
    drawn.update_layout(
        template=(DARK if dark else LIGHT).template(),
        margin={"l": 66, "r": 12, "t": 34, "b": 40},
        legend={"orientation": "h", "x": 0.0, "y": 1.02, "yanchor": "bottom"},
    )
    return drawn
