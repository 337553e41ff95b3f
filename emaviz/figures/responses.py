"""One signal of several runs of the reference model over time, from light to dark in their order."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import plotly.graph_objects as go

from ema_model.quantities.axes import ROTARY, Axes
from ema_model.quantities.shown import of_signal
from ema_model.recordings import Measurement
from emaviz.colours import REFERENCE_SHADES
from emaviz.figures import theme
from emaviz.figures.lines import line

_POINTS = 700


def figure(
    title: str,
    runs: Mapping[str, Measurement],
    signal: str,
    *,
    window_s: tuple[float, float] | None = None,
    with_command: bool = False,
    axes: Axes = ROTARY,
    dark: bool = False,
) -> go.Figure:
    """runs: by what the legend calls them; window_s: the time to show, from and to."""
    largest = np.concatenate([_inside(one, signal, window_s)[1] for one in runs.values()])
    shown = of_signal(signal, axes).scaled(largest)
    chart = theme.new(title, "Time [s]", shown.short_label, dark=dark)
    if with_command:
        first = next(iter(runs.values()))
        x, y = line(*_inside(first, "command_rad", window_s), _POINTS)
        drawn = {"color": theme.INITIAL, "width": 1, "dash": "dot"}
        chart.add_trace(go.Scatter(x=x, y=shown.factor * y, mode="lines", name="command", line=drawn))
    for i, (name, one) in enumerate(runs.items()):
        time, values = _inside(one, signal, window_s)
        x, y = line(time, shown.factor * values, _POINTS)
        drawn = {"color": REFERENCE_SHADES[i % len(REFERENCE_SHADES)], "width": 1.2}
        chart.add_trace(
            go.Scatter(x=x, y=y, mode="lines", name=theme.plain(name), line=drawn, hovertemplate="%{y:.4g}")
        )
    return chart


def _inside(one: Measurement, signal: str, window_s: tuple[float, float] | None) -> tuple[np.ndarray, np.ndarray]:
    time, values = one.time_s, one[signal]
    if window_s is None:
        return time, values
    at = (time >= window_s[0]) & (time <= window_s[1])
    return time[at], values[at]
