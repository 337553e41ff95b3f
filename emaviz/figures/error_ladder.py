"""The error ladder: how far the model is from the recordings, step by step, in units of the floor."""

from __future__ import annotations

import math

import plotly.graph_objects as go

from ema_model.discovery import Discovery
from ema_model.discovery.shown.labels import rung_title
from ema_model.quantities.numbers import number
from emaviz.colours import FITTED, HELD_OUT
from emaviz.figures import theme

_WIDE = 15.0  # times the floor, from which on the scale is logarithmic
_TOP = 1.2  # of a straight scale, times the largest error
# of the chart's height: the marker, where nothing of its number is, and the far end of a number above or below it
_MARKER, _LABEL = 0.04, 0.14


def figure(found: Discovery, *, dark: bool = False) -> go.Figure:
    """A line for what was fitted, one for what was held out, and the floor at 1 with how well it is known."""
    chart = theme.new("Error after each step", "", "Error / floor [-]", dark=dark)
    # Numbered within: two steps may have the same title.
    places = list(range(len(found.ladder)))
    titles = [theme.plain(rung_title(rung.change, found.actuator.axes)) for rung in found.ladder]
    lines = [("fitted", FITTED, "circle", [rung.rmse for rung in found.ladder])]
    held = [rung.holdout_rmse for rung in found.ladder]
    if any(value is not None for value in held):
        lines.append(("held out", HELD_OUT, "diamond", [float("nan") if v is None else v for v in held]))
    shown = [1.0, *(value for *_, values in lines for value in values if math.isfinite(value) and value > 0.0)]
    wide = max(shown) > _WIDE  # on a straight scale all else would lie on the axis
    low, high = (math.log10(0.4 * min(shown)), math.log10(2.0 * max(shown))) if wide else (0.0, _TOP * max(shown))

    def height(value: float) -> float:
        return ((math.log10(value) if wide else value) - low) / (high - low)

    for name, colour, symbol, values in lines:
        other = next((line[3] for line in lines if line[0] != name), values)
        chart.add_trace(
            go.Scatter(
                x=places,
                y=values,
                mode="lines+markers+text",
                name=name,
                line={"color": colour, "width": 2.5},
                marker={"size": 10, "symbol": symbol},
                text=[number(value) for value in values],
                # The number of the upper line above it, of the lower one below.
                textposition=[
                    _beside(height(value), height(1.0), value > its or (value == its and name == "fitted"))
                    if value > 0.0
                    else "top center"
                    for value, its in zip(values, other)
                ],
                textfont={"color": colour, "size": 12},
                customdata=titles,
                hovertemplate="%{customdata}: %{y:.3f} × the floor",
                cliponaxis=False,
            )
        )
    least, most = found.floor_band
    ends = [-0.5, len(places) - 0.5]
    chart.add_trace(
        go.Scatter(
            x=[*ends, *ends[::-1]],
            y=[least, least, most, most],
            fill="toself",
            fillcolor=theme.FLOOR,
            line={"width": 0},
            mode="lines",
            name="floor, 90 % interval",
            hoverinfo="skip",
        )
    )
    chart.add_trace(
        go.Scatter(
            x=ends,
            y=[1.0, 1.0],
            mode="lines",
            name="floor",
            line={"color": theme.EDGE, "width": 1.5, "dash": "dash"},
            hoverinfo="skip",
        )
    )
    chart.update_xaxes(
        tickvals=places, ticktext=titles, range=[-0.5, len(places) - 0.5], showgrid=False, zeroline=False, nticks=0
    )
    if wide:
        chart.update_yaxes(type="log", range=[low, high], dtick=1)
    else:
        chart.update_yaxes(range=[low, high], rangemode="tozero")
    return chart


def _beside(at: float, floor: float, above: bool) -> str:
    """Where the number of a point stands, by heights in the chart: above or below it, or beside it on the floor's line.

    A floor that runs through the marker is clear of the numbers above and below.
    """
    away = floor - at if above else at - floor
    return "middle right" if _MARKER < away < _LABEL else "top center" if above else "bottom center"
