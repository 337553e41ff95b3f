"""What is left of a signal over time, about the band in which a perfect model would lie."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from ema_model.comparison.result import Comparison, Region
from emaviz.figures import quantity, theme
from emaviz.figures.lines import band, line
from emaviz.figures.region_blocks import time_ranges, within


def figure(
    comparison: Comparison,
    signal: str | None = None,
    recording: int = 0,
    *,
    highlight: Region | None = None,
    moment_s: float | None = None,
    window_s: tuple[float, float] | None = None,
    as_torque: bool = False,
    dark: bool = False,
) -> go.Figure:
    """signal: the primary one, unless given; as_torque: the current's residual in N·m where that is known.

    window_s: the time to show, from–to, drawn with all points that there is room for.
    """
    signal = signal or comparison.primary
    one = comparison.recordings[recording]
    shown = quantity.of_residual(comparison, signal, as_torque=as_torque)
    if signal not in one.measured:
        return theme.missing(shown.title, "not recorded here", dark=dark)
    inside = within(one.time_s, window_s)
    time, measured = one.time_s[inside], one.measured[signal][inside]
    left = measured - one.model[signal][inside]
    shown = shown.scaled(left)
    sigma = theme.FLOOR_WIDTH * shown.factor * one.sigma[signal][inside]
    axis = "Sample" if comparison.residuals.is_map else "Time [s]"
    chart = theme.new(f"{shown.title} (measured − model)", axis, shown.short_label, dark=dark)
    _floor(chart, time, sigma)
    if comparison.calibration is not None:
        x, y = line(time, shown.factor * (measured - one.initial[signal][inside]), theme.POINTS)
        before = {"width": 1, "color": theme.INITIAL}
        hidden = {"visible": "legendonly", "hovertemplate": "%{y:.4g}"}  # it would dwarf what is left
        chart.add_trace(go.Scatter(x=x, y=y, mode="lines", name="before calibration", line=before, **hidden))
    x, y = line(time, shown.factor * left, theme.POINTS)
    drawn = {"width": 1, "color": theme.RESIDUAL}
    chart.add_trace(go.Scatter(x=x, y=y, mode="lines", name="residual", line=drawn, hovertemplate="%{y:.4g}"))
    _edges(chart, time, sigma)
    if highlight is not None:
        theme.shade(chart, time_ranges(comparison, highlight, recording), window_s)
    theme.moment(chart, moment_s)
    return chart


def _floor(chart: go.Figure, time: NDArray[np.float64], sigma: NDArray[np.float64]) -> None:
    x, y = band(time, -sigma, sigma, theme.POINTS)
    chart.add_trace(
        go.Scatter(
            x=x,
            y=y,
            fill="toself",
            fillcolor=theme.FLOOR,
            line={"width": 0},
            mode="lines",
            name=theme.FLOOR_NAME,
            legendgroup="floor",
            hoverinfo="skip",
        )
    )


def _edges(chart: go.Figure, time: NDArray[np.float64], sigma: NDArray[np.float64]) -> None:
    """The band's edges once more, because dense noise hides the band below it."""
    for edge in (-sigma, sigma):
        x, y = line(time, edge, theme.POINTS // 2)
        drawn = {"width": 1.4, "color": theme.EDGE}
        legend = {"legendgroup": "floor", "showlegend": False}
        chart.add_trace(go.Scatter(x=x, y=y, mode="lines", line=drawn, hoverinfo="skip", name="floor", **legend))
