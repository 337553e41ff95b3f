"""Figures of an identification: faults with intervals, convergence, the swarm, the landscape, the fit."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import plotly.graph_objects as go
import viser
from numpy.typing import ArrayLike, NDArray

from ema_model.actuator import Actuator
from ema_model.actuator.actuator import between, sentences
from ema_model.faults import FAULTS, HEALTHY, NAMES
from ema_model.identification.run import ROBUST, algorithm_title
from ema_model.identification.search import Landscape, Objective
from ema_model.quantities import Axes, number
from ema_model.recordings import Measurement
from emaviz.colours import ALGORITHMS, COMMAND, DIFFERENCE, FAULT, MONITOR, REFERENCE, TRUTH
from emaviz.colours import MONITOR_SHADES as SHADES
from emaviz.figures import theme
from emaviz.figures.lines import Lines, LiveLines
from emaviz.figures.runs import AXIS, CURSOR, LAST_MORE_PX, PADDING, PLANT_LINE, charts, legend, time_axis, value_axis
from emaviz.figures.theme import line
from emaviz.text.html import Html, add_html, html, html_escape, joined, unescaped

# --- k1…k8 as dots with whiskers about the healthy value, in HTML that the app and reports share ----------------------

_LEAST_LIMIT = 1e-9
_ECCENTRICITY, _PHASE = 5, 6
_FAULT_BARS_INK = "currentColor"


def fault_bars(
    k: ArrayLike,
    actuator: Actuator,
    truth: ArrayLike | None = None,
    interval90: ArrayLike | None = None,
    alarms: tuple[str, ...] = (),
    detectable: ArrayLike | None = None,
    adequate: bool = True,
) -> Html:
    """A row for each k (8,) on an axis of 0 … 1: the healthy value, a dot, its whisker, the limit of detection, words.

    interval90: (8, 2), there once the search has ended; detectable: (8,), distance from healthy where an alarm begins;
    adequate: whether the model fits, without which nothing is said of any fault.
    """
    k = np.asarray(k, dtype=float)
    ends = None if interval90 is None else np.asarray(interval90, dtype=float)
    limits = np.full(len(FAULTS), np.nan) if detectable is None else np.asarray(detectable, dtype=float)
    phrases = sentences(k, actuator) if ends is None else between(k, ends, actuator)
    rows = []
    for i, (fault, phrase) in enumerate(zip(FAULTS, phrases)):
        told = fault.name in alarms or (i == _PHASE and FAULTS[_ECCENTRICITY].name in alarms)
        marks = [
            _limit(HEALTHY[i], limits[i]),
            _fault_bars_box(HEALTHY[i] - 0.002, 0.004, 0, 18, _FAULT_BARS_INK, 0.35),
        ]
        if truth is not None:
            marks.append(_fault_bars_box(np.asarray(truth)[i] - 0.004, 0.008, 1, 16, TRUTH, 1.0))
        unknown = i == _PHASE and ends is not None and not told
        if ends is not None and not unknown:
            low, high = ends[i]
            marks.append(_fault_bars_box(low, max(high - low, 0.004), 8, 2, _FAULT_BARS_INK, 0.85))
        if not unknown:
            marks.append(_dot(k[i], FAULT if told else _FAULT_BARS_INK))
        words = phrase if ends is None or told else _unseen(i, ends[i], phrase, adequate)
        rows.append(
            html(
                '<tr title="{}">'
                '<td style="width:1%;white-space:nowrap;padding:1px 12px 1px 0"><b>{}</b> {}</td>'
                '<td style="width:30%"><div style="position:relative;height:18px;background:#8686861c;'
                'border-radius:3px">{}</div></td>'
                '<td style="width:1%;text-align:right;padding:0 6px 0 12px;font-variant-numeric:tabular-nums">{}</td>'
                '<td style="font-size:11.5px;{}">{}</td>'
                "</tr>",
                _values(i, k[i], None if ends is None else ends[i], limits[i]),
                fault.name,
                fault.title,
                joined(marks),
                "–" if unknown else f"{k[i]:.3f}",
                "font-weight:600" if told else "opacity:.8",
                words,
            )
        )
    legend = html("● identified")
    legend += html(' &nbsp;<span style="color:{}">●</span> fault', FAULT) if alarms else ""
    legend += html(' &nbsp;<span style="color:{}">▮</span> truth', TRUTH) if truth is not None else ""
    legend += html(" &nbsp;━ 90 % interval") if ends is not None else ""
    legend += html(" &nbsp;│ healthy")
    legend += html(" &nbsp;▒ below the detection limit") if detectable is not None else ""
    return html(
        '<div style="padding:0 8px;font-size:12px"><table class="faults" style="width:100%;border-collapse:collapse">'
        '{}</table><div style="opacity:.7;font-size:11px;padding-top:4px">{}</div></div>',
        joined(rows),
        legend,
    )


def _values(index: int, k: float, ends: np.ndarray | None, limit: float) -> str:
    """What the row draws, in numbers, for the cursor."""
    said = [f"{FAULTS[index].name} = {k:.4f}"]
    if ends is not None:
        said.append(f"90 % interval {ends[0]:.4f} … {ends[1]:.4f}")
    said.append(f"healthy {HEALTHY[index]:g}")
    if limit > _LEAST_LIMIT:
        said.append(f"a change below {limit:.2g} cannot be seen")
    return ", ".join(said)


def _unseen(index: int, ends: np.ndarray, phrase: str, adequate: bool) -> str:
    """What is said of a k that has no alarm of its own."""
    name = FAULTS[index].name
    if not adequate:
        return "not identifiable: the model does not fit"
    if index == _PHASE:
        return "no angle without an eccentricity"
    if HEALTHY[index] == 0.0:
        return f"no fault seen ({name} < {number(_rounded_up(float(ends[1])), 2)})"
    return f"no fault seen ({phrase})"


def _rounded_up(value: float) -> float:
    """To two digits, and no less than what the bars can show."""
    value = max(value, 1e-3)
    step = 10.0 ** (np.floor(np.log10(value)) - 1)
    return float(np.ceil(value / step - 1e-9) * step)


def _limit(healthy: float, limit: float) -> Html:
    """The band about the healthy value in which a fault gives no alarm."""
    if not limit > _LEAST_LIMIT:
        return Html()
    low, high = max(healthy - limit, 0.0), min(healthy + limit, 1.0)
    return _fault_bars_box(low, high - low, 3, 12, "#868686", 0.45)


def _dot(value: float, colour: str) -> Html:
    return html(
        '<div style="position:absolute;left:calc({:.2f}% - 4px);top:5px;width:8px;height:8px;border-radius:50%;'
        'background:{}"></div>',
        100.0 * float(np.clip(value, 0.0, 1.0)),
        colour,
    )


def _fault_bars_box(left: float, width: float, top: int, height: int, colour: str, opacity: float) -> Html:
    left, right = np.clip([left, left + width], 0.0, 1.0)
    return html(
        '<div style="position:absolute;left:{:.2f}%;width:{:.2f}%;top:{}px;'
        'height:{}px;background:{};opacity:{};border-radius:1px"></div>',
        100.0 * left,
        100.0 * (right - left),
        top,
        height,
        colour,
        opacity,
    )


# --- identifications in numbers, a row each: error, time, simulations, performance coefficient ------------------------

_MISSING = "–"
_NUMBER = Html('style="text-align:right;padding:1px 4px"')


@dataclass(frozen=True)
class Row:
    """One optimiser's answer."""

    race: int  # number of the race it ran in
    source: str
    algorithm: str
    population: int
    iterations: int
    fitness: str
    seed: int
    error_percent: float | None  # T 5.2, where the truth is known
    rmse_A: float  # uncorrected
    evaluations: int
    elapsed_s: float  # of this optimiser alone, without compilation
    performance: float | None  # %, T 5.4, over the optimisers of its race
    stopped: bool = False
    corrected_A: float | None = None  # by one fit for its race; none of a row that an earlier version saved


