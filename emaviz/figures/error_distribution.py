"""How the errors of many identifications are spread: the share that stays below a value, a line a case."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import plotly.graph_objects as go

from emaviz.colours import CASES
from emaviz.figures import theme

_MOST_POINTS = 400
_DASHES = ("solid", "dash", "dot")  # of the first cases, and of those that come back to their colours


def figure(title: str, x: str, values: Mapping[str, Sequence[float]], *, dark: bool = False) -> go.Figure:
    """values: by case."""
    chart = theme.new(title, x, "Share below [%]", dark=dark)
    for i, (name, given) in enumerate(values.items()):
        ordered = np.sort(np.asarray(given, dtype=float))
        share = 100.0 * np.arange(1, len(ordered) + 1) / len(ordered)
        shown = np.unique(np.linspace(0, len(ordered) - 1, min(len(ordered), _MOST_POINTS)).astype(int))
        line = {"color": colour(i), "width": 2, "shape": "hv", "dash": _DASHES[i // len(CASES) % len(_DASHES)]}
        chart.add_trace(go.Scatter(x=ordered[shown], y=share[shown], mode="lines", name=theme.plain(name), line=line))
    chart.update_layout(showlegend=len(values) > 1)
    chart.update_yaxes(range=[0, 102])
    return chart


def colour(number: int) -> str:
    """Of the so-manieth case."""
    return CASES[number % len(CASES)]
