"""Figures of a comparison: signals over each other, residuals, and what they are held against."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray
from plotly.subplots import make_subplots

from ema_model import quantities
from ema_model.comparison.regions import Region
from ema_model.comparison.result import Comparison
from ema_model.errors import InputError
from ema_model.estimation.noise import BAND_SIGMAS
from ema_model.quantities import MODULATORS, ROTARY, Axes, Quantity, of_signal, variable_title
from ema_model.quantities import of_residual as residual_of_signal
from ema_model.recordings import SIGNALS, ColumnMapping, Measurement, apply_mapping
from emaviz.colours import BACKWARD, COMMAND, DIFFERENCE, FORWARD, MONITOR, REFERENCE, SLATE
from emaviz.figures import theme
from emaviz.figures.lines import Line, Lines, Window
from emaviz.figures.lines import within as inside
from emaviz.figures.theme import DARK, LIGHT, Binned, band, binned, edges_for, envelope, line, scattered
from emaviz.recording.read import Recording

# --- a signal as measured, and as the model has it before and after calibration ---------------------------------------
# A signal as measured, and as the model has it before and after calibration, the floor a band about the model.


def overlay(
    comparison: Comparison,
    signal: str | None = None,
    recording: int = 0,
    *,
    highlight: Region | None = None,
    moment_s: float | None = None,
    window_s: tuple[float, float] | None = None,
    dark: bool = False,
) -> go.Figure:
    """signal: the primary one, unless given; recording: from 0; moment_s: where a play-head stands.

    window_s: the time to show, from–to, drawn with all points that there is room for.
    """
    signal = signal or comparison.primary
    one = comparison.recordings[recording]
    title = quantity_of_signal(comparison, signal).title
    if signal not in one.measured:
        return theme.missing(title, "not recorded here", dark=dark)
    inside = within(one.time_s, window_s)
    time = one.time_s[inside]
    shown = quantity_of_signal(comparison, signal).scaled(one.measured[signal])
    measured, model = shown.factor * one.measured[signal][inside], shown.factor * one.model[signal][inside]
    sigma = BAND_SIGMAS * shown.factor * one.sigma[signal][inside]
    chart = theme.new(title, *_axes(comparison, shown), dark=dark)
    x, y = band(time, model - sigma, model + sigma, theme.POINTS)
    chart.add_trace(
        go.Scatter(
            x=x,
            y=y,
            fill="toself",
            fillcolor="rgba(240,140,0,0.22)",
            line={"width": 0},
            mode="lines",
            name=theme.FLOOR_NAME,
            hoverinfo="skip",
        )
    )
    calibrated = comparison.calibration is not None
    if calibrated:
        initial = shown.factor * one.initial[signal][inside]
        _add(chart, time, initial, "uncalibrated", theme.INITIAL, 1.3, "dot")
    _add(chart, time, measured, "measured", theme.MEASURED, 1.5)
    _add(chart, time, model, "calibrated" if calibrated else "model", theme.MODEL, 1.5)
    if highlight is not None:
        theme.shade(chart, time_ranges(comparison, highlight, recording), window_s)
    theme.moment(chart, moment_s)
    return chart


def _axes(comparison: Comparison, shown: Quantity) -> tuple[str, str]:
    return ("Sample" if comparison.residuals.is_map else "Time [s]"), shown.short_label


def _add(chart: go.Figure, time, values, name: str, colour: str, width: float, dash: str = "solid") -> None:
    x, y = line(time, values, theme.POINTS)
    drawn = {"color": colour, "width": width, "dash": dash}
    chart.add_trace(go.Scatter(x=x, y=y, mode="lines", name=name, line=drawn, hovertemplate="%{y:.4g}"))


# --- what is left of a signal over time, about the band in which a perfect model would lie ----------------------------


def residual_time(
    comparison: Comparison,
    signal: str | None = None,
    recording: int = 0,
    *,
    highlight: Region | None = None,
    moment_s: float | None = None,
    window_s: tuple[float, float] | None = None,
    as_torque: bool = False,
    dark: bool = False,
) -> go.Figure:
    """signal: the primary one, unless given; as_torque: the current's residual in N·m where that is known.

    window_s: the time to show, from–to, drawn with all points that there is room for.
    """
    signal = signal or comparison.primary
    one = comparison.recordings[recording]
    shown = of_residual(comparison, signal, as_torque=as_torque)
    if signal not in one.measured:
        return theme.missing(shown.title, "not recorded here", dark=dark)
    inside = within(one.time_s, window_s)
    time, measured = one.time_s[inside], one.measured[signal][inside]
    left = measured - one.model[signal][inside]
    shown = shown.scaled(left)
    sigma = BAND_SIGMAS * shown.factor * one.sigma[signal][inside]
    axis = "Sample" if comparison.residuals.is_map else "Time [s]"
    chart = theme.new(f"{shown.title} (measured − model)", axis, shown.short_label, dark=dark)
    theme.below(chart, time, sigma)
    if comparison.calibration is not None:
        x, y = line(time, shown.factor * (measured - one.initial[signal][inside]), theme.POINTS)
        before = {"width": 1, "color": theme.INITIAL}
        hidden = {"visible": "legendonly", "hovertemplate": "%{y:.4g}"}  # it would dwarf what is left
        chart.add_trace(go.Scatter(x=x, y=y, mode="lines", name="uncalibrated", line=before, **hidden))
    x, y = line(time, shown.factor * left, theme.POINTS)
    drawn = {"width": 1, "color": theme.RESIDUAL}
    chart.add_trace(go.Scatter(x=x, y=y, mode="lines", name="residual", line=drawn, hovertemplate="%{y:.4g}"))
    theme.above(chart, time, sigma)
    if highlight is not None:
        theme.shade(chart, time_ranges(comparison, highlight, recording), window_s)
    theme.moment(chart, moment_s)
    return chart


# --- what is left of a signal against a variable ----------------------------------------------------------------------
# What is left of a signal against a variable: the blocks, their mean in bins, the floor, the worst regions.

_FEWEST = 20  # blocks that can be drawn as a cloud with a mean


def residual_against(
    comparison: Comparison,
    variable: str,
    signal: str | None = None,
    *,
    highlight: Region | None = None,
    by_direction: bool | None = None,
    as_torque: bool = True,
    dark: bool = False,
) -> go.Figure:
    """All recordings together, blocks where the drive is saturated left out.

    by_direction: a mean for each direction of motion; without it, where direction explains the residual best.
    The regions of this variable are shaded, or `highlight` alone; blocks of a region of another are marked.
    """
    signal = signal or comparison.primary
    residuals = comparison.residuals
    axis = of_variable(comparison, variable)
    shown = of_residual(comparison, signal, as_torque=as_torque)
    title = f"{shown.title} against {axis.title[0].lower()}{axis.title[1:]}"
    known = np.zeros(0, dtype=bool)
    if variable in residuals.variables and signal in residuals.values:
        known = np.isfinite(residuals.variables[variable]) & np.isfinite(residuals.values[signal])
        known &= ~residuals.saturated
    if np.count_nonzero(known) < _FEWEST:
        return theme.missing(title, f"{axis.title}: not known in these recordings", dark=dark)
    x, y = wrapped(comparison, variable), residuals.values[signal]
    shown, axis = shown.scaled(y[known]), axis.scaled(x[known])
    chart = theme.new(title, axis.label, shown.label, dark=dark)
    edges = edges_for(variable, x[known])
    together = binned(x[known], y[known], residuals.sigma[signal][known], edges)
    _band(chart, together, axis, shown)
    places = np.flatnonzero(known)
    places = places[scattered(x[places], y[places], theme.POINTS)]
    cloud = {"size": 3, "color": "#868e96", "opacity": 0.35}
    _points(chart, x[places] * axis.factor, y[places] * shown.factor, "blocks", cloud)
    if highlight is not None and highlight.variable != variable:
        marked = np.flatnonzero(known & highlight.blocks)
        marked = marked[scattered(x[marked], y[marked], theme.POINTS)]
        strong = {"size": 4, "color": theme.MARK, "opacity": 0.5}
        _points(chart, x[marked] * axis.factor, y[marked] * shown.factor, "blocks of the region", strong)
    if by_direction is None:
        by_direction = _best_modulator(comparison, variable, signal) == "sign_speed"
    if by_direction:
        for sign, name, colour in ((1, "mean, forward", FORWARD), (-1, "mean, backward", BACKWARD)):
            moving = known & (residuals.direction == sign)
            if np.count_nonzero(moving) >= _FEWEST:
                _mean(
                    chart,
                    binned(x[moving], y[moving], residuals.sigma[signal][moving], edges),
                    axis,
                    shown,
                    name,
                    colour,
                )
    else:
        _mean(chart, together, axis, shown, "mean ± error", theme.RESIDUAL)
    theme.shade(chart, _ranges(comparison, variable, signal, highlight, axis))
    if axis.unit == "°":
        chart.update_xaxes(range=[0, 360], tick0=0, dtick=60)
    _fit(chart, y[known] * shown.factor)
    return chart


def _fit(chart: go.Figure, y: np.ndarray) -> None:
    """All blocks stay in sight, with a little air."""
    least, most = float(np.min(y)), float(np.max(y))
    air = 0.05 * (most - least) or 1.0
    chart.update_yaxes(range=[least - air, most + air])


def _best_modulator(comparison: Comparison, variable: str, signal: str) -> str:
    fitting = (e for e in comparison.explained_by if e.variable == variable and e.signal == signal and e.significant)
    best = max(fitting, key=lambda e: e.r2, default=None)
    return "1" if best is None else best.modulator


def _ranges(
    comparison: Comparison, variable: str, signal: str, highlight: Region | None, axis: Quantity
) -> list[tuple[float, float]]:
    regions = comparison.worst_regions if highlight is None else [highlight]
    ranges = []
    for region in regions:
        if region.variable != variable or (highlight is None and region.signal != signal):
            continue
        low, high = region.low * axis.factor, region.high * axis.factor
        if axis.unit == "°":
            ranges += turn_ranges(low, high)
        else:
            ranges.append((low, high))
    return ranges


def turn_ranges(low: float, high: float) -> list[tuple[float, float]]:
    """A range of degrees within 0 … 360, in two parts where it goes over the end of the turn."""
    width = min(high - low if high >= low else high - low + 360.0, 360.0)
    start = low % 360.0
    end = start + width
    return [(start, end)] if end <= 360.0 + 1e-9 else [(start, 360.0), (0.0, end - 360.0)]


def _band(chart: go.Figure, bins: Binned, axis: Quantity, shown: Quantity) -> None:
    # in steps from edge to edge: the floor is known by bin
    x = np.stack([bins.low, bins.high], axis=1).ravel() * axis.factor
    y = np.repeat(bins.floor, 2) * shown.factor * BAND_SIGMAS
    theme.outlined(chart, np.concatenate([x, x[::-1]]), np.concatenate([y, -y[::-1]]))


def _points(chart: go.Figure, x: np.ndarray, y: np.ndarray, name: str, marker: dict) -> None:
    chart.add_trace(
        go.Scatter(
            x=x.astype(np.float32),
            y=y.astype(np.float32),
            mode="markers",
            name=name,
            marker=marker,
            hovertemplate="%{x:.4g}: %{y:.4g}",
        )
    )


def _mean(chart: go.Figure, bins: Binned, axis: Quantity, shown: Quantity, name: str, colour: str) -> None:
    if not len(bins.mean):  # of a recording that is too short
        return
    many = len(bins.mean) > 60
    apart = 1 + np.flatnonzero(bins.low[1:] > bins.high[:-1] + 1e-9 * np.ptp(bins.high))  # no line where nothing is
    x, y, error = (np.insert(one, apart, np.nan) for one in (bins.centre, bins.mean, bins.error))
    chart.add_trace(
        go.Scatter(
            x=x * axis.factor,
            y=y * shown.factor,
            error_y={"array": error * shown.factor, "thickness": 1, "width": 0 if many else 2},
            mode="lines+markers",
            name=name,
            line={"color": colour, "width": 1.8},
            marker={"size": 3 if many else 5},
            hovertemplate="%{x:.4g}: %{y:.4g}",
        )
    )


# --- what is left of a signal around one turn of the motor, the zero a circle, outside it positive --------------------

_CIRCLE = np.arange(0.0, 361.0, 2.0)


def residual_polar(
    comparison: Comparison,
    signal: str | None = None,
    *,
    highlight: Region | None = None,
    as_torque: bool = True,
    dark: bool = False,
) -> go.Figure:
    """The mean in bins of the motor's angle, ± its error, over all recordings; where the motor turns too little or
    its angle is not known, a figure that says so."""
    signal = signal or comparison.primary
    residuals = comparison.residuals
    shown = of_residual(comparison, signal, as_torque=as_torque)
    title = f"{shown.title} around the motor's turn"
    if comparison.actuator.axes.motor == "linear":
        return theme.missing(title, "a linear motor does not turn", dark=dark)
    angle, values = residuals.variables.get("motor_angle"), residuals.values.get(signal)
    known = np.zeros(0, dtype=bool)
    if angle is not None and values is not None:
        known = np.isfinite(angle) & np.isfinite(values) & ~residuals.saturated
    if angle is None or values is None or np.count_nonzero(known) < _FEWEST:
        return theme.missing(title, "the motor's angle is not known", dark=dark)
    turn = np.mod(angle[known], 2.0 * np.pi)
    bins = binned(turn, values[known], residuals.sigma[signal][known], edges_for("motor_angle", turn))
    if not len(bins.mean):
        return theme.missing(title, "too few blocks at each angle", dark=dark)
    shown = shown.scaled(bins.mean)
    mean, error = bins.mean * shown.factor, bins.error * shown.factor
    theta = np.degrees(bins.centre)
    whole = 1.3 * float(np.max(np.abs(mean) + error))
    chart = theme.new(title, "", "", dark=dark)
    for i, (low, high) in enumerate(_sectors(comparison, signal, highlight)):
        arc = np.linspace(low, high, max(2, int(high - low)))
        outline = np.concatenate([np.full(len(arc), whole), np.full(len(arc), -whole)])
        _fill(chart, np.concatenate([arc, arc[::-1]]), outline, theme.SHADE, "worst region", i == 0)
    # gaps of angles that were not visited stay open
    gap = np.flatnonzero(np.diff(theta) > 3.0 * np.median(np.diff(theta))) + 1 if len(theta) > 2 else np.zeros(0, int)
    closed = not len(gap) and len(theta) > 1 and theta[0] + 360.0 - theta[-1] <= 3.0 * np.median(np.diff(theta))
    ring_t, ring_m, ring_e = (np.append(v, v[0]) if closed else v for v in (theta, mean, error))
    for part in np.split(np.arange(len(ring_t)), gap):
        t, m, e = ring_t[part], ring_m[part], ring_e[part]
        edge = np.concatenate([m + e, (m - e)[::-1]])
        _fill(chart, np.concatenate([t, t[::-1]]), edge, "rgba(224,49,49,0.25)", "± error", bool(part[0] == 0))
    chart.add_trace(
        go.Scatterpolar(
            theta=_CIRCLE,
            r=np.zeros(len(_CIRCLE)),
            mode="lines",
            name="zero",
            line={"color": "#868e96", "width": 1.5, "dash": "dot"},
            hoverinfo="skip",
        )
    )
    drawn = {"color": theme.RESIDUAL, "width": 1.8}
    chart.add_trace(
        go.Scatterpolar(
            theta=np.insert(ring_t, gap, np.nan),
            r=np.insert(ring_m, gap, np.nan),
            mode="lines",
            name=f"mean [{shown.unit}]",
            line=drawn,
            hovertemplate="%{theta:.0f}°: %{r:.4g} " + shown.unit,
        )
    )
    chart.update_layout(
        polar={
            "domain": {"y": [0.1, 1.0]},  # the legend below does not push it
            "radialaxis": {"range": [-whole, whole], "nticks": 5, "angle": 90, "tickangle": 90},
            "angularaxis": {"dtick": 30, "ticksuffix": "°"},
        },
        margin={"l": 36, "r": 36, "t": 56, "b": 44},
    )
    return chart


def _sectors(comparison: Comparison, signal: str, highlight: Region | None) -> list[tuple[float, float]]:
    if highlight is not None:
        regions = [highlight]
    else:
        regions = [region for region in comparison.worst_regions if region.signal == signal]
    return [
        part
        for region in regions
        if region.variable == "motor_angle"
        for part in turn_ranges(np.degrees(region.low), np.degrees(region.high))
    ]


def _fill(chart: go.Figure, theta: np.ndarray, r: np.ndarray, colour: str, name: str, legend: bool) -> None:
    chart.add_trace(
        go.Scatterpolar(
            theta=theta,
            r=r,
            mode="lines",
            fill="toself",
            fillcolor=colour,
            line={"width": 0, "color": colour},
            name=name,
            legendgroup=name,
            showlegend=legend,
            hoverinfo="skip",
        )
    )


# --- what explains the residual: how much each variable tells ahead, alone, times the current, by direction -----------

_EXPLAINED_PALE = 0.3


def explained(
    comparison: Comparison, signal: str | None = None, *, highlight: Region | None = None, dark: bool = False
) -> go.Figure:
    """Bars for each variable, in the order of the explanations, the best on top; what noise could have made is pale.

    highlight: the region's variable is marked.
    """
    signal = signal or comparison.primary
    found = [e for e in comparison.explained_by if e.signal == signal]
    title = "What explains the residual"
    if not found:
        return theme.missing(title, "no variable to explain it with is known", dark=dark)
    best = {v: max(e.share for e in found if e.variable == v) for v in dict.fromkeys(e.variable for e in found)}
    variables = list(best)[::-1]  # a horizontal bar chart counts from the bottom
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
                x=[100.0 * e.share for e in shown],
                orientation="h",
                name=MODULATORS[modulator].title,
                legendrank=list(MODULATORS).index(modulator),
                marker={
                    "color": theme.RESIDUAL,
                    "pattern": {"shape": theme.HATCHES[modulator], "size": 5},
                    "opacity": [1.0 if e.significant else _EXPLAINED_PALE for e in shown],
                },
                customdata=[theme.plain(e.sentence) for e in shown],
                hovertemplate="%{x:.1f} %<br>%{customdata}",
            )
        )
    widest = 100.0 * max(best.values())
    chart.update_xaxes(range=[0, min(101.0, max(10.0, 1.1 * widest))])
    chart.update_yaxes(showgrid=False, categoryorder="array", categoryarray=[names[v] for v in variables], nticks=0)
    chart.update_layout(barmode="group", bargap=0.25, hovermode="closest")
    return chart


def _name(variable: str, highlight: Region | None) -> str:
    title = variable_title(variable)
    return f"<b>▶ {title}</b>" if highlight is not None and highlight.variable == variable else title


# --- how strongly the residual repeats with each turn of the motor, by order ------------------------------------------

_NAMED = 8  # of the strongest bars have their order written over them
_ORDER_SPECTRUM_PALE = "rgba(134,142,150,0.55)"


def order_spectrum(
    comparison: Comparison,
    *,
    highlight: Region | None = None,
    as_torque: bool = True,
    dark: bool = False,
) -> go.Figure:
    """Of the primary signal; orders that noise could have made are pale.

    highlight is taken so that all figures are called alike: an order belongs to every part of a turn, so that no
    region lies anywhere in this figure.
    """
    del highlight
    shown = of_residual(comparison, comparison.primary, as_torque=as_torque)
    title = f"{shown.title}: orders of the motor's turn"
    orders = sorted(comparison.orders, key=lambda order: order.order)
    if not orders:
        return theme.missing(title, "nothing repeats with the motor's turn", dark=dark)
    shown = shown.scaled([order.amplitude for order in orders])
    chart = theme.new(title, "Periods in each turn", f"Amplitude [{shown.unit}]", dark=dark)
    strongest = sorted(orders, key=lambda order: -order.amplitude)[:_NAMED]
    named = {order.order for order in strongest if order.is_significant()}
    heights = [order.amplitude * shown.factor for order in orders]
    last = orders[-1].order
    chart.add_trace(
        go.Bar(
            x=[order.order for order in orders],
            y=heights,
            width=max(0.8, last / 150.0),
            marker={"color": [theme.RESIDUAL if order.is_significant() else _ORDER_SPECTRUM_PALE for order in orders]},
            text=[f"{order.order}" if order.order in named else "" for order in orders],
            textposition="outside",
            cliponaxis=False,
            hovertemplate="order %{x}: %{y:.3g} " + shown.unit + "<extra></extra>",
        )
    )
    chart.update_xaxes(range=[0, max(24, last) + 2], showgrid=False)
    chart.update_yaxes(range=[0, 1.15 * max(heights)])
    chart.update_layout(showlegend=False)
    return chart


# --- where a region lies in one recording: its blocks, and the stretches of time that they fill -----------------------


def of_recording(comparison: Comparison, recording: int) -> NDArray[np.intp]:
    """Places in the joined residuals of one recording's blocks."""
    return np.flatnonzero(comparison.residuals.recording == recording)


