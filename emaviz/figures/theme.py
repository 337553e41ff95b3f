"""What all figures share: colours, lines, bins, gaps, bands and SVG."""

from __future__ import annotations

import html
import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import ArrayLike, NDArray

from ema_model.estimation.noise import BAND_SIGMAS
from ema_model.quantities import Quantity, number, round_numbers
from emaviz.colours import COMMAND, DIFFERENCE, LIMIT, MONITOR, REFERENCE
from emaviz.text.html import Html, html_escape, unescaped

# --- how all figures of a comparison look, on light and on dark: one template each, margins, legends, shading ---------

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


# --- a chart as inline SVG, for pages without a script ----------------------------------------------------------------
# A chart as inline SVG, for pages without a script; its ink is the page's, so that it is read on light and dark.

Array = NDArray[np.float64]

_WIDTH, _HEIGHT = 460, 270
_LEFT, _RIGHT, _TOP, _BOTTOM = 58, 14, 26, 40
_AIR = 0.05  # of the range, above and below what is drawn
_TICKS = 6
_TURN_STEPS = (1.0, 2.0, 5.0, 10.0, 15.0, 30.0, 60.0, 90.0, 180.0, 360.0, 3600.0, 36000.0)  # degrees


@dataclass(frozen=True, eq=False)
class Series:
    """Points in SI units, (n,) each, joined by a line or each for itself."""

    name: str
    colour: str
    x: Array
    y: Array
    joined: bool = True


def chart(title: str, x: Quantity, y: Quantity, series: Sequence[Series], least: float = 0.0, style: str = "") -> Html:
    """One chart with its axes' titles and units, what comes first lying below.

    least: the half width of y's range, in its SI unit, that a line which hardly moves is drawn in; style: in CSS.
    Raises ValueError for points that are not finite.
    """
    across = np.concatenate([one.x for one in series])
    up = np.concatenate([one.y for one in series])
    if not (np.all(np.isfinite(across)) and np.all(np.isfinite(up))):
        raise ValueError(f"{title}: not all points are finite")
    x, y = x.scaled(across), y.scaled(max(float(np.max(np.abs(up))), least))
    horizontal = _Axis(x.factor * across.min(), x.factor * across.max(), _LEFT, _WIDTH - _RIGHT, x.unit == "°")
    low, high = min(up.min(), -least), max(up.max(), least)
    air = _AIR * (high - low)
    vertical = _Axis(y.factor * (low - air), y.factor * (high + air), _HEIGHT - _BOTTOM, _TOP)
    parts = [_grid(horizontal, vertical), _titles(title, x, y)]
    parts += [_drawn(one, horizontal.at(x.factor * one.x), vertical.at(y.factor * one.y)) for one in series]
    return unescaped(
        f'<svg viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img" aria-label="{html_escape(title)}" style="{style}" '
        f'fill="currentColor" font-size="12" font-family="system-ui,sans-serif">{"".join(parts)}</svg>'
    )


def svg_number(value: float) -> str:
    """A round number, without zeros at its end: 0.05, 3·10⁻⁵."""
    mantissa, dot, power = number(value, 4).partition("·")
    return (mantissa.rstrip("0").rstrip(".") if "." in mantissa else mantissa) + dot + power


@dataclass(frozen=True)
class _Axis:
    """From low to high, in the shown unit, between two places in pixels."""

    low: float
    high: float
    start: float
    end: float
    is_turn: bool = False  # in degrees

    def at(self, value: Array) -> Array:
        return self.start + (self.end - self.start) * (value - self.low) / ((self.high - self.low) or 1.0)

    @property
    def ticks(self) -> list[float]:
        """Round numbers; parts of a turn where these are degrees."""
        return round_numbers(self.low, self.high, _TICKS, _TURN_STEPS if self.is_turn else ())


def _grid(x: _Axis, y: _Axis) -> str:
    lines, texts = [], []
    for value in x.ticks:
        at = float(x.at(np.array(value)))
        lines.append(f"M{at:.1f} {y.start:g}V{y.end:g}")
        texts.append(_text(at, y.start + 15, svg_number(value), "middle"))
    for value in y.ticks:
        at = float(y.at(np.array(value)))
        lines.append(f"M{x.start:g} {at:.1f}H{x.end:g}")
        texts.append(_text(x.start - 6, at + 4, svg_number(value), "end"))
    zero = f"M{x.start:g} {float(y.at(np.array(0.0))):.1f}H{x.end:g}" if y.low <= 0.0 <= y.high else ""
    return (
        f'<path d="{"".join(lines)}" stroke="currentColor" opacity=".15"/>'
        f'<path d="{zero}" stroke="currentColor" opacity=".5"/>{"".join(texts)}'
    )


def _titles(title: str, x: Quantity, y: Quantity) -> str:
    middle = (_TOP + _HEIGHT - _BOTTOM) / 2
    return (
        _text(_LEFT, 15, title, "start", 'font-weight="600" font-size="13"')
        + _text((_LEFT + _WIDTH - _RIGHT) / 2, _HEIGHT - 8, x.label, "middle")
        + _text(13, middle, y.label, "middle", f'transform="rotate(-90 13 {middle:g})"')
    )