def table(rows: Sequence[Row]) -> Html:
    """HTML, the newest race first."""
    if not rows:
        return html(
            '<div style="padding:6px 12px;font-size:13px;line-height:1.5">Nothing has been identified yet.'
            '<div style="opacity:.75">Press <b>Identify</b> on the left. Each algorithm of each run then has a row '
            "here: error of k [%] where the faults are known, corrected error of the current [A], time [s], number of "
            "simulations, and the performance coefficient [%], which compares algorithms that ran together.</div></div>"
        )
    heads = ("", "Err [%]", "corrected error [A]", "time [s]", "simulations", "PC [%]")
    head = joined(html("<th {}>{}</th>", _NUMBER, name) for name in heads)
    body = []
    for race in sorted({row.race for row in rows}, reverse=True):
        mine = [row for row in rows if row.race == race]
        first = mine[0]
        said = (
            f"{race}: {first.source} · population {first.population}, {first.iterations} iterations, "
            f"{first.fitness}, seed {first.seed}"
        )
        body.append(html('<tr><td colspan="6" style="padding-top:8px;opacity:.75">{}</td></tr>', said))
        body += [_row(row) for row in mine]
    return html(
        '<div style="padding:4px 10px;font-size:12.5px;font-variant-numeric:tabular-nums">'
        '<table style="width:100%;border-collapse:collapse"><tr>{}</tr>{}</table>'
        '<div style="font-size:11px;opacity:.7;padding-top:8px">Err: the thesis’s equation 5.2, if the truth is known. '
        "Corrected error: rms of measured less model current, with what the simplified model is known to lack added. "
        "Time: of the optimiser alone. PC: its performance coefficient, 5.4, 100 (1 − Err·t / Σ Err·t) over the "
        "optimisers of one race; higher is better.</div></div>",
        head,
        joined(body),
    )


