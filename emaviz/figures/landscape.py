"""The cost over two k: as a map, with the answer, its interval, the truth, and where each search ended."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from ema_model.faults import FAULTS
from ema_model.identification.landscape import Landscape
from ema_model.identification.run import algorithm_title
from emaviz.colours import TRUTH
from emaviz.figures import theme
from emaviz.figures.convergence import colour

Array = NDArray[np.floating]

_LEAST_A = 1e-6  # a logarithmic colour has no zero
_STEPS = (1.0, 2.0, 5.0)
_MOST_TICKS = 7
_ANSWER = theme.MARK


@dataclass(frozen=True, eq=False)
class Marks:
    """What stands on the map."""

    answer: Array  # (8,)
    interval90: Array | None = None  # (8, 2)
    truth: Array | None = None  # (8,)
    ends: Mapping[str, Array] | None = None  # (8,) each, by the search's name


def figure(landscape: Landscape, marks: Marks, *, dark: bool = False) -> go.Figure:
    """Dark: a low error.  Points off the slice are drawn where their two k are."""
    x, y = landscape.x, landscape.y
    height = np.log10(np.maximum(landscape.error_A, _LEAST_A))
    drawn = theme.new("Cost around the answer", axis_title(x), axis_title(y), dark=dark)
    known = landscape.error_A[np.isfinite(landscape.error_A)]
    ticks = round_values(float(known.min()), float(known.max())) if len(known) else []
    drawn.add_trace(
        go.Contour(
            x=landscape.across, y=landscape.upwards, z=height, connectgaps=False, ncontours=18,
            colorscale="Viridis", contours={"coloring": "heatmap"},
            line={"width": 0.5, "color": "rgba(255,255,255,.55)"},
            colorbar={"title": {"text": "corrected error [A]", "side": "right"}, "thickness": 10, "len": 0.95,
                      "outlinewidth": 0, "tickvals": [float(np.log10(max(tick, _LEAST_A))) for tick in ticks],
                      "ticktext": [f"{tick:.3g}" for tick in ticks]},
            customdata=landscape.error_A, showlegend=False, name="",
            hovertemplate=f"{FAULTS[x].name} %{{x:.3f}}, {FAULTS[y].name} %{{y:.3f}}: "
                          "corrected error %{customdata:.4g} A",
        )
    )  # fmt: skip
    if marks.interval90 is not None:
        _box(drawn, marks.interval90[x], marks.interval90[y])
    for name, k in (marks.ends or {}).items():
        _point(drawn, k[x], k[y], f"{algorithm_title(name)} ended", "circle", colour(name), 11, "#ffffff")
    if marks.truth is not None:
        _point(drawn, marks.truth[x], marks.truth[y], "truth", "cross", TRUTH, 12, "#ffffff")
    _point(drawn, marks.answer[x], marks.answer[y], "answer, 90 %", "circle-open", _ANSWER, 15, _ANSWER, 2.5)
    drawn.update_xaxes(range=[landscape.across[0], landscape.across[-1]], constrain="domain")
    drawn.update_yaxes(range=[landscape.upwards[0], landscape.upwards[-1]])
    drawn.update_layout(margin={"b": 74, "r": 8, "t": 34})
    return drawn


def axis_title(k: int) -> str:
    """k has no unit; its name and what it means."""
    return f"{FAULTS[k].label} [–]"


def round_values(low: float, high: float) -> list[float]:
    """Round numbers between two positive ones, for an axis of logarithms."""
    low, high = max(low, _LEAST_A), max(high, _LEAST_A)
    decades = range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
    found = [step * 10.0**decade for decade in decades for step in _STEPS]
    inside = [value for value in found if low <= value <= high]
    while len(inside) > _MOST_TICKS:
        inside = inside[:: len(_STEPS)]  # of many decades, one each
    return inside if len(inside) > 1 else [low, high]


def _point(
    drawn: go.Figure, x: float, y: float, name: str, symbol: str, fill: str, size: int, edge: str, width: float = 1.2
) -> None:
    drawn.add_trace(
        go.Scatter(
            x=[x], y=[y], mode="markers", name=name, cliponaxis=False,
            marker={"symbol": symbol, "color": fill, "size": size, "line": {"color": edge, "width": width}},
            hovertemplate=f"{name}: %{{x:.3f}}, %{{y:.3f}}<extra></extra>",
        )
    )  # fmt: skip


def _box(drawn: go.Figure, across: Array, upwards: Array) -> None:
    """The 90 % intervals of the two k."""
    drawn.add_shape(
        type="rect", x0=across[0], x1=across[1], y0=upwards[0], y1=upwards[1],
        line={"color": _ANSWER, "width": 1.5, "dash": "dot"}, fillcolor="rgba(194,37,92,0.10)",
    )  # fmt: skip
