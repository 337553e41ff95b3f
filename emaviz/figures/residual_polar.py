"""What is left of a signal around one turn of the motor, the zero a circle, outside it positive."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go

from ema_model.comparison.result import Comparison, Region
from emaviz.figures import quantity, theme
from emaviz.figures.binned import binned, edges_for
from emaviz.figures.residual_against import turn_ranges

_CIRCLE = np.arange(0.0, 361.0, 2.0)
_FEWEST = 20


def figure(
    comparison: Comparison,
    signal: str | None = None,
    *,
    highlight: Region | None = None,
    as_torque: bool = True,
    dark: bool = False,
) -> go.Figure:
    """The mean in bins of the motor's angle, ± its error, over all recordings; where the motor turns too little or
    its angle is not known, a figure that says so."""
    signal = signal or comparison.primary
    residuals = comparison.residuals
    shown = quantity.of_residual(comparison, signal, as_torque=as_torque)
    title = f"{shown.title} around the motor's turn"
    if comparison.actuator.axes.motor == "linear":
        return theme.missing(title, "a linear motor does not turn", dark=dark)
    angle, values = residuals.variables.get("motor_angle"), residuals.values.get(signal)
    known = np.zeros(0, dtype=bool)
    if angle is not None and values is not None:
        known = np.isfinite(angle) & np.isfinite(values) & ~residuals.saturated
    if angle is None or values is None or np.count_nonzero(known) < _FEWEST:
        return theme.missing(title, "the motor's angle is not known", dark=dark)
    turn = np.mod(angle[known], 2.0 * np.pi)
    bins = binned(turn, values[known], residuals.sigma[signal][known], edges_for("motor_angle", turn))
    if not len(bins.mean):
        return theme.missing(title, "too few blocks at each angle", dark=dark)
    shown = shown.scaled(bins.mean)
    mean, error = bins.mean * shown.factor, bins.error * shown.factor
    theta = np.degrees(bins.centre)
    whole = 1.3 * float(np.max(np.abs(mean) + error))
    chart = theme.new(title, "", "", dark=dark)
    for i, (low, high) in enumerate(_sectors(comparison, signal, highlight)):
        arc = np.linspace(low, high, max(2, int(high - low)))
        outline = np.concatenate([np.full(len(arc), whole), np.full(len(arc), -whole)])
        _fill(chart, np.concatenate([arc, arc[::-1]]), outline, theme.SHADE, "worst region", i == 0)
    # gaps of angles that were not visited stay open
    gap = np.flatnonzero(np.diff(theta) > 3.0 * np.median(np.diff(theta))) + 1 if len(theta) > 2 else np.zeros(0, int)
    closed = not len(gap) and theta[0] + 360.0 - theta[-1] <= 3.0 * np.median(np.diff(theta))
    ring_t, ring_m, ring_e = (np.append(v, v[0]) if closed else v for v in (theta, mean, error))
    for part in np.split(np.arange(len(ring_t)), gap):
        t, m, e = ring_t[part], ring_m[part], ring_e[part]
        edge = np.concatenate([m + e, (m - e)[::-1]])
        _fill(chart, np.concatenate([t, t[::-1]]), edge, "rgba(224,49,49,0.25)", "± error", bool(part[0] == 0))
    chart.add_trace(
        go.Scatterpolar(
            theta=_CIRCLE,
            r=np.zeros(len(_CIRCLE)),
            mode="lines",
            name="zero",
            line={"color": "#868e96", "width": 1.5, "dash": "dot"},
            hoverinfo="skip",
        )
    )
    drawn = {"color": theme.RESIDUAL, "width": 1.8}
    chart.add_trace(
        go.Scatterpolar(
            theta=np.insert(ring_t, gap, np.nan),
            r=np.insert(ring_m, gap, np.nan),
            mode="lines",
            name=f"mean [{shown.unit}]",
            line=drawn,
            hovertemplate="%{theta:.0f}°: %{r:.4g} " + shown.unit,
        )
    )
    chart.update_layout(
        polar={
            "domain": {"y": [0.1, 1.0]},  # the legend below does not push it
            "radialaxis": {"range": [-whole, whole], "nticks": 5, "angle": 90, "tickangle": 90},
            "angularaxis": {"dtick": 30, "ticksuffix": "°"},
        },
        margin={"l": 36, "r": 36, "t": 56, "b": 44},
    )
    return chart


def _sectors(comparison: Comparison, signal: str, highlight: Region | None) -> list[tuple[float, float]]:
    if highlight is not None:
        regions = [highlight]
    else:
        regions = [region for region in comparison.worst_regions if region.signal == signal]
    return [
        part
        for region in regions
        if region.variable == "motor_angle"
        for part in turn_ranges(np.degrees(region.low), np.degrees(region.high))
    ]


def _fill(chart: go.Figure, theta: np.ndarray, r: np.ndarray, colour: str, name: str, legend: bool) -> None:
    chart.add_trace(
        go.Scatterpolar(
            theta=theta,
            r=r,
            mode="lines",
            fill="toself",
            fillcolor=colour,
            line={"width": 0, "color": colour},
            name=name,
            legendgroup=name,
            showlegend=legend,
            hoverinfo="skip",
        )
    )