def _row(row: Row) -> Html:
    cells = (
        _MISSING if row.error_percent is None else f"{row.error_percent:.2f}",
        _MISSING if row.corrected_A is None else f"{row.corrected_A:.4f}",
        f"{row.elapsed_s:.2f}",
        f"{row.evaluations}",
        _MISSING if row.performance is None else f"{row.performance:.1f}",
    )
    stopped = " (stopped)" if row.stopped else ""
    return html(
        "<tr><td>{}{}</td>{}</tr>",
        named(row.algorithm),
        stopped,
        joined(html("<td {}>{}</td>", _NUMBER, cell) for cell in cells),
    )


# --- the live chart of identifications: the best error of each iteration, all optimisers in one plot ------------------
# While they search it is the simplified model's own; once all have ended, what that model is known to lack is added.

_CONVERGENCE_LEAST_A = 1e-9  # a logarithmic axis has no zero


class LiveConvergence:
    """Error against iteration, logarithmic; an optimiser that has ended keeps its level."""

    def __init__(self, gui: viser.GuiApi, height: int = 200) -> None:
        self._algorithms: tuple[str, ...] = ()
        self._iterations = 150
        self._corrected = False
        self._legend: Any = add_html(gui)
        self.handle: Any = gui.add_uplot(
            data=(np.array([0.0, 1.0]), np.array([1.0, 1.0])),
            series=({"label": "iteration"}, _UNSEEN),
            title="Convergence",
            scales=_convergence_scales(150),
            axes=_axes(False),
            legend={"show": False},
            padding=(PADDING[0], 14, *PADDING[2:]),  # half of the last number
            height=height,
        )

    def begin(self, algorithms: Sequence[str], iterations: int) -> None:
        """A new race: its colours and the length of its axis, which build the chart anew."""
        if tuple(algorithms) != self._algorithms:
            self._algorithms = tuple(algorithms)
            self.handle.data = (np.array([0.0, 1.0]), *(np.array([1.0, 1.0]) for _ in algorithms))
            self.handle.series = ({"label": "iteration"}, *(_convergence_line(name) for name in algorithms))
            self._legend.content = legend(*((colour(name), _told(name)) for name in algorithms))
        if iterations != self._iterations:
            self._iterations = iterations
            self.handle.scales = _convergence_scales(iterations)

    def show(self, errors: Mapping[str, Sequence[float]], *, corrected: bool) -> None:
        """Draws the errors so far, A, by algorithm, all corrected or none; the last of a fitted answer is its fit."""
        if tuple(errors) != self._algorithms:
            return
        if corrected != self._corrected:
            self._corrected = corrected
            self.handle.axes = _axes(corrected)
        count = max([2, *map(len, errors.values())])
        lines = [_to_length(values, count) for values in errors.values()]
        self.handle.data = (np.arange(count, dtype=float), *lines)