def _drawn(one: Series, x: Array, y: Array) -> str:
    if one.joined:
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y))
        return f'<polyline points="{points}" fill="none" stroke="{one.colour}" stroke-width="1.4"/>'
    dots = "".join(f"M{a:.1f} {b:.1f}h0" for a, b in zip(x, y))
    return f'<path d="{dots}" stroke="{one.colour}" stroke-width="3" stroke-linecap="round" opacity=".75"/>'


def _text(x: float, y: float, text: str, anchor: str, more: str = "") -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" {more}>{html_escape(text)}</text>'


# --- long lines for figures: few points, every spike kept, gaps left open ---------------------------------------------

Single = NDArray[np.float32]  # half the size, and finer than any screen

_GAP = 5.0  # median steps of x without a point: a gap, over which no line is drawn


def stretches(x: Array, known: NDArray[np.bool_], most: int) -> list[NDArray[np.intp]]:
    """Places of each unbroken stretch of known points; all of them as one where there were more than `most`.

    A stretch ends where a point is not known, where x goes back, and where it leaps.
    """
    places = np.flatnonzero(known)
    if len(places) < 2:
        return [places] if len(places) else []
    steps = np.diff(x[places])
    usual = float(np.median(steps[steps > 0.0])) if np.any(steps > 0.0) else 0.0
    broken = (np.diff(places) > 1) | (steps <= 0.0) | (steps > _GAP * usual)
    parts = np.split(places, np.flatnonzero(broken) + 1)
    return parts if len(parts) <= most else [places]


def line(x: Array, y: Array, points: int) -> tuple[Single, Single]:
    """x and y (n,) with at most `points` values: the same envelope, NaN between stretches.

    What is not finite is left out.
    """
    xs, ys = [], []
    for at_x, at_y in _decimated(x, [y], points):
        xs += [at_x, [np.nan]]
        ys += [at_y, [np.nan]]
    return _joined(xs[:-1]), _joined(ys[:-1])


