"""What is left of a signal against a variable: the blocks, their mean in bins, the floor, the worst regions."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go

from ema_model.comparison.result import Comparison, Region
from ema_model.estimation.floor import BAND_SIGMAS
from ema_model.quantities.numbers import Quantity
from emaviz.colours import BACKWARD, FORWARD
from emaviz.figures import floor_band, quantity, theme
from emaviz.figures.binned import Binned, binned, edges_for
from emaviz.figures.lines import scattered

_FEWEST = 20  # blocks that can be drawn as a cloud with a mean


def figure(
    comparison: Comparison,
    variable: str,
    signal: str | None = None,
    *,
    highlight: Region | None = None,
    by_direction: bool | None = None,
    as_torque: bool = True,
    dark: bool = False,
) -> go.Figure:
    """All recordings together, blocks where the drive is saturated left out.

    by_direction: a mean for each direction of motion; without it, where direction explains the residual best.
    The regions of this variable are shaded, or `highlight` alone; blocks of a region of another are marked.
    """
    signal = signal or comparison.primary
    residuals = comparison.residuals
    axis = quantity.of_variable(comparison, variable)
    shown = quantity.of_residual(comparison, signal, as_torque=as_torque)
    title = f"{shown.title} against {axis.title[0].lower()}{axis.title[1:]}"
    known = np.zeros(0, dtype=bool)
    if variable in residuals.variables and signal in residuals.values:
        known = np.isfinite(residuals.variables[variable]) & np.isfinite(residuals.values[signal])
        known &= ~residuals.saturated
    if np.count_nonzero(known) < _FEWEST:
        return theme.missing(title, f"{axis.title}: not known in these recordings", dark=dark)
    x, y = quantity.wrapped(comparison, variable), residuals.values[signal]
    shown, axis = shown.scaled(y[known]), axis.scaled(x[known])
    chart = theme.new(title, axis.label, shown.label, dark=dark)
    edges = edges_for(variable, x[known])
    together = binned(x[known], y[known], residuals.sigma[signal][known], edges)
    _band(chart, together, axis, shown)
    places = np.flatnonzero(known)
    places = places[scattered(x[places], y[places], theme.POINTS)]
    cloud = {"size": 3, "color": "#868e96", "opacity": 0.35}
    _points(chart, x[places] * axis.factor, y[places] * shown.factor, "blocks", cloud)
    if highlight is not None and highlight.variable != variable:
        marked = np.flatnonzero(known & highlight.blocks)
        marked = marked[scattered(x[marked], y[marked], theme.POINTS)]
        strong = {"size": 4, "color": theme.MARK, "opacity": 0.5}
        _points(chart, x[marked] * axis.factor, y[marked] * shown.factor, "blocks of the region", strong)
    if by_direction is None:
        by_direction = _best_modulator(comparison, variable, signal) == "sign_speed"
    if by_direction:
        for sign, name, colour in ((1, "mean, forward", FORWARD), (-1, "mean, backward", BACKWARD)):
            moving = known & (residuals.direction == sign)
            if np.count_nonzero(moving) >= _FEWEST:
                _mean(
                    chart,
                    binned(x[moving], y[moving], residuals.sigma[signal][moving], edges),
                    axis,
                    shown,
                    name,
                    colour,
                )
    else:
        _mean(chart, together, axis, shown, "mean ± error", theme.RESIDUAL)
    theme.shade(chart, _ranges(comparison, variable, signal, highlight, axis))
    if axis.unit == "°":
        chart.update_xaxes(range=[0, 360], tick0=0, dtick=60)
    _fit(chart, y[known] * shown.factor)
    return chart


def _fit(chart: go.Figure, y: np.ndarray) -> None:
    """All blocks stay in sight, with a little air."""
    least, most = float(np.min(y)), float(np.max(y))
    air = 0.05 * (most - least) or 1.0
    chart.update_yaxes(range=[least - air, most + air])


def _best_modulator(comparison: Comparison, variable: str, signal: str) -> str:
    fitting = (e for e in comparison.explained_by if e.variable == variable and e.signal == signal and e.significant)
    best = max(fitting, key=lambda e: e.r2, default=None)
    return "1" if best is None else best.modulator


def _ranges(
    comparison: Comparison, variable: str, signal: str, highlight: Region | None, axis: Quantity
) -> list[tuple[float, float]]:
    regions = comparison.worst_regions if highlight is None else [highlight]
    ranges = []
    for region in regions:
        if region.variable != variable or (highlight is None and region.signal != signal):
            continue
        low, high = region.low * axis.factor, region.high * axis.factor
        if axis.unit == "°":
            ranges += turn_ranges(low, high)
        else:
            ranges.append((low, high))
    return ranges


def turn_ranges(low: float, high: float) -> list[tuple[float, float]]:
    """A range of degrees within 0 … 360, in two parts where it goes over the end of the turn."""
    width = min(high - low if high >= low else high - low + 360.0, 360.0)
    start = low % 360.0
    end = start + width
    return [(start, end)] if end <= 360.0 + 1e-9 else [(start, 360.0), (0.0, end - 360.0)]


def _band(chart: go.Figure, bins: Binned, axis: Quantity, shown: Quantity) -> None:
    # in steps from edge to edge: the floor is known by bin
    x = np.stack([bins.low, bins.high], axis=1).ravel() * axis.factor
    y = np.repeat(bins.floor, 2) * shown.factor * BAND_SIGMAS
    floor_band.outlined(chart, np.concatenate([x, x[::-1]]), np.concatenate([y, -y[::-1]]))


def _points(chart: go.Figure, x: np.ndarray, y: np.ndarray, name: str, marker: dict) -> None:
    chart.add_trace(
        go.Scatter(
            x=x.astype(np.float32),
            y=y.astype(np.float32),
            mode="markers",
            name=name,
            marker=marker,
            hovertemplate="%{x:.4g}: %{y:.4g}",
        )
    )


def _mean(chart: go.Figure, bins: Binned, axis: Quantity, shown: Quantity, name: str, colour: str) -> None:
    many = len(bins.mean) > 60
    apart = 1 + np.flatnonzero(bins.low[1:] > bins.high[:-1] + 1e-9 * np.ptp(bins.high))  # no line where nothing is
    x, y, error = (np.insert(one, apart, np.nan) for one in (bins.centre, bins.mean, bins.error))
    chart.add_trace(
        go.Scatter(
            x=x * axis.factor,
            y=y * shown.factor,
            error_y={"array": error * shown.factor, "thickness": 1, "width": 0 if many else 2},
            mode="lines+markers",
            name=name,
            line={"color": colour, "width": 1.8},
            marker={"size": 3 if many else 5},
            hovertemplate="%{x:.4g}: %{y:.4g}",
        )
    )
