"""How all figures of a comparison look, on light and on dark: one template each, margins, legends, shading."""

from __future__ import annotations

import html
import math
import re
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import plotly.graph_objects as go

from ema_model.estimation.floor import BAND_SIGMAS
from emaviz.colours import COMMAND, DIFFERENCE, LIMIT, MONITOR, REFERENCE

MEASURED = REFERENCE
MODEL = MONITOR
INITIAL = COMMAND
RESIDUAL = DIFFERENCE
HATCHES = {"1": "", "current": "/", "sign_speed": "x"}  # of the residual, by what modulates it
FLOOR = "rgba(134,142,150,0.30)"
EDGE = "#868e96"
SHADE = "rgba(224,49,49,0.16)"
MARK = LIMIT
POINTS = 4000  # of a trace, at most
FLOOR_NAME = f"floor ±{BAND_SIGMAS:g}σ"
_INDEX = re.compile(r"\b(Δ?[A-Za-zθω])_([A-Za-z]+)\b")
_MOST_SHADES = 150
_FONT = "system-ui, 'Segoe UI', Helvetica, Arial, sans-serif"


@dataclass(frozen=True)
class Theme:
    """What differs between light and dark."""

    ink: str
    muted: str
    grid: str
    zero: str
    paper: str

    def template(self) -> go.layout.Template:
        """Fonts, axes and legend; paper and plot are clear, so that the page shines through."""
        axis = {
            "gridcolor": self.grid,
            "zerolinecolor": self.zero,
            "linecolor": self.zero,
            "ticks": "outside",
            "tickcolor": self.zero,
            "ticklen": 4,
            "tickfont": {"size": 11, "color": self.muted},
            "title": {"font": {"size": 12}, "standoff": 5},
            "automargin": True,
            "exponentformat": "SI",
        }
        return go.layout.Template(
            layout={
                "font": {
                    "family": "system-ui, 'Segoe UI', Helvetica, Arial, sans-serif",
                    "size": 12,
                    "color": self.ink,
                },
                "paper_bgcolor": "rgba(0,0,0,0)",
                "plot_bgcolor": "rgba(0,0,0,0)",
                "xaxis": axis,
                "yaxis": {**axis, "nticks": 5},
                "polar": {
                    "bgcolor": "rgba(0,0,0,0)",
                    "angularaxis": {"gridcolor": self.grid, "linecolor": self.zero, "tickfont": {"size": 11}},
                    "radialaxis": {"gridcolor": self.grid, "linecolor": self.zero, "tickfont": {"size": 10}},
                },
                "title": {"font": {"size": 14}, "x": 0.0, "xanchor": "left", "xref": "container"},
                "legend": {"font": {"size": 10, "color": self.ink}, "bgcolor": "rgba(0,0,0,0)"},
                "hoverlabel": {"bgcolor": self.paper, "bordercolor": self.zero, "font": {"color": self.ink}},
                "colorway": [MEASURED, MODEL, RESIDUAL],
            }
        )


LIGHT = Theme(ink="#212529", muted="#495057", grid="rgba(73,80,87,0.15)", zero="rgba(73,80,87,0.55)", paper="#ffffff")
DARK = Theme(
    ink="#e9ecef", muted="#adb5bd", grid="rgba(206,212,218,0.16)", zero="rgba(206,212,218,0.6)", paper="#1a1d21"
)


def new(title: str, x: str, y: str, *, dark: bool = False) -> go.Figure:
    """A figure with its title and its axes' titles; nothing drawn yet."""
    figure = go.Figure()
    figure.update_layout(
        template=(DARK if dark else LIGHT).template(),
        title={"text": f"<b>{plain(title)}</b>", "y": 1.0, "yanchor": "top", "pad": {"t": 6, "l": 8}},
        xaxis={"title": {"text": lowered(plain(x))}},
        yaxis={"title": {"text": lowered(plain(y))}},
        margin={"l": 48, "r": 14, "t": 30, "b": 0},  # below, as axis and legend need: a narrow panel has no more
        # Below the axes: above, its second row would run into the title on a narrow panel.
        legend={
            "orientation": "h",
            "x": 0.02,
            "xref": "container",
            "xanchor": "left",
            "y": 0.0,
            "yref": "container",
            "yanchor": "bottom",
        },
        hovermode="closest",
    )
    return figure


def plain(text: str) -> str:
    """Text that Plotly shows as it is; it takes tags for its own otherwise."""
    return html.escape(text, quote=False)


def lowered(text: str) -> str:
    """A symbol's index set low: 'I_eq [A]' of `plain` text, as Plotly writes it."""
    return _INDEX.sub(r"\1<sub>\2</sub>", text)


def missing(title: str, why: str, *, dark: bool = False) -> go.Figure:
    """A figure that says why there is nothing to draw; where a line has room only, `why_missing` says it."""
    figure = new(title, "", "", dark=dark)
    figure.update_layout(meta={"missing": f"{title}: {why}."})
    figure.update_xaxes(visible=False)
    figure.update_yaxes(visible=False)
    figure.add_annotation(text=plain(why), showarrow=False, x=0.5, y=0.5, xref="paper", yref="paper")
    return figure


def why_missing(figure: go.Figure) -> str:
    """The sentence of a figure in which there is nothing; "" of any other."""
    meta: object = figure.layout["meta"]
    return str(meta["missing"]) if isinstance(meta, dict) and "missing" in meta else ""


def shade(figure: go.Figure, ranges: Iterable[tuple[float, float]], window: tuple[float, float] | None = None) -> None:
    """Shades ranges of x over the whole height, as far as they lie in the window; of very many, neighbours join."""
    first, last = window or (-math.inf, math.inf)
    joined = sorted((max(low, first), min(high, last)) for low, high in ranges if high > first and low < last)
    while len(joined) > _MOST_SHADES:
        gaps = sorted(b[0] - a[1] for a, b in pairwise(joined))
        least = gaps[len(joined) - _MOST_SHADES]
        merged = [joined[0]]
        for low, high in joined[1:]:
            if low - merged[-1][1] <= least:
                merged[-1] = (merged[-1][0], max(high, merged[-1][1]))
            else:
                merged.append((low, high))
        joined = merged
    shapes = [
        {
            "type": "rect",
            "x0": low,
            "x1": high,
            "yref": "y domain",
            "y0": 0,
            "y1": 1,
            "fillcolor": SHADE,
            # a line of its own, so that a range narrower than a pixel is seen
            "line": {"width": 0.5, "color": SHADE},
            "layer": "below",
        }
        for low, high in joined
    ]
    layout: Any = figure.layout
    figure.update_layout(shapes=[*layout.shapes, *shapes])


def moment(figure: go.Figure, x: float | None) -> None:
    """A thin upright line: where the play-head stands."""
    if x is not None:
        figure.add_shape(type="line", x0=x, x1=x, yref="y domain", y0=0, y1=1, line={"width": 1.5, "color": EDGE})
