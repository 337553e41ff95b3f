"""What is missing and has no name: the residual as a curve of the variable that explains it best."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go

from ema_model.discovery import Discovery
from ema_model.quantities.numbers import Quantity
from ema_model.quantities.shown import of_residual
from ema_model.quantities.variables import of_variable
from emaviz.figures import theme


def figure(found: Discovery, *, dark: bool = False) -> go.Figure:
    """The curve with its standard error; what is missing of the current is told as the motor's torque."""
    unknown = found.unknown
    if unknown is None:
        return theme.missing("Remaining residual", "nothing that a variable explains", dark=dark)
    axis, shown = of_variable(unknown.variable, found.actuator.axes), _residual(found)
    axis, shown = axis.scaled(unknown.centres), shown.scaled(unknown.curve)
    title = f"{shown.title} against {axis.title[0].lower()}{axis.title[1:]}"
    chart = theme.new(title, axis.label, shown.label, dark=dark)
    known = np.isfinite(unknown.curve) & np.isfinite(unknown.error)
    chart.add_trace(
        go.Scatter(
            x=axis.factor * unknown.centres[known],
            y=shown.factor * unknown.curve[known],
            error_y={"array": shown.factor * np.abs(unknown.error[known]), "thickness": 1.2, "width": 3},
            mode="lines+markers",
            name="mean ± standard error",
            line={"color": theme.RESIDUAL, "width": 2},
            marker={"size": 6},
            hovertemplate="%{x:.4g}: %{y:.4g}",
        )
    )
    chart.update_xaxes(zeroline=True)
    chart.update_yaxes(zeroline=True)
    if axis.unit == "°":
        chart.update_xaxes(range=[0, 360], tick0=0, dtick=60)
    chart.update_layout(showlegend=True)
    return chart


def _residual(found: Discovery) -> Quantity:
    assert found.unknown is not None
    modulator = found.unknown.modulator
    told = of_residual(found.unknown.signal, found.actuator.axes, found.actuator.motor.torque_constant_Nm_A)
    if modulator == "current":  # a share of the current or torque, which has no unit of its own
        return Quantity(f"{told.title} / current", f"{told.unit}/A", told.factor)
    return Quantity(f"{told.title}, with the motion", told.unit, told.factor) if modulator == "sign_speed" else told
