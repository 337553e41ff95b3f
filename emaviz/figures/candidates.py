"""The candidates of a discovery: how much of the error each would take away alone, predicted and refitted."""

from __future__ import annotations

import plotly.graph_objects as go

from ema_model.discovery import Discovery
from ema_model.discovery.shown.labels import effect_title
from emaviz.colours import FITTED
from emaviz.figures import theme

PREDICTED, REFITTED = theme.EDGE, FITTED


def height(found: Discovery) -> int:
    """Pixels in which every name can be read."""
    return 110 + 26 * len(found.candidates)


def figure(found: Discovery, *, dark: bool = False) -> go.Figure:
    """Bars for each candidate, the best on top; grey names are those that these recordings cannot show."""
    title = "What each candidate would take away from the error"
    shown = found.ranked[::-1]  # a horizontal bar chart counts from the bottom
    if not shown:
        return theme.missing(title, "no candidates were scored", dark=dark)
    chart = theme.new(title, "Fall of χ² [-]", "", dark=dark)
    names = [theme.plain(effect_title(one.name)) for one in shown]
    refitted = [None if one.refitted_drop is None else max(one.refitted_drop, 0.0) for one in shown]
    for name, colour, values, rank in (
        ("refitted", REFITTED, refitted, 2),
        ("predicted", PREDICTED, [one.predicted_drop for one in shown], 1),
    ):
        chart.add_trace(
            go.Bar(
                y=list(range(len(shown))),
                x=values,
                orientation="h",
                name=name,
                legendrank=rank,
                marker={"color": colour},
                customdata=names,
                hovertemplate="%{customdata}: %{x:.0f}",
            )
        )
    most = max([1.0, *(one.predicted_drop for one in shown), *(value for value in refitted if value is not None)])
    for place, one in enumerate(shown):
        if one.untestable_reason:
            chart.add_annotation(
                x=0.0,
                y=place,
                text="cannot be shown by these recordings",
                showarrow=False,
                xanchor="left",
                xshift=6,
                font={"size": 11, "color": theme.EDGE},
                hovertext=theme.plain(one.untestable_reason),
            )
    ticks = [
        f'<span style="color:{theme.EDGE}">{name}</span>' if one.untestable_reason else name
        for name, one in zip(names, shown)
    ]
    chart.update_xaxes(range=[0.0, 1.08 * most])
    chart.update_yaxes(tickvals=list(range(len(shown))), ticktext=ticks, showgrid=False, nticks=0)
    chart.update_layout(barmode="group", bargap=0.3)
    return chart
