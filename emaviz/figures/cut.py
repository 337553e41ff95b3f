"""An axis about zero that a few values, as those of a start, would set for all the others: it is cut, and says so."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import ArrayLike

from ema_model.quantities.numbers import number

_PERCENT, _USUAL, _FAR = 99.0, 1.5, 1.3  # of the values; times that one the axis ends; beyond times that it is cut
_STEPS = (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)  # an end is one of them, so that it seldom changes


def end_of(values: ArrayLike) -> float | None:
    """Where the axis ends on either side of zero; None where it shows every value."""
    size = np.abs(np.asarray(values, dtype=float))
    size = size[np.isfinite(size)]
    usual = _USUAL * float(np.percentile(size, _PERCENT)) if size.size else 0.0
    if usual <= 0.0:
        return None
    decade = 10.0 ** math.floor(math.log10(usual))
    end = next(step * decade for step in _STEPS if step * decade >= usual)
    return end if size.max() > _FAR * end else None


def told(end: float, values: ArrayLike, unit: str) -> str:
    """'cut at ±0.3 A, largest 0.866 A'."""
    largest = np.nanmax(np.abs(np.asarray(values, dtype=float)))
    return f"cut at ±{end:g} {unit}, largest {number(largest)} {unit}"


def cut(figure: go.Figure, values: ArrayLike, unit: str, **where: Any) -> None:
    """Cuts the y-axis of a figure, or of its row and column, where that is to be; values: all that is drawn there."""
    end = end_of(values)
    if end is None:
        return
    figure.update_yaxes(range=[-end, end], **where)
    figure.add_annotation(
        text=told(end, values, unit), x=1.0, xref="x domain", xanchor="right", y=1.0, yref="y domain", yanchor="bottom",
        showarrow=False, font={"size": 10}, **where,
    )  # fmt: skip