def band(x: Array, low: Array, high: Array, points: int) -> tuple[Single, Single]:
    """The outline of the band between low and high, to be filled "toself"; at most `points` values."""
    xs, ys = [], []
    for at_x, at_low, at_high in _decimated(x, [low, high], points // 2):
        # the lower edge's lows and the upper edge's highs: pairs of a bucket would draw teeth
        xs += [at_x, at_x[::-1], [np.nan]]
        ys += [at_high, at_low[::-1], [np.nan]]
    return _joined(xs[:-1]), _joined(ys[:-1])


def _decimated(x: Array, series: Sequence[Array], points: int) -> list[tuple[Array, ...]]:
    known = np.isfinite(x) & np.all(np.isfinite(series), axis=0)
    parts = stretches(x, known, max(1, points // 8))
    total = sum(map(len, parts))
    if total + len(parts) > points:
        left = points - 3 * len(parts)  # a gap each, and two points at least
        shares = [max(2, int(left * len(part) / total)) for part in parts]
    else:
        shares = [len(part) for part in parts]
    return [
        envelope(x[part], [one[part] for one in series], share) if len(part) > share else (x[part], *_at(series, part))
        for part, share in zip(parts, shares, strict=True)
    ]


def _at(series: Sequence[Array], part: NDArray[np.intp]) -> tuple[Array, ...]:
    return tuple(one[part] for one in series)


def _joined(parts: Sequence[Array | list[float]]) -> Single:
    with np.errstate(over="ignore"):  # of a model that diverges, which no chart can show
        return np.asarray(np.concatenate(parts) if parts else [], dtype=np.float32)


def scattered(x: Array, y: Array, points: int) -> NDArray[np.intp]:
    """Which of the points (n,) to draw as a cloud: lowest and highest of each slice of x, and others evenly."""
    known = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
    if len(known) <= points:
        return known
    order = known[np.argsort(x[known], kind="stable")]
    slices = np.array_split(order, max(1, points // 4))
    extremes = np.array([place for part in slices for place in (part[np.argmin(y[part])], part[np.argmax(y[part])])])
    # Drawn at random, because even steps could beat against a periodic motion.
    others = np.random.default_rng(0).choice(known, points - len(extremes), replace=False)
    return np.union1d(extremes, others)


# --- the mean of a residual in bins of a variable ---------------------------------------------------------------------
# The mean of a residual in bins of a variable, with an error that neighbouring blocks cannot make too small.

_FEWEST = 5  # blocks in a bin


@dataclass(frozen=True, eq=False)
class Binned:
    """All arrays are (bins,); bins with too few blocks are left out."""

    low: Array
    high: Array
    centre: Array  # mean of the variable there
    mean: Array
    error: Array  # standard error of the mean
    floor: Array  # rms of what a perfect model would leave in a block
    block_count: NDArray[np.intp]


def binned(x: Array, residual: Array, sigma: Array, edges: Array) -> Binned:
    """Blocks (n,) in the order of time, over the bins between edges (bins + 1,).

    Blocks that follow each other share their errors: the standard error is taken over visits to a bin, each an
    unbroken stay there, and never less than the blocks' own scatter gives.
    """
    known = np.isfinite(x) & np.isfinite(residual) & np.isfinite(sigma)
    x, residual, sigma = x[known], residual[known], sigma[known]
    count = len(edges) - 1
    place = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, count - 1)
    blocks = np.bincount(place, minlength=count)
    many = np.maximum(blocks, 1)

    def mean(values: Array) -> Array:
        return np.bincount(place, values, count) / many

    means = mean(residual)
    left = residual - means[place]
    visit = np.concatenate([[0], np.cumsum(np.diff(place) != 0)]) if len(place) else np.zeros(0, int)
    sums = np.bincount(visit, left)
    home = place[np.concatenate([[True], np.diff(visit) > 0])] if len(place) else place
    visits = np.bincount(home, minlength=count)
    spread = np.bincount(home, sums**2, count) / np.maximum(1.0 - 1.0 / np.maximum(visits, 2), 0.5)
    # of one visit alone the sum is zero by its own mean: there only the scatter is known
    error = np.sqrt(np.maximum(spread, np.bincount(place, left**2, count))) / many
    used = blocks >= _FEWEST
    return Binned(
        edges[:-1][used],
        edges[1:][used],
        mean(x)[used],
        means[used],
        error[used],
        np.sqrt(mean(sigma**2))[used],
        blocks[used],
    )


def edges_for(variable: str, x: Array) -> Array:
    """Bins that suit a variable: even ones over a turn or over time, else as many blocks in each."""
    x = x[np.isfinite(x)]
    if variable == "motor_angle":
        # fine enough for cogging of many teeth where there are blocks enough
        return np.linspace(0.0, 2.0 * np.pi, int(np.clip(len(x) // 25, 12, 180)) + 1)
    if variable == "time":
        return np.linspace(np.min(x), np.max(x), 41)
    distinct = np.unique(x) if len(x) < 200_000 else np.unique(x[:: len(x) // 100_000])
    if len(distinct) <= 16:  # a load that was set in steps: a bin each
        middle = 0.5 * (distinct[1:] + distinct[:-1])
        return np.concatenate([[distinct[0] - 1e-9], middle, [distinct[-1] + 1e-9]])
    return np.unique(np.quantile(x, np.linspace(0.0, 1.0, 29)))


# --- an axis about zero that a few values, as those of a start, would set for all the others --------------------------
# An axis about zero that a few values, as those of a start, would set for all the others: it is cut, and says so.

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


def cut_note(end: float, values: ArrayLike, unit: str) -> str:
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
        text=cut_note(end, values, unit), x=1.0, xref="x domain", xanchor="right", y=1.0, yref="y domain",
        yanchor="bottom", showarrow=False, font={"size": 10}, **where,
    )  # fmt: skip


# --- fewer points with the same envelope, for charts ------------------------------------------------------------------


def envelope(x: Array, series: Sequence[Array], points: int = 1000) -> tuple[Array, ...]:
    """x and the series with at most `points` samples: each bucket's minimum and maximum, in their order.

    All arrays are (n,); the result's are equally long.  Short ones come back as they are.
    """
    n = len(x)
    buckets = points // 2
    if n <= 2 * buckets:
        return (x, *series)
    edges = np.linspace(0, n, buckets + 1).astype(int)
    low = edges[:-1]
    places = np.stack([low, (low + edges[1:]) // 2], axis=1).ravel()
    out = [x[places]]
    for y in series:
        least, most = np.minimum.reduceat(y, low), np.maximum.reduceat(y, low)
        rising = y[low] <= y[edges[1:] - 1]
        out.append(np.stack([np.where(rising, least, most), np.where(rising, most, least)], axis=1).ravel())
    return tuple(out)


# --- the band in which a perfect model would lie, drawn below a residual and its edges above it -----------------------

_LEGEND = {"name": FLOOR_NAME, "legendgroup": "floor", "hoverinfo": "skip", "mode": "lines"}


def outlined(chart: go.Figure, x: NDArray, y: NDArray) -> None:
    """Fills a closed outline, in the units of the axes."""
    chart.add_trace(go.Scatter(x=x, y=y, fill="toself", fillcolor=FLOOR, line={"width": 0}, **_LEGEND))


def below(chart: go.Figure, time: NDArray, half: NDArray) -> None:
    """± half about zero over time; all are (samples,)."""
    outlined(chart, *band(time, -half, half, POINTS))


def above(chart: go.Figure, time: NDArray, half: NDArray) -> None:
    """The edges once more, because dense noise hides the band below it."""
    for edge in (-half, half):
        x, y = line(time, edge, POINTS // 2)
        drawn = {"width": 1.4, "color": EDGE}
        chart.add_trace(go.Scatter(x=x, y=y, line=drawn, showlegend=False, **_LEGEND))
