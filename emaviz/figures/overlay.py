"""A signal as measured, and as the model has it before and after calibration, the floor a band about the model."""

from __future__ import annotations

import plotly.graph_objects as go

from ema_model.comparison.result import Comparison, Region
from ema_model.estimation.floor import BAND_SIGMAS
from ema_model.quantities.numbers import Quantity
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
    dark: bool = False,
) -> go.Figure:
    """signal: the primary one, unless given; recording: from 0; moment_s: where a play-head stands.

    window_s: the time to show, from–to, drawn with all points that there is room for.
    """
    signal = signal or comparison.primary
    one = comparison.recordings[recording]
    title = quantity.of_signal(comparison, signal).title
    if signal not in one.measured:
        return theme.missing(title, "not recorded here", dark=dark)
    inside = within(one.time_s, window_s)
    time = one.time_s[inside]
    shown = quantity.of_signal(comparison, signal).scaled(one.measured[signal])
    measured, model = shown.factor * one.measured[signal][inside], shown.factor * one.model[signal][inside]
    sigma = BAND_SIGMAS * shown.factor * one.sigma[signal][inside]
    chart = theme.new(title, *_axes(comparison, shown), dark=dark)
    x, y = band(time, model - sigma, model + sigma, theme.POINTS)
    chart.add_trace(
        go.Scatter(
            x=x,
            y=y,
            fill="toself",
            fillcolor="rgba(240,140,0,0.22)",
            line={"width": 0},
            mode="lines",
            name=theme.FLOOR_NAME,
            hoverinfo="skip",
        )
    )
    calibrated = comparison.calibration is not None
    if calibrated:
        initial = shown.factor * one.initial[signal][inside]
        _add(chart, time, initial, "uncalibrated", theme.INITIAL, 1.3, "dot")
    _add(chart, time, measured, "measured", theme.MEASURED, 1.5)
    _add(chart, time, model, "calibrated" if calibrated else "model", theme.MODEL, 1.5)
    if highlight is not None:
        theme.shade(chart, time_ranges(comparison, highlight, recording), window_s)
    theme.moment(chart, moment_s)
    return chart


def _axes(comparison: Comparison, shown: Quantity) -> tuple[str, str]:
    return ("Sample" if comparison.residuals.is_map else "Time [s]"), shown.short_label


def _add(chart: go.Figure, time, values, name: str, colour: str, width: float, dash: str = "solid") -> None:
    x, y = line(time, values, theme.POINTS)
    drawn = {"color": colour, "width": width, "dash": dash}
    chart.add_trace(go.Scatter(x=x, y=y, mode="lines", name=name, line=drawn, hovertemplate="%{y:.4g}"))
