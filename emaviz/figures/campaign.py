"""Figures of campaigns: errors, effort, convergence, scores."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import plotly.graph_objects as go

from ema_model.actuator.parameters import on_axes
from ema_model.comparison.regions import Region
from ema_model.comparison.result import Comparison
from ema_model.faults import NAMES
from ema_model.quantities import ROTARY, Axes, number, of_signal
from ema_model.recordings import Measurement
from emaviz.colours import ALGORITHMS, CASES, REFERENCE_SHADES
from emaviz.figures import theme
from emaviz.figures.theme import line

# --- how often each answer was given: bars, a row a case, its parts side by side --------------------------------------

_FEW_TASKS = 10


def counted(title: str, counts: Mapping[str, Mapping[str, int]], *, dark: bool = False) -> go.Figure:
    """counts: by case, of each answer."""
    chart = theme.new(title, "Tasks", "", dark=dark)
    cases = list(counts)
    answers = sorted({answer for one in counts.values() for answer in one})  # so that each keeps its colour
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
    chart.update_yaxes(autorange="reversed", tickmode="linear", dtick=1)
    most = max((sum(one.values()) for one in counts.values()), default=0)
    if most <= _FEW_TASKS:
        chart.update_xaxes(tick0=0, dtick=1)  # there are no halves of a task
    return chart


# --- how the errors of many identifications are spread: the share that stays below a value, a line a case -------------

_MOST_POINTS = 400
_DASHES = ("solid", "dash", "dot")  # of the first cases, and of those that come back to their colours


def error_distribution(title: str, x: str, values: Mapping[str, Sequence[float]], *, dark: bool = False) -> go.Figure:
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


# --- mean errors of two sources beside each other, a row a case, a colour an algorithm --------------------------------

Means = Mapping[str, float]  # Err %, by case
_ERRORS_BESIDE_LEAST = 1e-3


def errors_beside(
    title: str,
    ours: Mapping[str, Means],
    theirs: Mapping[str, Means],
    names: Mapping[str, str],
    *,
    dark: bool = False,
) -> go.Figure:
    """By algorithm; ours are filled, the others open.  names: what the legend calls the algorithms."""
    chart = theme.new(title, "Err [%], mean", "", dark=dark)
    for i, algorithm in enumerate(dict.fromkeys([*theirs, *ours])):
        own = ALGORITHMS.get(algorithm, colour(i))
        name = theme.plain(names.get(algorithm, algorithm))
        for means, told, symbol in (
            (theirs.get(algorithm), ", thesis", "circle-open"),
            (ours.get(algorithm), "", "circle"),
        ):
            if not means:
                continue
            marker = {"color": own, "size": 10, "symbol": symbol, "line": {"width": 2, "color": own}}
            chart.add_trace(
                go.Scatter(
                    x=[max(value, _ERRORS_BESIDE_LEAST) for value in means.values()],
                    y=list(means),
                    mode="markers",
                    name=name + told,
                    marker=marker,
                    hovertemplate="%{y}: %{x:.3g} %",
                )
            )
    ticks = [mantissa * 10.0**power for power in range(-3, 3) for mantissa in (1.0, 3.0)]
    chart.update_xaxes(type="log", tickvals=ticks, ticktext=[f"{one:g}" for one in ticks])
    chart.update_yaxes(autorange="reversed", nticks=0)
    return chart


# --- errors of methods beside each other, a row for what they were held to, a colour a method -------------------------


def methods_beside(title: str, errors: Mapping[str, Means], *, dark: bool = False) -> go.Figure:
    """errors: by method, of each row; the first method is drawn large."""
    chart = theme.new(title, "Error, in the row's unit", "", dark=dark)
    for i, (method, its) in enumerate(errors.items()):
        chart.add_trace(
            go.Scatter(
                x=[max(value, _ERRORS_BESIDE_LEAST) for value in its.values()],
                y=[theme.plain(row) for row in its],
                mode="markers",
                name=theme.plain(method),
                marker={"color": colour(i), "size": 13 if i == 0 else 8, "symbol": "circle" if i == 0 else "diamond"},
                hovertemplate="%{y}: %{x:.3g}",
            )
        )
    chart.update_xaxes(type="log")
    chart.update_yaxes(autorange="reversed", nticks=0)
    return chart


# --- how many searches converge: the median of their best errors, and the band that nine of ten keep to ---------------

_CONVERGENCE_BANDS_LEAST = 1e-9  # a logarithmic axis has no zero
_DECADE = 10.0
_TICKS = [mantissa * 10.0**power for power in range(-9, 4) for mantissa in (1.0, 3.0)]


def convergence_bands(
    histories: Mapping[str, Sequence[Sequence[float]]],
    *,
    title: str = "Best error of each iteration",
    y: str = "RMSE [A]",
    names: Mapping[str, str] | None = None,
    dark: bool = False,
) -> go.Figure:
    """histories: y, by algorithm or case, of each search by iteration; one that ended keeps its level.

    names: what the legend calls them, where it is not as they are.
    """
    chart = theme.new(f"{title}: median, and 5 to 95 %", "Iteration", y, dark=dark)
    drawn: list[float] = []
    for i, (name, given) in enumerate(histories.items()):
        length = max(map(len, given))
        whole = np.array([[*one, *[one[-1]] * (length - len(one))] for one in given], dtype=float)
        low, middle, high = np.percentile(np.maximum(whole, _CONVERGENCE_BANDS_LEAST), [5, 50, 95], axis=0)
        drawn += [float(np.min(low)), float(np.max(high))]
        own = ALGORITHMS.get(name, colour(i))
        steps = np.arange(length)
        band = {"line": {"width": 0}, "hoverinfo": "skip", "showlegend": False, "mode": "lines"}
        chart.add_trace(go.Scatter(x=steps, y=high, **band))
        chart.add_trace(go.Scatter(x=steps, y=low, fill="tonexty", fillcolor=_faint(own), **band))
        line = {"color": own, "width": 2}
        chart.add_trace(
            go.Scatter(x=steps, y=middle, mode="lines", name=theme.plain((names or {}).get(name, name)), line=line)
        )
    chart.update_layout(showlegend=len(histories) > 1, legend={"traceorder": "normal"})
    chart.update_yaxes(type="log")
    if drawn and max(drawn) > _DECADE * min(drawn):  # else its own ticks would leave out the powers of ten
        chart.update_yaxes(tickvals=_TICKS, ticktext=[f"{one:g}" for one in _TICKS])
    return chart


def _faint(colour: str) -> str:
    red, green, blue = (int(colour[at : at + 2], 16) for at in (1, 3, 5))
    return f"rgba({red},{green},{blue},0.18)"


# --- how good answers are against how much search they took: medians, and bars from 5 to 95 % -------------------------


class SearchEffort(NamedTuple):
    """x, and Err % of the searches there."""

    x: float
    low: float
    middle: float
    high: float


def search_effort(
    title: str,
    x: str,
    found: Mapping[str, Sequence[SearchEffort]],
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


def _ticks(found: Mapping[str, Sequence[SearchEffort]]) -> list[float]:
    """Where searches were made, as long as that is legible, else round numbers."""
    places = sorted({one.x for points in found.values() for one in points})
    if len(places) <= 6:
        return places
    return [v for v in (100, 300, 1000, 3000, 10_000, 30_000, 100_000) if places[0] / 3 <= v <= 3 * places[-1]]


# --- how far calibration moved each parameter from the actuator's file, in the tolerance's σ, with intervals ----------

_BOUND = 3.0


@dataclass(frozen=True)
class Score:
    """One calibrated parameter."""

    path: str
    title: str
    nominal: float
    value: float
    low: float
    high: float
    unit: str
    z: float
    half: float  # of the interval, in σ; NaN where σ is not known
    at_bound: bool


def scores(comparison: Comparison) -> list[Score]:
    """Parameters of the actuator, and k1 … k8, as calibrated; the recordings' own starts apart."""
    if comparison.calibration is None:
        return []
    found = []
    for path, fitted in comparison.calibration.parameters.items():
        name = path if path in NAMES else on_axes(path, comparison.actuator.axes).title
        low, high = fitted.interval90
        found.append(
            Score(
                path,
                name,
                fitted.initial,
                fitted.value,
                low,
                high,
                fitted.unit,
                fitted.z,
                0.5 * (high - low) / _sigma(comparison, path, fitted.value - fitted.initial, fitted.z),
                fitted.at_bound,
            )
        )
    return found