def within(time_s: NDArray[np.float64], window_s: tuple[float, float] | None) -> NDArray[np.bool_]:
    """Which blocks (n,) lie in a window of time; all where there is none."""
    if window_s is None:
        return np.ones(len(time_s), dtype=bool)
    return (time_s >= window_s[0]) & (time_s <= window_s[1])


def time_ranges(comparison: Comparison, region: Region, recording: int) -> list[tuple[float, float]]:
    """From–to, s, of each unbroken stretch of the region's blocks in a recording."""
    residuals = comparison.residuals
    places = of_recording(comparison, recording)
    inside = region.blocks[places]
    time, run = residuals.time_s[places], residuals.run[places]
    edges = np.flatnonzero((np.diff(inside) != 0) | (np.diff(run) != 0)) + 1
    half = 0.5 * residuals.block_s
    parts = np.split(np.arange(len(places)), edges)
    return [
        (float(time[part[0]]) - half, float(time[part[-1]]) + half) for part in parts if len(part) and inside[part[0]]
    ]


# --- one recording at a glance: its current as measured and as modelled, and what the model leaves of it --------------

_ONE_RECORDING_POINTS = 2500
_FIRST = "current_A"
_GROUPS = (
    ("measurement", "measured", REFERENCE, 2.4),
    ("reference", "reference model", REFERENCE, 2.4),
    ("monitor", "model", MONITOR, 1.3),
)