def colour(algorithm: str) -> str:
    """The algorithm's own colour; the monitor's for one without."""
    return ALGORITHMS.get(algorithm, MONITOR)


def named(algorithm: str) -> Html:
    """The algorithm's name behind a mark of its colour, in which text would be hard to read on dark or on light."""
    return html('<span style="color:{}">●</span> <b>{}</b>', colour(algorithm), algorithm_title(algorithm))


def _told(algorithm: str) -> str:
    """In the legend: what rises has a reason."""
    if algorithm != ROBUST:
        return algorithm_title(algorithm)
    return f"{algorithm_title(algorithm)}: ranks by all signals, so that this may rise; the last is its fit"


def _to_length(errors: Sequence[float], count: int) -> np.ndarray:
    """The last value goes on: it stays the best."""
    values = np.asarray(errors if len(errors) else [1.0], dtype=float)
    values = np.maximum(np.where(np.isfinite(values), values, 1e3), _CONVERGENCE_LEAST_A)
    return np.concatenate([values, np.full(count - len(values), values[-1])])


def _convergence_line(algorithm: str) -> Any:
    return {"label": f"{algorithm} [A]", "stroke": colour(algorithm), "width": 2, "points": {"show": False}}


_UNSEEN: Any = {**_convergence_line(""), "stroke": "#00000000"}  # before anything is searched


def error_title(corrected: bool) -> str:
    """Of an axis of errors, A."""
    return f"{'Corrected' if corrected else 'Uncorrected'} error of the best [A]"


def _axes(corrected: bool) -> Any:
    return {**AXIS, "label": "Iteration", "size": 30}, {**AXIS, "label": error_title(corrected), "size": 56}


def _convergence_scales(iterations: int) -> Any:
    """With a place for the answer, behind the last iteration."""
    return {"x": {"time": False, "range": (0.0, iterations + 1.0)}, "y": {"distr": 3}}


# --- a swarm of candidates as it converges: in the plane of two k, or as lines across all eight; SVG in HTML ----------

Floats = NDArray[np.floating]

_WIDTH, _PLANE_HEIGHT, _LINES_HEIGHT = 460, 572, 572  # as fills a column of a usual window
_SWARM_LEFT, _RIGHT, _TOP, _BOTTOM = 44, 14, 10, 36
_MOST_DRAWN = 150  # candidates of one swarm
# of a window: with what stands above and below it, the picture is seen whole
_FITS = "max-height:calc(100vh - 335px);min-height:200px"
_SWARM_INK = 'fill="currentColor"'


@dataclass(frozen=True, eq=False)
class Swarm:
    """One optimiser's candidates, in its colour."""

    name: str
    colour: str
    population: Floats  # (n, 8)
    best: Floats  # (8,)


