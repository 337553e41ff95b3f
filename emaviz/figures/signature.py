"""An effect's signature beside what is left: what it would change, and what the model lacks, over one variable."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from ema_model.comparison.residuals import Residuals
from ema_model.discovery import Candidate
from ema_model.discovery.shown.labels import effect_title
from ema_model.discovery.steps.snapshot import Look
from ema_model.quantities.numbers import Quantity
from ema_model.quantities.shown import of_residual
from ema_model.quantities.titles import in_sentence
from ema_model.quantities.variables import of_variable
from ema_model.simulation.with_effect import few_periods
from emaviz.figures import theme
from emaviz.figures.binned import Binned, binned, edges_for

Array = NDArray[np.float64]

SIGNATURE = theme.MODEL
_VARIABLES = ("motor_angle", "motor_speed", "user_position", "current", "load", "acceleration")
_TURN = 2.0 * np.pi
_MOST_IN_A_TURN = 8.0  # periods that are told from one another where a turn is drawn whole
_SHOWN = 400  # blocks over time
_CLEAR = 0.25  # of the signature's square that a variable must tell, else it is drawn over time


def figure(look: Look, one: Candidate, *, dark: bool = False) -> go.Figure:
    """Means over the variable that the effect follows; where the two lines lie together, this is what is missing."""
    title = f"{effect_title(one.name)} and the residual"
    signal = look.primary
    change = look.change(one, signal)
    if change is None or not np.any(change):
        return theme.missing(title, "these recordings do not show it", dark=dark)
    residuals = look.residuals
    variable = variable_of(residuals, change, _span(one))
    if variable == "time":
        return _over_time(look, one, title, signal, change, dark)
    x = _values(residuals, variable, one)
    edges = _edges(variable, x, one)
    left, own = (binned(x, values, residuals.sigma[signal], edges) for values in (residuals.values[signal], change))
    axis, shown = _axis(look, variable, one), _shown(look, signal, left, own)
    axis = axis.scaled(x[np.isfinite(x)])
    chart = theme.new(title, axis.label, shown.label, dark=dark)
    _add_left(chart, left, axis, shown)
    chart.add_trace(
        go.Scatter(
            x=axis.factor * own.centre,
            y=shown.factor * own.mean,
            mode="lines",
            name=_legend(one),
            line={"color": SIGNATURE, "width": 2.5},
            hovertemplate="%{y:.3g}",
        )
    )
    chart.update_yaxes(zeroline=True)
    if variable == "motor_angle":
        chart.update_xaxes(range=[0.0, axis.factor * edges[-1]])
    return chart


def _legend(one: Candidate) -> str:
    return theme.plain(f"what {in_sentence(effect_title(one.name))} would change")


def _over_time(look: Look, one: Candidate, title: str, signal: str, change: Array, dark: bool) -> go.Figure:
    """Where it would change most, block by block."""
    residuals = look.residuals
    middle = int(np.argmax(np.convolve(change**2, np.ones(_SHOWN // 2), mode="same")))
    part = np.flatnonzero(residuals.run == residuals.run[middle])
    part = part[np.abs(part - middle) <= _SHOWN // 2]
    values = residuals.values[signal][part]
    shown = of_residual(signal, look.found.actuator.axes).scaled(values)
    chart = theme.new(title, "Time [s], where it would show most", shown.label, dark=dark)
    for name, line, style in (
        ("measured − model", values, {"color": theme.RESIDUAL, "width": 1}),
        (_legend(one), change[part], {"color": SIGNATURE, "width": 2.5}),
    ):
        chart.add_trace(
            go.Scatter(x=residuals.time_s[part], y=shown.factor * line, mode="lines", name=name, line=style)
        )
    return chart


def variable_of(residuals: Residuals, change: Array, span: float = _TURN) -> str:
    """The variable that an effect's change follows best, the motor's angle over a span; time where it follows none."""
    best, told = "time", _CLEAR
    power = float(np.sum(change**2))
    for variable in _VARIABLES:
        x = residuals.variables.get(variable)
        if x is None or np.isfinite(x).sum() < 100 or np.ptp(x[np.isfinite(x)]) == 0.0:
            continue
        x = np.mod(x, span) * (_TURN / span) if variable == "motor_angle" else x
        known = np.isfinite(x)
        edges = edges_for(variable, x)
        place = np.clip(np.searchsorted(edges, x[known], side="right") - 1, 0, len(edges) - 2)
        count = np.maximum(np.bincount(place, minlength=len(edges) - 1), 1)
        mean = np.bincount(place, change[known], len(edges) - 1) / count
        share = 1.0 - float(np.sum((change[known] - mean[place]) ** 2)) / power
        # The bins of a turn are many more than those of the others, and tell a little of anything.
        if share - 0.1 * (variable == "motor_angle") > told:
            best, told = variable, share
    return best


def _values(residuals: Residuals, variable: str, one: Candidate) -> Array:
    if variable == "time":
        return residuals.variables.get("time", residuals.time_s)
    x = residuals.variables[variable]
    return np.mod(x, _span(one)) if variable == "motor_angle" else x


def _span(one: Candidate) -> float:
    """Of the motor's angle: a whole turn of few periods, else a few periods."""
    order = one.settings.get("order", 1.0)
    whole = "period_rad" not in one.settings and 2.0 <= order <= _MOST_IN_A_TURN
    return _TURN if whole else few_periods(one.settings)[0]


def _edges(variable: str, x: Array, one: Candidate) -> Array:
    if variable == "motor_angle":
        span, count = few_periods(one.settings)
        periods = count * _span(one) / span
        return np.linspace(0.0, _span(one), int(np.clip(14 * periods, 36, 240)) + 1)
    return edges_for(variable, x)


def _axis(look: Look, variable: str, one: Candidate) -> Quantity:
    axis = of_variable(variable, look.found.actuator.axes)
    if variable != "motor_angle" or _span(one) == _TURN:
        return axis
    return replace(axis, title=f"{axis.title}, folded to {few_periods(one.settings)[1]} periods")


def _shown(look: Look, signal: str, *lines: Binned) -> Quantity:
    values = np.concatenate([line.mean for line in lines])
    return of_residual(signal, look.found.actuator.axes, look.residuals.torque_constant).scaled(values)


def _add_left(chart: go.Figure, left: Binned, axis: Quantity, shown: Quantity) -> None:
    chart.add_trace(
        go.Scatter(
            x=axis.factor * left.centre,
            y=shown.factor * left.mean,
            error_y={"array": shown.factor * left.error, "thickness": 1, "width": 0, "color": theme.FLOOR},
            mode="markers",
            name="measured − model",
            marker={"size": 5, "color": theme.RESIDUAL},
            hovertemplate="%{y:.3g}",
        )
    )