def _sigma(comparison: Comparison, path: str, moved: float, z: float) -> float:
    tolerance = comparison.actuator.tolerances.get(path)
    if tolerance is not None:
        return tolerance.sigma
    return moved / z if z else float("nan")


def calibration_scores(comparison: Comparison, *, highlight: Region | None = None, dark: bool = False) -> go.Figure:
    """A dot for each parameter with its 90 % interval; red at a bound of ±3 σ.

    highlight is taken so that all figures are called alike; parameters belong to no region.
    """
    del highlight
    found = scores(comparison)
    title = "Calibrated parameters"
    if not found:
        return theme.missing(title, "nothing was calibrated", dark=dark)
    chart = theme.new(title, "Distance from the actuator's file [σ]", "", dark=dark)
    names = [theme.plain(score.title) for score in reversed(found)]
    for at_bound, name, colour in ((False, "90 % interval", theme.MODEL), (True, "at its bound", theme.MARK)):
        some = [score for score in reversed(found) if score.at_bound == at_bound]
        if not some:
            continue
        texts = [f"{number(s.value, 4)} {s.unit} (file: {number(s.nominal, 4)})" for s in some]
        chart.add_trace(
            go.Scatter(
                x=[score.z for score in some],
                y=[theme.plain(score.title) for score in some],
                error_x={"array": [min(score.half, 10.0) for score in some], "thickness": 1.5, "width": 4},
                mode="markers",
                name=name,
                marker={"color": colour, "size": 9},
                customdata=[theme.plain(text) for text in texts],
                hovertemplate="%{y}: %{customdata}<br>%{x:.2f} σ<extra></extra>",
            )
        )
    for edge in (-_BOUND, _BOUND):
        drawn = {"color": theme.MARK, "width": 1.2, "dash": "dash"}
        chart.add_shape(type="line", x0=edge, x1=edge, yref="y domain", y0=0, y1=1, line=drawn)
    chart.update_xaxes(range=[-4, 4], dtick=1, zeroline=True)
    chart.update_yaxes(categoryorder="array", categoryarray=names, range=[-0.7, len(names) - 0.3], nticks=0)
    return chart