def plane(swarms: Sequence[Swarm], x: int, y: int, truth: Floats | None = None, trails: Sequence[Floats] = ()) -> Html:
    """Candidates as points over k number x and y (0 … 7); ringed: the best; cross: the truth.

    trails: for each swarm the way of its best, (m, 8).
    """
    right, low = _WIDTH - _RIGHT, _PLANE_HEIGHT - _BOTTOM

    def at(k: Floats) -> tuple[Floats, Floats]:
        k = np.atleast_2d(k)
        return _SWARM_LEFT + (right - _SWARM_LEFT) * k[:, x], low - (low - _TOP) * k[:, y]

    parts = [_grid(right, low)]
    parts.append(_text((_SWARM_LEFT + right) / 2, _PLANE_HEIGHT - 4, f"{FAULTS[x].label} [–]", "middle"))
    turned = f'transform="rotate(-90 12 {(_TOP + low) / 2:.0f})"'
    parts.append(_text(12, (_TOP + low) / 2, f"{FAULTS[y].label} [–]", "middle", turned))
    for swarm, trail in zip(swarms, trails):
        if len(trail) > 1:
            points = " ".join(f"{px:.1f},{py:.1f}" for px, py in zip(*at(trail)))
            parts.append(
                f'<polyline points="{points}" fill="none" stroke="{swarm.colour}" stroke-width="1.4" opacity=".6"/>'
            )
    for swarm in swarms:
        dots = "".join(f"M{px:.1f} {py:.1f}h0" for px, py in zip(*at(swarm.population[:_MOST_DRAWN])))
        parts.append(
            f'<path d="{dots}" stroke="{swarm.colour}" stroke-width="5" stroke-linecap="round" opacity=".55"/>'
        )
    for swarm in swarms:
        (px,), (py,) = at(swarm.best)
        parts.append(
            f'<circle cx="{px:.1f}" cy="{py:.1f}" r="7" fill="none" stroke="{swarm.colour}" stroke-width="2.5"/>'
        )
    if truth is not None:
        (px,), (py,) = at(truth)
        parts.append(
            f'<path d="M{px - 9:.1f} {py:.1f}h18M{px:.1f} {py - 9:.1f}v18" stroke="{TRUTH}" stroke-width="2.5"/>'
        )
    return _picture(parts, _PLANE_HEIGHT) + _key(
        "● candidates", "◯ best, with its path", "✚ true value" if truth is not None else ""
    )


def lines(swarms: Sequence[Swarm], truth: Floats | None = None) -> Html:
    """Candidates as lines across eight upright axes, 0 below and 1 above; bold: the best; green: the truth."""
    low = _LINES_HEIGHT - _BOTTOM - 8
    xs = np.linspace(_SWARM_LEFT, _WIDTH - _RIGHT - 12, len(NAMES))

    def way(k: Floats) -> str:
        ys = low - (low - _TOP) * np.asarray(k, dtype=float)
        return "M" + "L".join(f"{px:.0f} {py:.1f}" for px, py in zip(xs, ys))

    parts = []
    for px, fault in zip(xs, FAULTS):
        parts.append(f'<path d="M{px:.0f} {_TOP}V{low}" stroke="currentColor" opacity=".25"/>')
        parts.append(_text(px, low + 15, fault.name, "middle", 'font-weight="600"'))
        parts.append(_text(px, low + 29, _SHORT[fault.name], "middle", 'opacity=".7" font-size="10"'))
    for value in (0.0, 0.5, 1.0):
        parts.append(_text(_SWARM_LEFT - 8, low - (low - _TOP) * value + 4, f"{value:g}", "end"))
    for swarm in swarms:
        drawn = "".join(way(k) for k in swarm.population[:_MOST_DRAWN])
        parts.append(f'<path d="{drawn}" fill="none" stroke="{swarm.colour}" stroke-width="1" opacity=".28"/>')
    for swarm in swarms:
        parts.append(f'<path d="{way(swarm.best)}" fill="none" stroke="{swarm.colour}" stroke-width="3"/>')
    if truth is not None:
        parts.append(f'<path d="{way(truth)}" fill="none" stroke="{TRUTH}" stroke-width="2.2" stroke-dasharray="6 4"/>')
    return _picture(parts, _LINES_HEIGHT) + _key(
        "thin: candidates", "bold: best", "dashed: true values" if truth is not None else ""
    )


_SHORT = dict(zip(NAMES, ("friction", "backlash", "short A", "short B", "short C", "eccentr.", "its phase", "gain")))