def signal_at_a_glance(recording: Recording) -> str | None:
    """Which signal of a recording is shown; None where it has none."""
    groups = [recording.signals.get(name, {}) for name, *_ in _GROUPS]
    known = [signal for one in groups for signal in one if signal in SIGNALS]
    return _FIRST if _FIRST in known else next(iter(known), None)


def one_recording(recording: Recording, *, window_s: Window | None = None, dark: bool = False) -> go.Figure | None:
    """Two rows on one time base; None for a recording without signals; window_s: the time to show, from–to."""
    groups = {name: recording.signals.get(name, {}) for name, *_ in _GROUPS}
    signal = signal_at_a_glance(recording)
    if signal is None:
        return None
    left = recording.signals.get("residual", {}).get(signal)
    rows = 1 if left is None else 2
    drawn = make_subplots(rows=rows, cols=1, shared_xaxes=True, vertical_spacing=0.08)
    for name, said, colour, width in _GROUPS:
        series = groups[name].get(signal)
        if series is not None:
            part = inside(series.time_s, window_s)
            x, y = line(series.time_s[part], series.values[part], _ONE_RECORDING_POINTS)
            look = {"color": colour, "width": width}
            drawn.add_trace(go.Scatter(x=x, y=y, name=said, mode="lines", line=look), row=1, col=1)
    title, unit = SIGNALS[signal].title, SIGNALS[signal].unit or "-"
    drawn.update_yaxes(title_text=f"{title}<br>[{unit}]", row=1, col=1)
    if left is not None:
        part = inside(left.time_s, window_s)
        x, y = line(left.time_s[part], left.values[part], _ONE_RECORDING_POINTS)
        look = {"color": DIFFERENCE, "width": 1.3}
        drawn.add_trace(go.Scatter(x=x, y=y, name="residual", mode="lines", line=look), row=2, col=1)
        drawn.update_yaxes(title_text=f"Residual<br>[{unit}]", row=2, col=1)
        theme.cut(drawn, left.values, unit, row=2, col=1)
    drawn.update_xaxes(title_text="Time [s]", row=rows, col=1)
    drawn.update_xaxes(range=list(window_s) if window_s is not None else None, autorange=window_s is None)
    drawn.update_layout(
        template=(DARK if dark else LIGHT).template(),
        margin={"l": 66, "r": 12, "t": 34, "b": 40},
        legend={"orientation": "h", "x": 0.0, "y": 1.02, "yanchor": "bottom"},
    )
    return drawn


