"""How many searches converge: the median of their best errors, and the band that nine of ten keep to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import plotly.graph_objects as go

from emaviz.colours import ALGORITHMS
from emaviz.figures import theme
from emaviz.figures.error_distribution import colour

_LEAST = 1e-9  # a logarithmic axis has no zero
_DECADE = 10.0
_TICKS = [mantissa * 10.0**power for power in range(-9, 4) for mantissa in (1.0, 3.0)]


def figure(
    histories: Mapping[str, Sequence[Sequence[float]]],
    *,
    title: str = "Best error of each iteration",
    y: str = "RMSE [A]",
    names: Mapping[str, str] | None = None,
    dark: bool = False,
) -> go.Figure:
    """histories: y, by algorithm or case, of each search by iteration; one that ended keeps its level.

    names: what the legend calls them, where it is not as they are.
    """
    chart = theme.new(f"{title}: median, and 5 to 95 %", "Iteration", y, dark=dark)
    drawn: list[float] = []
    for i, (name, given) in enumerate(histories.items()):
        length = max(map(len, given))
        whole = np.array([[*one, *[one[-1]] * (length - len(one))] for one in given], dtype=float)
        low, middle, high = np.percentile(np.maximum(whole, _LEAST), [5, 50, 95], axis=0)
        drawn += [float(np.min(low)), float(np.max(high))]
        own = ALGORITHMS.get(name, colour(i))
        steps = np.arange(length)
        band = {"line": {"width": 0}, "hoverinfo": "skip", "showlegend": False, "mode": "lines"}
        chart.add_trace(go.Scatter(x=steps, y=high, **band))
        chart.add_trace(go.Scatter(x=steps, y=low, fill="tonexty", fillcolor=_faint(own), **band))
        line = {"color": own, "width": 2}
        chart.add_trace(
            go.Scatter(x=steps, y=middle, mode="lines", name=theme.plain((names or {}).get(name, name)), line=line)
        )
    chart.update_layout(showlegend=len(histories) > 1, legend={"traceorder": "normal"})
    chart.update_yaxes(type="log")
    if drawn and max(drawn) > _DECADE * min(drawn):  # else its own ticks would leave out the powers of ten
        chart.update_yaxes(tickvals=_TICKS, ticktext=[f"{one:g}" for one in _TICKS])
    return chart


def _faint(colour: str) -> str:
    red, green, blue = (int(colour[at : at + 2], 16) for at in (1, 3, 5))
    return f"rgba({red},{green},{blue},0.18)"