def _grid(right: float, low: float) -> str:
    size = f'width="{right - _SWARM_LEFT}" height="{low - _TOP}"'
    parts = [f'<rect x="{_SWARM_LEFT}" y="{_TOP}" {size} {_SWARM_INK} opacity=".04"/>']
    for value in np.linspace(0.0, 1.0, 6):
        px, py = _SWARM_LEFT + (right - _SWARM_LEFT) * value, low - (low - _TOP) * value
        parts.append(
            f'<path d="M{px:.0f} {_TOP}V{low}M{_SWARM_LEFT} {py:.0f}H{right}" stroke="currentColor" opacity=".12"/>'
        )
        parts.append(_text(px, low + 14, f"{value:g}", "middle"))
        parts.append(_text(_SWARM_LEFT - 5, py + 4, f"{value:g}", "end"))
    return "".join(parts)


def _text(x: float, y: float, text: str, anchor: str, more: str = "") -> str:
    return f'<text x="{x:.0f}" y="{y:.0f}" text-anchor="{anchor}" {_SWARM_INK} {more}>{html_escape(text)}</text>'


def _key(*marks: str) -> Html:
    """What the marks mean; all values are severities without a unit, 0 … 1."""
    return html(
        '<div style="font-size:12px;opacity:.75;text-align:center;padding:2px 8px 6px">{} · severities, 0 … 1</div>',
        " · ".join(mark for mark in marks if mark),
    )


def _picture(parts: Sequence[str], height: int) -> Html:
    """Parts: drawn from numbers and colours of ours, and from `_text`."""
    return unescaped(
        f'<div class="emaviz-picture" style="padding:0 6px"><svg viewBox="0 0 {_WIDTH} {height}" '
        f'width="100%" font-size="11" style="{_FITS}" '
        f'font-family="system-ui,sans-serif">{"".join(parts)}</svg></div>'
    )


# --- the cost over two k: as a map, with the answer, its interval, the truth, and where each search ended -------------


_LANDSCAPE_LEAST_A = 1e-6  # a logarithmic colour has no zero
_STEPS = (1.0, 2.0, 5.0)
_MOST_TICKS = 7
_ANSWER = theme.MARK


@dataclass(frozen=True, eq=False)
class Marks:
    """What stands on the map."""

    answer: Floats  # (8,)
    interval90: Floats | None = None  # (8, 2)
    truth: Floats | None = None  # (8,)
    ends: Mapping[str, Floats] | None = None  # (8,) each, by the search's name


def landscape_figure(landscape: Landscape, marks: Marks, *, dark: bool = False) -> go.Figure:
    """Dark: a low error.  Points off the slice are drawn where their two k are."""
    x, y = landscape.x, landscape.y
    height = np.log10(np.maximum(landscape.error_A, _LANDSCAPE_LEAST_A))
    drawn = theme.new("Cost around the answer", axis_title(x), axis_title(y), dark=dark)
    known = landscape.error_A[np.isfinite(landscape.error_A)]
    ticks = round_values(float(known.min()), float(known.max())) if len(known) else []
    drawn.add_trace(
        go.Contour(
            x=landscape.across, y=landscape.upwards, z=height, connectgaps=False, ncontours=18,
            colorscale="Viridis", contours={"coloring": "heatmap"},
            line={"width": 0.5, "color": "rgba(255,255,255,.55)"},
            colorbar={"title": {"text": "corrected error [A]", "side": "right"}, "thickness": 10, "len": 0.95,
                      "outlinewidth": 0, "tickvals": [float(np.log10(max(tick, _LANDSCAPE_LEAST_A))) for tick in ticks],
                      "ticktext": [f"{tick:.3g}" for tick in ticks]},
            customdata=landscape.error_A, showlegend=False, name="",
            hovertemplate=f"{FAULTS[x].name} %{{x:.3f}}, {FAULTS[y].name} %{{y:.3f}}: "
                          "corrected error %{customdata:.4g} A",
        )
    )  # fmt: skip
    if marks.interval90 is not None:
        _landscape_box(drawn, marks.interval90[x], marks.interval90[y])
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
    low, high = max(low, _LANDSCAPE_LEAST_A), max(high, _LANDSCAPE_LEAST_A)
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


