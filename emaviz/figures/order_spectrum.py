"""How strongly the residual repeats with each turn of the motor, by order."""

from __future__ import annotations

import plotly.graph_objects as go

from ema_model.comparison.result import Comparison, Region
from emaviz.figures import quantity, theme

_NAMED = 8  # of the strongest bars have their order written over them
_PALE = "rgba(134,142,150,0.55)"


def figure(
    comparison: Comparison,
    *,
    highlight: Region | None = None,
    as_torque: bool = True,
    dark: bool = False,
) -> go.Figure:
    """Of the primary signal; orders that noise could have made are pale.

    highlight is taken so that all figures are called alike: an order belongs to every part of a turn, so that no
    region lies anywhere in this figure.
    """
    del highlight
    shown = quantity.of_residual(comparison, comparison.primary, as_torque=as_torque)
    title = f"{shown.title}: orders of the motor's turn"
    orders = sorted(comparison.orders, key=lambda order: order.order)
    if not orders:
        return theme.missing(title, "nothing repeats with the motor's turn", dark=dark)
    shown = shown.scaled([order.amplitude for order in orders])
    chart = theme.new(title, "Periods in each turn", f"Amplitude [{shown.unit}]", dark=dark)
    strongest = sorted(orders, key=lambda order: -order.amplitude)[:_NAMED]
    named = {order.order for order in strongest if order.is_significant()}
    heights = [order.amplitude * shown.factor for order in orders]
    last = orders[-1].order
    chart.add_trace(
        go.Bar(
            x=[order.order for order in orders],
            y=heights,
            width=max(0.8, last / 150.0),
            marker={"color": [theme.RESIDUAL if order.is_significant() else _PALE for order in orders]},
            text=[f"{order.order}" if order.order in named else "" for order in orders],
            textposition="outside",
            cliponaxis=False,
            hovertemplate="order %{x}: %{y:.3g} " + shown.unit + "<extra></extra>",
        )
    )
    chart.update_xaxes(range=[0, max(24, last) + 2], showgrid=False)
    chart.update_yaxes(range=[0, 1.15 * max(heights)])
    chart.update_layout(showlegend=False)
    return chart
