"""How often each answer was given: bars, a row a case, its parts side by side."""

from __future__ import annotations

from collections.abc import Mapping

import plotly.graph_objects as go

from emaviz.figures import theme
from emaviz.figures.error_distribution import colour


def figure(title: str, counts: Mapping[str, Mapping[str, int]], *, dark: bool = False) -> go.Figure:
    """counts: by case, of each answer."""
    chart = theme.new(title, "Tasks", "", dark=dark)
    cases = list(counts)
    answers = list(dict.fromkeys(answer for one in counts.values() for answer in one))
    for i, answer in enumerate(answers):
        chart.add_trace(
            go.Bar(
                y=[theme.plain(case) for case in cases],
                x=[counts[case].get(answer, 0) for case in cases],
                name=theme.plain(answer),
                orientation="h",
                marker={"color": colour(i)},
            )
        )
    chart.update_layout(barmode="stack")
    chart.update_yaxes(autorange="reversed", nticks=0)
    return chart