def _landscape_box(drawn: go.Figure, across: Floats, upwards: Floats) -> None:
    """The 90 % intervals of the two k."""
    drawn.add_shape(
        type="rect", x0=across[0], x1=across[1], y0=upwards[0], y1=upwards[1],
        line={"color": _ANSWER, "width": 1.5, "dash": "dot"}, fillcolor="rgba(194,37,92,0.10)",
    )  # fmt: skip


# --- the measured current and the monitor's of each optimiser, live, and what they leave ------------------------------

Array = NDArray[np.float64]
_FITTED_CURRENT_LEFT = "Monitor − measured"


def _fitted_current_line(label: str, drawn: str, width: float = 1.5) -> Any:
    return {"label": label, "stroke": drawn, "width": width, "points": {"show": False}}


def _fitted_current_scales(end: float | None) -> dict[str, Any]:
    """The chart's, whose values end there on either side of zero; None: with the values."""
    return {"x": {"time": False}, "y": {"auto": True} if end is None else {"range": (-end, end)}}


MEASURED: Any = {**PLANT_LINE, "label": "measured"}


class LiveFit(LiveLines):
    """Two charts on one time base: the currents, and monitor − measured, whose axis a start does not set."""

    def __init__(self, gui: viser.GuiApi, height: int = 171) -> None:
        super().__init__()
        empty = np.array([0.0, 1.0])
        self._algorithms: tuple[str, ...] = ()
        self._legend: Any = add_html(gui)
        common: Any = {
            "scales": _fitted_current_scales(None),
            "legend": {"show": False},
            "cursor": CURSOR,
            "padding": PADDING,
        }
        self._currents: Any = gui.add_uplot(
            data=(empty, empty),
            series=({"label": "t [s]"}, MEASURED),
            title="Measured and fitted current",
            axes=(time_axis(False), value_axis("A")),
            height=height,
            **common,
        )
        self._left: Any = gui.add_uplot(
            data=(empty, empty),
            series=({"label": "t [s]"}, _fitted_current_line("left", REFERENCE)),
            title=_FITTED_CURRENT_LEFT,
            axes=(time_axis(True), value_axis("A")),
            height=height + LAST_MORE_PX,
            **common,
        )
        self.handles = [self._currents, self._left]

    def show(
        self,
        time_s: Array,
        measured_A: Array,
        fitted_A: Mapping[str, Array],
    ) -> None:
        """All arrays (blocks,); fitted by algorithm."""
        if not fitted_A:
            return
        if tuple(fitted_A) != self._algorithms:
            self._algorithms = tuple(fitted_A)
            names = [(name, colour(name)) for name in fitted_A]
            blank = np.array([0.0, 1.0])
            self._currents.data = (blank,) * (2 + len(names))
            self._left.data = (blank,) * (1 + len(names))
            self._currents.series = (
                {"label": "t [s]"},
                MEASURED,
                *(_fitted_current_line(name, drawn) for name, drawn in names),
            )
            apart = names if len(names) > 1 else [(names[0][0], DIFFERENCE)]
            self._left.series = ({"label": "t [s]"}, *(_fitted_current_line(name, drawn) for name, drawn in apart))
            self._legend.content = legend(
                (REFERENCE, "measured"), *((drawn, algorithm_title(name)) for name, drawn in names)
            )
        left = [one - measured_A for one in fitted_A.values()]
        fitted = [(algorithm_title(name), colour(name), one) for name, one in fitted_A.items()]
        apart = [(title, drawn, one) for (title, drawn, _), one in zip(fitted, left)]
        both = ("measured", REFERENCE, measured_A), *fitted
        self.draw(
            [
                Lines.of("Measured and fitted current", "A", time_s, *both, difference=(1, 0)),
                Lines.of(_FITTED_CURRENT_LEFT, "A", time_s, *apart),
            ]
        )
        end = theme.end_of(left)
        title = _FITTED_CURRENT_LEFT if end is None else f"{_FITTED_CURRENT_LEFT}, {theme.cut_note(end, left, 'A')}"
        if title != self._left.title:
            self._left.title, self._left.scales = title, _fitted_current_scales(end)