# --- the preview of a mapping: each signal as it would be read, in SI units, one small chart above another ------------

_MAPPED_COLUMNS_POINTS = 1200
_ROW_PX = 92
_WIDTH_PX = 520


def mapped_lines(columns: dict[str, np.ndarray], mapping: ColumnMapping) -> list[Lines]:
    """Each signal as it would be read, against time or, without one, its samples; `columns` as in the file, (n,) each.

    InputError if the mapping does not fit the columns.
    """
    signals, _ = apply_mapping(columns, mapping)
    time = signals.pop("time_s", None)
    if not signals:
        raise InputError("no column is used yet; say which column is which signal")
    found = []
    for name, values in signals.items():
        x = np.arange(float(len(values))) if time is None else time
        colour = COMMAND if name.startswith("command") else REFERENCE
        signal = SIGNALS[name]
        line = Line(signal.title, colour, x, values)
        found.append(Lines(signal.title, signal.unit or "", [line], time="Sample" if time is None else "Time [s]"))
    return found


def raw_column(columns: dict[str, np.ndarray], mapping: ColumnMapping, name: str) -> Lines:
    """A column as it stands in the file, in its unit there, against time or, where that is not known, its samples."""
    time = next((one for one in mapping.entries if one.signal == "time_s"), None)
    entry = next((one for one in mapping.entries if one.column == name), None)
    unit = "unit not said" if entry is None else entry.unit or SIGNALS[entry.signal].unit or ""
    values = np.asarray(columns[name], dtype=float)
    known = time is not None and time.column in columns and time.column != name
    x = time.values(columns[time.column]) if time is not None and known else np.arange(float(len(values)))
    title = f"{theme.plain(name)}, as it stands in the file"
    return Lines(title, unit, [Line(title, SLATE, x, values)], time="Time [s]" if known else "Sample")


