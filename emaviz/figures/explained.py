"""What explains the residual: how much each variable tells ahead, alone, times the current, by direction."""

from __future__ import annotations

import plotly.graph_objects as go

from ema_model.comparison.result import Comparison, Region
from ema_model.quantities.variables import MODULATORS, variable_title
from emaviz.figures import theme

_PALE = 0.3


def figure(
    comparison: Comparison, signal: str | None = None, *, highlight: Region | None = None, dark: bool = False
) -> go.Figure:
    """Bars for each variable, the most telling on top; those that noise could have made are pale.

    highlight: the region's variable is marked.
    """
    signal = signal or comparison.primary
    found = [e for e in comparison.explained_by if e.signal == signal]
    title = "What explains the residual"
    if not found:
        return theme.missing(title, "no variable to explain it with is known", dark=dark)
    best = {v: max(e.r2 for e in found if e.variable == v) for v in dict.fromkeys(e.variable for e in found)}
    # a horizontal bar chart counts from the bottom
    variables = sorted(best, key=lambda v: best[v])
    chart = theme.new(title, "Explained variance, cross-validated [%]", "", dark=dark)
    names = {v: _name(v, highlight) for v in variables}
    for modulator in reversed(MODULATORS):
        bars = {e.variable: e for e in found if e.modulator == modulator}
        if not bars:
            continue
        shown = [bars[v] for v in variables if v in bars]
        chart.add_trace(
            go.Bar(
                y=[names[e.variable] for e in shown],
                x=[100.0 * max(e.r2, 0.0) for e in shown],
                orientation="h",
                name=MODULATORS[modulator].title,
                legendrank=list(MODULATORS).index(modulator),
                marker={
                    "color": theme.RESIDUAL,
                    "pattern": {"shape": theme.HATCHES[modulator], "size": 5},
                    "opacity": [1.0 if e.significant else _PALE for e in shown],
                },
                customdata=[theme.plain(e.sentence) for e in shown],
                hovertemplate="%{x:.1f} %<br>%{customdata}",
            )
        )
    widest = 100.0 * max(max(best.values()), 0.0)
    chart.update_xaxes(range=[0, min(101.0, max(10.0, 1.1 * widest))])
    chart.update_yaxes(showgrid=False, categoryorder="array", categoryarray=[names[v] for v in variables], nticks=0)
    chart.update_layout(barmode="group", bargap=0.25, hovermode="closest")
    return chart


def _name(variable: str, highlight: Region | None) -> str:
    title = variable_title(variable)
    return f"<b>▶ {title}</b>" if highlight is not None and highlight.variable == variable else title