# --- the current that was identified: measured, and the Monitor Model's at the answer, for each run -------------------


def figures(objective: Objective, k: ArrayLike, *, dark: bool = False) -> Iterator[go.Figure]:
    """Two figures a run of the recordings: the currents, and what is left of them; k (8,)."""
    model = objective.currents(k)[0]
    edges = np.cumsum([0, *(window.blocks for window in objective.windows)])
    for window, first, last in zip(objective.windows, edges, edges[1:]):
        measured, fitted = objective.target[first:last], model[first:last]
        name = theme.plain(window.name or "a simulated run")
        chart = theme.new(f"Equivalent current, {name}", "Time [s]", "I_eq [A]", dark=dark)
        _add(chart, window.time_s, measured, "measured", theme.MEASURED)
        _add(chart, window.time_s, fitted, "identified", theme.MODEL)
        yield chart
        chart = theme.new(f"Measured − identified, {name}", "Time [s]", "ΔI_eq [A]", dark=dark)
        _add(chart, window.time_s, measured - fitted, "residual", theme.RESIDUAL)
        theme.cut(chart, measured - fitted, "A")
        yield chart


def _add(chart: go.Figure, time, values, name: str, colour: str) -> None:
    x, y = line(time, values, theme.POINTS)
    chart.add_trace(go.Scatter(x=x, y=y, mode="lines", name=name, line={"color": colour, "width": 1.5}))


# --- the live charts of a fan: three signals, five severities each, from light to dark --------------------------------

_SHOWN = ("current_A", "user_position_rad", "motor_speed_rad_s")


class LiveFan(LiveLines):
    """Charts in a panel of the page; empty, and unseen, until there is a fan."""

    def __init__(self, gui: viser.GuiApi, axes: Axes, height: int = 155) -> None:
        super().__init__()
        self._legend: Any = add_html(gui)
        self._charts: list[tuple[Any, Any]] = []
        empty, shown = np.array([0.0, 1.0]), [one for one in charts(axes) if one.signal in _SHOWN]
        for chart in shown:
            command = ({"label": "command", "stroke": COMMAND, "width": 1, "dash": [4, 4], "points": {"show": False}},)
            series: Any = (
                {"label": "t [s]"},
                *(_fan_line(f"severity {i + 1}", shade) for i, shade in enumerate(SHADES)),
                *(command if chart.with_command else ()),
            )
            last = chart is shown[-1]
            handle = gui.add_uplot(
                data=(empty,) * len(series),
                series=series,
                title=chart.title,
                scales={"x": {"time": False}, "y": {"auto": True}},
                axes=(time_axis(last), value_axis(chart.unit)),
                cursor=CURSOR,
                legend={"show": False},
                padding=PADDING,
                height=height + (LAST_MORE_PX if last else 0),
                visible=False,
            )
            self._charts.append((chart, handle))
        self.handles = [handle for _, handle in self._charts]

    def show(self, labels: Sequence[str], runs: Sequence[Measurement]) -> None:
        """labels: what each run is; both from the mildest to the worst, five."""
        self._legend.content = legend(*zip(SHADES, labels), (COMMAND, "command"))
        every = []
        for chart, handle in self._charts:
            drawn = [(label, shade, chart.scale * one[chart.signal]) for label, shade, one in zip(labels, SHADES, runs)]
            if chart.with_command:
                drawn.append(("command", COMMAND, chart.scale * runs[0]["command_rad"]))
            every.append(Lines.of(chart.title, chart.unit, runs[0].time_s, *drawn, difference=(len(runs) - 1, 0)))
            named = [_fan_line(label, shade) for label, shade in zip(labels, SHADES)]
            if [one.get("label") for one in handle.series[1 : 1 + len(named)]] != list(labels):
                handle.series = (handle.series[0], *named, *handle.series[1 + len(named) :])
            handle.visible = True
        self.draw(every)


def _fan_line(label: str, colour: str) -> Any:
    return {"label": label, "stroke": colour, "width": 1.6, "points": {"show": False}}