# --- one signal of several runs of the reference model over time, from light to dark in their order -------------------

_POINTS = 700


def responses(
    title: str,
    runs: Mapping[str, Measurement],
    signal: str,
    *,
    window_s: tuple[float, float] | None = None,
    with_command: bool = False,
    axes: Axes = ROTARY,
    dark: bool = False,
) -> go.Figure:
    """runs: by what the legend calls them; window_s: the time to show, from and to."""
    largest = np.concatenate([_inside(one, signal, window_s)[1] for one in runs.values()])
    shown = of_signal(signal, axes).scaled(largest)
    chart = theme.new(title, "Time [s]", shown.short_label, dark=dark)
    if with_command:
        first = next(iter(runs.values()))
        x, y = line(*_inside(first, "command_rad", window_s), _POINTS)
        drawn = {"color": theme.INITIAL, "width": 1, "dash": "dot"}
        chart.add_trace(go.Scatter(x=x, y=shown.factor * y, mode="lines", name="command", line=drawn))
    for i, (name, one) in enumerate(runs.items()):
        time, values = _inside(one, signal, window_s)
        x, y = line(time, shown.factor * values, _POINTS)
        drawn = {"color": REFERENCE_SHADES[i % len(REFERENCE_SHADES)], "width": 1.2}
        chart.add_trace(
            go.Scatter(x=x, y=y, mode="lines", name=theme.plain(name), line=drawn, hovertemplate="%{y:.4g}")
        )
    return chart


def _inside(one: Measurement, signal: str, window_s: tuple[float, float] | None) -> tuple[np.ndarray, np.ndarray]:
    time, values = one.time_s, one[signal]
    if window_s is None:
        return time, values
    at = (time >= window_s[0]) & (time <= window_s[1])
    return time[at], values[at]


# --- the memory of each worker over a campaign ------------------------------------------------------------------------


def worker_memory(memory: Mapping[str, tuple[Sequence[float], Sequence[float]]], *, dark: bool = False) -> go.Figure:
    """memory: by worker, minutes since the first row, and MB."""
    chart = theme.new("Memory of the workers", "Time [min]", "Resident [MB]", dark=dark)
    for i, (name, (minutes, megabytes)) in enumerate(memory.items()):
        line = {"color": colour(i), "width": 1.5}
        chart.add_trace(go.Scatter(x=minutes, y=megabytes, mode="lines", name=theme.plain(name), line=line))
    chart.update_yaxes(rangemode="tozero")
    return chart