def mapped_columns(every: Sequence[Lines], window_s: Window | None = None) -> tuple[go.Figure, float]:
    """The figure and its height over its width; window_s: the time to show, from–to.

    Values that are no numbers leave gaps.
    """
    rows = len(every)
    chart = make_subplots(rows=rows, cols=1, shared_xaxes=True, vertical_spacing=0.26 / max(rows, 2))
    titles = []
    for row, one in enumerate(every, start=1):
        (each,) = one.lines
        part = inside(each.time_s, window_s)
        at, drawn = envelope(each.time_s[part], [each.values[part]], _MAPPED_COLUMNS_POINTS)
        look = {"width": 1, "color": each.colour}
        chart.add_trace(go.Scatter(x=at, y=drawn, mode="lines", line=look), row=row, col=1)
        unit = f" [{one.unit}]" if one.unit else ""
        titles.append(
            {
                "text": f"<b>{one.title}</b>{unit}",
                "xref": "paper",
                "yref": f"y{row if row > 1 else ''} domain",
                "x": 0.0,
                "y": 1.0,
                "yanchor": "bottom",
                "xanchor": "left",
                "showarrow": False,
                "font": {"size": 12, "color": LIGHT.ink},
            }
        )
    chart.update_yaxes(nticks=4, gridcolor="#86868640", zeroline=False, tickfont={"size": 10})
    chart.update_xaxes(gridcolor="#86868640", zeroline=False, tickfont={"size": 10})
    chart.update_xaxes(title={"text": every[0].time, "font": {"size": 11}}, row=rows)
    chart.update_xaxes(range=list(window_s) if window_s is not None else None, autorange=window_s is None)
    chart.update_layout(
        annotations=titles,
        showlegend=False,
        font={"color": LIGHT.ink},
        margin={"l": 52, "r": 12, "t": 24, "b": 36},
        paper_bgcolor="rgba(0,0,0,0)",
        plot_bgcolor="rgba(0,0,0,0)",
    )
    return chart, (rows * _ROW_PX + 60) / _WIDTH_PX


