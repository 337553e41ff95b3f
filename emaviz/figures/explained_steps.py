"""What the residual depended on before the first step, and what it depends on now: how much each variable tells."""

from __future__ import annotations

from collections.abc import Sequence

import plotly.graph_objects as go

from ema_model.comparison.explain import Explanation
from ema_model.quantities.variables import variable_title
from emaviz.figures import theme

_PALE = 0.3
_TITLE = "What the residual depends on"


def figure(before: Sequence[Explanation], now: Sequence[Explanation], *, dark: bool = False) -> go.Figure:
    """Two bars a variable, its best modulator's, the most telling before on top; pale where noise could make it.

    One bar where nothing has changed yet.
    """
    runs = {"calibrated model": _best(before), "improved model": _best(now)}
    if before is now:
        runs = {"calibrated model": _best(now)}
    order = {variable: one.r2 for found in reversed(runs.values()) for variable, one in found.items()}
    if not order:
        return theme.missing(_TITLE, "no variable to explain it with is known", dark=dark)
    variables = sorted(order, key=lambda variable: order[variable])  # a horizontal bar chart counts from the bottom
    titles = [variable_title(variable) for variable in variables]
    chart = theme.new(_TITLE, "Explained variance, cross-validated [%]", "", dark=dark)
    for (name, found), colour in zip(reversed(runs.items()), (theme.RESIDUAL, theme.INITIAL)):
        known = [found.get(variable) for variable in variables]
        nothing = not any(one is not None and one.r2 > 0.0 for one in known)
        chart.add_trace(
            go.Bar(
                y=titles,
                x=[0.0 if one is None else 100.0 * max(one.r2, 0.0) for one in known],
                orientation="h",
                name=f"{name} (nothing explained)" if nothing else name,
                legendrank=list(runs).index(name),
                marker={
                    "color": colour,
                    "opacity": [1.0 if one is not None and one.significant else _PALE for one in known],
                },
                customdata=["" if one is None else theme.plain(one.sentence) for one in known],
                hovertemplate="%{x:.1f} %<br>%{customdata}",
            )
        )
    widest = 100.0 * max(max(order.values()), 0.0)
    chart.update_xaxes(range=[0, min(101.0, max(10.0, 1.1 * widest))])
    chart.update_yaxes(showgrid=False, categoryorder="array", categoryarray=titles, nticks=0)
    chart.update_layout(barmode="group", bargap=0.25, hovermode="closest")
    return chart


def _best(found: Sequence[Explanation]) -> dict[str, Explanation]:
    best: dict[str, Explanation] = {}
    for one in found:
        if one.variable not in best or one.r2 > best[one.variable].r2:
            best[one.variable] = one
    return best
