"""Mean errors of two sources beside each other, a row a case, a colour an algorithm."""

from __future__ import annotations

from collections.abc import Mapping

import plotly.graph_objects as go

from emaviz.colours import ALGORITHMS
from emaviz.figures import theme
from emaviz.figures.error_distribution import colour

Means = Mapping[str, float]  # Err %, by case
_LEAST = 1e-3


def figure(
    title: str,
    ours: Mapping[str, Means],
    theirs: Mapping[str, Means],
    names: Mapping[str, str],
    *,
    dark: bool = False,
) -> go.Figure:
    """By algorithm; ours are filled, the others open.  names: what the legend calls the algorithms."""
    chart = theme.new(title, "Err [%], mean", "", dark=dark)
    for i, algorithm in enumerate(dict.fromkeys([*theirs, *ours])):
        own = ALGORITHMS.get(algorithm, colour(i))
        name = theme.plain(names.get(algorithm, algorithm))
        for means, told, symbol in (
            (theirs.get(algorithm), ", thesis", "circle-open"),
            (ours.get(algorithm), "", "circle"),
        ):
            if not means:
                continue
            marker = {"color": own, "size": 10, "symbol": symbol, "line": {"width": 2, "color": own}}
            chart.add_trace(
                go.Scatter(
                    x=[max(value, _LEAST) for value in means.values()],
                    y=list(means),
                    mode="markers",
                    name=name + told,
                    marker=marker,
                    hovertemplate="%{y}: %{x:.3g} %",
                )
            )
    ticks = [mantissa * 10.0**power for power in range(-3, 3) for mantissa in (1.0, 3.0)]
    chart.update_xaxes(type="log", tickvals=ticks, ticktext=[f"{one:g}" for one in ticks])
    chart.update_yaxes(autorange="reversed", nticks=0)
    return chart
