"""How far calibration moved each parameter from the actuator's file, in the tolerance's σ, with intervals."""

from __future__ import annotations

from dataclasses import dataclass

import plotly.graph_objects as go

from ema_model.actuator.naming import on_axes
from ema_model.comparison.result import Comparison, Region
from ema_model.faults import NAMES
from ema_model.quantities.numbers import number
from emaviz.figures import theme

_BOUND = 3.0


@dataclass(frozen=True)
class Score:
    """One calibrated parameter."""

    path: str
    title: str
    nominal: float
    value: float
    low: float
    high: float
    unit: str
    z: float
    half: float  # of the interval, in σ; NaN where σ is not known
    at_bound: bool


def scores(comparison: Comparison) -> list[Score]:
    """Parameters of the actuator, and k1 … k8, as calibrated; the recordings' own starts apart."""
    if comparison.calibration is None:
        return []
    found = []
    for path, fitted in comparison.calibration.parameters.items():
        name = path if path in NAMES else on_axes(path, comparison.actuator.axes).title
        low, high = fitted.interval90
        found.append(
            Score(
                path,
                name,
                fitted.initial,
                fitted.value,
                low,
                high,
                fitted.unit,
                fitted.z,
                0.5 * (high - low) / _sigma(comparison, path, fitted.value - fitted.initial, fitted.z),
                fitted.at_bound,
            )
        )
    return found


def _sigma(comparison: Comparison, path: str, moved: float, z: float) -> float:
    tolerance = comparison.actuator.tolerances.get(path)
    if tolerance is not None:
        return tolerance.sigma
    return moved / z if z else float("nan")


def figure(comparison: Comparison, *, highlight: Region | None = None, dark: bool = False) -> go.Figure:
    """A dot for each parameter with its 90 % interval; red at a bound of ±3 σ.

    highlight is taken so that all figures are called alike; parameters belong to no region.
    """
    del highlight
    found = scores(comparison)
    title = "Calibrated parameters"
    if not found:
        return theme.missing(title, "nothing was calibrated", dark=dark)
    chart = theme.new(title, "Distance from the actuator's file [σ]", "", dark=dark)
    names = [theme.plain(score.title) for score in reversed(found)]
    for at_bound, name, colour in ((False, "90 % interval", theme.MODEL), (True, "at its bound", theme.MARK)):
        some = [score for score in reversed(found) if score.at_bound == at_bound]
        if not some:
            continue
        texts = [f"{number(s.value, 4)} {s.unit} (file: {number(s.nominal, 4)})" for s in some]
        chart.add_trace(
            go.Scatter(
                x=[score.z for score in some],
                y=[theme.plain(score.title) for score in some],
                error_x={"array": [min(score.half, 10.0) for score in some], "thickness": 1.5, "width": 4},
                mode="markers",
                name=name,
                marker={"color": colour, "size": 9},
                customdata=[theme.plain(text) for text in texts],
                hovertemplate="%{y}: %{customdata}<br>%{x:.2f} σ<extra></extra>",
            )
        )
    for edge in (-_BOUND, _BOUND):
        drawn = {"color": theme.MARK, "width": 1.2, "dash": "dash"}
        chart.add_shape(type="line", x0=edge, x1=edge, yref="y domain", y0=0, y1=1, line=drawn)
    chart.update_xaxes(range=[-4, 4], dtick=1, zeroline=True)
    chart.update_yaxes(categoryorder="array", categoryarray=names, range=[-0.7, len(names) - 0.3], nticks=0)
    return chart
