"""What is left of a signal over time, about the band in which a perfect model would lie."""

from __future__ import annotations

import plotly.graph_objects as go

from ema_model.comparison.result import Comparison, Region
from ema_model.estimation.floor import BAND_SIGMAS
from emaviz.figures import floor_band, quantity, theme
from emaviz.figures.lines import line
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
    sigma = BAND_SIGMAS * shown.factor * one.sigma[signal][inside]
    axis = "Sample" if comparison.residuals.is_map else "Time [s]"
    chart = theme.new(f"{shown.title} (measured − model)", axis, shown.short_label, dark=dark)
    floor_band.below(chart, time, sigma)
    if comparison.calibration is not None:
        x, y = line(time, shown.factor * (measured - one.initial[signal][inside]), theme.POINTS)
        before = {"width": 1, "color": theme.INITIAL}
        hidden = {"visible": "legendonly", "hovertemplate": "%{y:.4g}"}  # it would dwarf what is left
        chart.add_trace(go.Scatter(x=x, y=y, mode="lines", name="uncalibrated", line=before, **hidden))
    x, y = line(time, shown.factor * left, theme.POINTS)
    drawn = {"width": 1, "color": theme.RESIDUAL}
    chart.add_trace(go.Scatter(x=x, y=y, mode="lines", name="residual", line=drawn, hovertemplate="%{y:.4g}"))
    floor_band.above(chart, time, sigma)
    if highlight is not None:
        theme.shade(chart, time_ranges(comparison, highlight, recording), window_s)
    theme.moment(chart, moment_s)
    return chart
