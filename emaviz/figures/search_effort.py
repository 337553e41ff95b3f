"""How good answers are against how much search they took: medians, and bars from 5 to 95 %."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import plotly.graph_objects as go

from emaviz.colours import ALGORITHMS
from emaviz.figures import theme
from emaviz.figures.error_distribution import colour


class Effort(NamedTuple):
    """x, and Err % of the searches there."""

    x: float
    low: float
    middle: float
    high: float


def figure(
    title: str,
    x: str,
    found: Mapping[str, Sequence[Effort]],
    names: Mapping[str, str],
    *,
    joined: bool = True,
    dark: bool = False,
) -> go.Figure:
    """found: by algorithm; names: what the legend calls them; joined: points of an algorithm follow on one another."""
    chart = theme.new(title, x, "Err [%]", dark=dark)
    for i, (algorithm, points) in enumerate(found.items()):
        own = ALGORITHMS.get(algorithm, colour(i))
        ordered = sorted(points)
        bars = {
            "array": [one.high - one.middle for one in ordered],
            "arrayminus": [one.middle - one.low for one in ordered],
            "thickness": 1,
            "width": 3,
        }
        chart.add_trace(
            go.Scatter(
                x=[one.x for one in ordered],
                y=[one.middle for one in ordered],
                error_y=bars if joined else None,
                mode="lines+markers" if joined else "markers",
                name=theme.plain(names.get(algorithm, algorithm)),
                line={"color": own, "width": 2},
                marker={"color": own, "size": 7},
            )
        )
    chart.update_xaxes(type="log", tickvals=_ticks(found), ticktext=[f"{v:,.0f}" for v in _ticks(found)])
    chart.update_yaxes(rangemode="tozero")
    return chart


def _ticks(found: Mapping[str, Sequence[Effort]]) -> list[float]:
    """Where searches were made, as long as that is legible, else round numbers."""
    places = sorted({one.x for points in found.values() for one in points})
    if len(places) <= 6:
        return places
    return [v for v in (100, 300, 1000, 3000, 10_000, 30_000, 100_000) if places[0] / 3 <= v <= 3 * places[-1]]
