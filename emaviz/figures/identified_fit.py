"""The current that was identified: measured, and the Monitor Model's at the answer, for each run."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import plotly.graph_objects as go
from numpy.typing import ArrayLike

from ema_model.identification.objective import Objective
from emaviz.figures import cut, theme
from emaviz.figures.lines import line


def figures(objective: Objective, k: ArrayLike, *, dark: bool = False) -> Iterator[go.Figure]:
    """Two figures a run of the recordings: the currents, and what is left of them; k (8,)."""
    model = objective.currents(k)[0]
    edges = np.cumsum([0, *(window.blocks for window in objective.windows)])
    for window, first, last in zip(objective.windows, edges, edges[1:]):
        measured, fitted = objective.target[first:last], model[first:last]
        name = theme.plain(window.name or "a simulated run")
        chart = theme.new(f"Equivalent current, {name}", "Time [s]", "I_eq [A]", dark=dark)
        _add(chart, window.time_s, measured, "measured", theme.MEASURED)
        _add(chart, window.time_s, fitted, "identified", theme.MODEL)
        yield chart
        chart = theme.new(f"Measured − identified, {name}", "Time [s]", "ΔI_eq [A]", dark=dark)
        _add(chart, window.time_s, measured - fitted, "residual", theme.RESIDUAL)
        cut.cut(chart, measured - fitted, "A")
        yield chart


def _add(chart: go.Figure, time, values, name: str, colour: str) -> None:
    x, y = line(time, values, theme.POINTS)
    chart.add_trace(go.Scatter(x=x, y=y, mode="lines", name=name, line={"color": colour, "width": 1.5}))