# --- both models' signal over time, and what lies between them on an axis of its own below ----------------------------

_MODEL_PAIR_POINTS = 1500
_SPLIT = 0.42  # of the height, for the difference
_GAP = 0.06


def model_pair(
    title: str,
    reference: Measurement,
    monitor: Measurement,
    signal: str,
    *,
    axes: Axes = ROTARY,
    dark: bool = False,
) -> go.Figure:
    """Reference and Monitor Model on one time base; monitor − reference below, in the prefix that it needs."""
    whole = of_signal(signal, axes)
    shown = whole.scaled(reference[signal])
    difference = monitor[signal] - reference[signal]
    finer = whole.scaled(difference)
    chart = theme.new(title, "Time [s]", shown.short_label, dark=dark)
    for name, colour, factor, values, axis in (
        ("reference model", theme.MEASURED, shown.factor, reference[signal], "y"),
        ("monitor model", theme.MODEL, shown.factor, monitor[signal], "y"),
        ("monitor − reference", theme.RESIDUAL, finer.factor, difference, "y2"),
    ):
        x, y = line(reference.time_s, factor * values, _MODEL_PAIR_POINTS)
        drawn = {"color": colour, "width": 1.3}
        chart.add_trace(go.Scatter(x=x, y=y, yaxis=axis, mode="lines", name=name, line=drawn, hovertemplate="%{y:.4g}"))
    chart.update_layout(
        margin={"l": 62},
        yaxis={"domain": [_SPLIT + _GAP, 1.0]},
        yaxis2={"domain": [0.0, _SPLIT - _GAP], "title": {"text": f"difference [{finer.unit}]"}, "anchor": "x"},
        xaxis={"anchor": "y2"},
    )
    return chart


# --- what stands on an axis of a comparison's figures: a title, a unit, and the factor to get there -------------------


def quantity_of_signal(comparison: Comparison, name: str) -> Quantity:
    """A signal, in its own unit."""
    return of_signal(name, comparison.actuator.axes)


def of_residual(comparison: Comparison, name: str, *, as_torque: bool = False) -> Quantity:
    """What is left of a signal; as_torque: the current's is told as the motor's torque, where that is known."""
    constant = comparison.residuals.torque_constant if as_torque else None
    return residual_of_signal(name, comparison.actuator.axes, constant)


def of_variable(comparison: Comparison, variable: str) -> Quantity:
    """A variable that residuals are held against; an angle of the motor in degrees."""
    return quantities.of_variable(variable, comparison.actuator.axes)


def wrapped(comparison: Comparison, variable: str) -> np.ndarray:
    """A variable's values (blocks,) in SI units; a rotary motor's angle within one turn."""
    values = comparison.residuals.variables[variable]
    return np.mod(values, 2.0 * np.pi) if quantities.is_turn(variable, comparison.actuator.axes) else values
