"""Figures of a discovery: the error ladder, candidates, an effect's signature, what is missing."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Any
from urllib.parse import quote

import numpy as np
import plotly.graph_objects as go
import viser
from numpy.typing import NDArray

from ema_model.comparison.explain import Explanation
from ema_model.comparison.residuals import Residuals
from ema_model.discovery import Candidate, Discovery
from ema_model.discovery.result import Added
from ema_model.discovery.snapshot import Look
from ema_model.discovery.words import Track, effect_title, faults, page_of, rung_title, settings
from ema_model.effects import Effect, find
from ema_model.effects.effect import STAGES
from ema_model.estimation.noise import BAND_SIGMAS
from ema_model.faults import cause_of, causes
from ema_model.quantities import ROTARY, Axes, Quantity, in_sentence, number, of_residual, of_variable, variable_title
from ema_model.simulation.run import SHOWN, WithEffect, few_periods
from emaviz.colours import DIFFERENCE, FITTED, HELD_OUT, MONITOR, REFERENCE
from emaviz.figures import theme
from emaviz.figures.lines import Lines, LiveLines
from emaviz.figures.runs import LAST_MORE_PX, PLANT_LINE, charts, legend, time_axis, value_axis
from emaviz.figures.theme import Binned, Series, binned, chart, edges_for, envelope, line, scattered, svg_number
from emaviz.text.html import Html, add_html, html, joined, mathml, unescaped

# --- the error ladder: how far the model is from the recordings, step by step, in units of the floor ------------------

_WIDE = 15.0  # times the floor, from which on the scale is logarithmic
_TOP = 1.2  # of a straight scale, times the largest error
# of the chart's height: the marker, where nothing of its number is, and the far end of a number above or below it
_MARKER, _LABEL = 0.04, 0.14


def error_ladder(found: Discovery, *, dark: bool = False) -> go.Figure:
    """A line for what was fitted, one for what was held out, and the floor at 1 with how well it is known."""
    chart = theme.new("Error after each step", "", "Error / floor [-]", dark=dark)
    # Numbered within: two steps may have the same title.
    places = list(range(len(found.ladder)))
    titles = [theme.plain(rung_title(rung.change, found.actuator.axes)) for rung in found.ladder]
    lines = [("fitted", FITTED, "circle", [rung.rmse for rung in found.ladder])]
    held = [rung.holdout_rmse for rung in found.ladder]
    if any(value is not None for value in held):
        lines.append(("held out", HELD_OUT, "diamond", [float("nan") if v is None else v for v in held]))
    shown = [1.0, *(value for *_, values in lines for value in values if math.isfinite(value) and value > 0.0)]
    wide = max(shown) > _WIDE  # on a straight scale all else would lie on the axis
    low, high = (math.log10(0.4 * min(shown)), math.log10(2.0 * max(shown))) if wide else (0.0, _TOP * max(shown))

    def height(value: float) -> float:
        return ((math.log10(value) if wide else value) - low) / (high - low)

    for name, colour, symbol, values in lines:
        other = next((line[3] for line in lines if line[0] != name), values)
        chart.add_trace(
            go.Scatter(
                x=places,
                y=values,
                mode="lines+markers+text",
                name=name,
                line={"color": colour, "width": 2.5},
                marker={"size": 10, "symbol": symbol},
                text=[number(value) for value in values],
                # The number of the upper line above it, of the lower one below.
                textposition=[
                    _beside(height(value), height(1.0), value > its or (value == its and name == "fitted"))
                    if value > 0.0
                    else "top center"
                    for value, its in zip(values, other)
                ],
                textfont={"color": colour, "size": 12},
                customdata=titles,
                hovertemplate="%{customdata}: %{y:.3f} × the floor",
                cliponaxis=False,
            )
        )
    least, most = found.floor_band
    ends = [-0.5, len(places) - 0.5]
    chart.add_trace(
        go.Scatter(
            x=[*ends, *ends[::-1]],
            y=[least, least, most, most],
            fill="toself",
            fillcolor=theme.FLOOR,
            line={"width": 0},
            mode="lines",
            name="floor, 90 % interval",
            hoverinfo="skip",
        )
    )
    chart.add_trace(
        go.Scatter(
            x=ends,
            y=[1.0, 1.0],
            mode="lines",
            name="floor",
            line={"color": theme.EDGE, "width": 1.5, "dash": "dash"},
            hoverinfo="skip",
        )
    )
    chart.update_xaxes(
        tickvals=places, ticktext=titles, range=[-0.5, len(places) - 0.5], showgrid=False, zeroline=False, nticks=0
    )
    if wide:
        chart.update_yaxes(type="log", range=[low, high], dtick=1)
    else:
        chart.update_yaxes(range=[low, high], rangemode="tozero")
    return chart


def _beside(at: float, floor: float, above: bool) -> str:
    """Where the number of a point stands, by heights in the chart: above or below it, or beside it on the floor's line.

    A floor that runs through the marker is clear of the numbers above and below.
    """
    away = floor - at if above else at - floor
    return "middle right" if _MARKER < away < _LABEL else "top center" if above else "bottom center"


# --- the candidates of a discovery: how much of the error each would take away alone, predicted and refitted ----------

PREDICTED, REFITTED = theme.EDGE, FITTED


def height(found: Discovery) -> int:
    """Pixels in which every name can be read."""
    return 110 + 26 * len(found.candidates)


def candidates(found: Discovery, *, dark: bool = False) -> go.Figure:
    """Bars for each candidate, the best on top; grey names are those that these recordings cannot show."""
    title = "What each candidate would take away from the error"
    shown = found.ranked[::-1]  # a horizontal bar chart counts from the bottom
    if not shown:
        return theme.missing(title, "no candidates were scored", dark=dark)
    chart = theme.new(title, "Fall of χ² [-]", "", dark=dark)
    names = [theme.plain(effect_title(one.name)) for one in shown]
    refitted = [None if one.refitted_drop is None else max(one.refitted_drop, 0.0) for one in shown]
    for name, colour, values, rank in (
        ("refitted", REFITTED, refitted, 2),
        ("predicted", PREDICTED, [one.predicted_drop for one in shown], 1),
    ):
        chart.add_trace(
            go.Bar(
                y=list(range(len(shown))),
                x=values,
                orientation="h",
                name=name,
                legendrank=rank,
                marker={"color": colour},
                customdata=names,
                hovertemplate="%{customdata}: %{x:.0f}",
            )
        )
    most = max([1.0, *(one.predicted_drop for one in shown), *(value for value in refitted if value is not None)])
    for place, one in enumerate(shown):
        if one.obstacle:
            chart.add_annotation(
                x=0.0,
                y=place,
                text="not in this model" if one.cannot_represent else "cannot be shown by these recordings",
                showarrow=False,
                xanchor="left",
                xshift=6,
                font={"size": 11, "color": theme.EDGE},
                hovertext=theme.plain(one.obstacle),
            )
    ticks = [
        f'<span style="color:{theme.EDGE}">{name}</span>' if one.obstacle else name for name, one in zip(names, shown)
    ]
    chart.update_xaxes(range=[0.0, 1.08 * most])
    chart.update_yaxes(tickvals=list(range(len(shown))), ticktext=ticks, showgrid=False, nticks=0)
    chart.update_layout(barmode="group", bargap=0.3)
    return chart


# --- what the residual depended on before the first step, and what it depends on now ----------------------------------
# What the residual depended on before the first step, and what it depends on now: how much each variable tells.

_PALE = 0.3
_TITLE = "What the residual depends on"


def explained_steps(before: Sequence[Explanation], now: Sequence[Explanation], *, dark: bool = False) -> go.Figure:
    """Two bars a variable, its best modulator's, the best explanation before on top; pale where noise could make it.

    One bar where nothing has changed yet.
    """
    runs = {"calibrated model": _best(before), "improved model": _best(now)}
    if before is now:
        runs = {"calibrated model": _best(now)}
    known = [one for found in runs.values() for one in found.values()]
    if not known:
        return theme.missing(_TITLE, "no variable to explain it with is known", dark=dark)
    variables = list(dict.fromkeys(one.variable for one in known))[
        ::-1
    ]  # a horizontal bar chart counts from the bottom
    titles = [variable_title(variable) for variable in variables]
    chart = theme.new(_TITLE, "Explained variance, cross-validated [%]", "", dark=dark)
    for (name, found), colour in zip(reversed(runs.items()), (theme.RESIDUAL, theme.INITIAL)):
        its = [found.get(variable) for variable in variables]
        nothing = not any(one is not None and one.share > 0.0 for one in its)
        chart.add_trace(
            go.Bar(
                y=titles,
                x=[0.0 if one is None else 100.0 * one.share for one in its],
                orientation="h",
                name=f"{name} (nothing explained)" if nothing else name,
                legendrank=list(runs).index(name),
                marker={
                    "color": colour,
                    "opacity": [1.0 if one is not None and one.significant else _PALE for one in its],
                },
                customdata=["" if one is None else theme.plain(one.sentence) for one in its],
                hovertemplate="%{x:.1f} %<br>%{customdata}",
            )
        )
    widest = 100.0 * max(one.share for one in known)
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


# --- what is left of a signal over time before and after a discovery, about the band of a perfect model ---------------

BEFORE, AFTER = theme.INITIAL, theme.RESIDUAL


def residual_steps(track: Track, signal: str, first: int = 0, last: int = -1, *, dark: bool = False) -> go.Figure:
    """The residual of two steps of the ladder: the first and the last one, unless told otherwise."""
    told = of_residual(signal, ROTARY)  # by the name in files, which says all
    title = told.title
    if signal not in track.measured:
        return theme.missing(title, "not recorded here", dark=dark)
    before, after = track.residual(signal, first), track.residual(signal, last)
    shown = told.scaled(before)
    chart = theme.new(f"{title} (measured − model)", "Time [s]", shown.short_label, dark=dark)
    sigma = BAND_SIGMAS * shown.factor * track.sigma[signal]
    theme.below(chart, track.time_s, sigma)
    changed = len(track.models) > 1
    drawn = [(before, "calibrated model", BEFORE)] if changed else []
    drawn.append((after, "improved model" if changed else "residual", AFTER))
    for values, name, colour in drawn:
        x, y = line(track.time_s, shown.factor * values, theme.POINTS)
        style = {"width": 1, "color": colour}
        chart.add_trace(go.Scatter(x=x, y=y, mode="lines", name=name, line=style, hovertemplate="%{y:.4g}"))
    theme.above(chart, track.time_s, sigma)
    most = float(np.max(np.abs(np.concatenate([before, after])))) * shown.factor
    chart.update_yaxes(range=[-1.05 * most, 1.05 * most])
    return chart


# --- what is missing and has no name: the residual as a curve of the variable that explains it best -------------------


def missing_curve(found: Discovery, *, dark: bool = False) -> go.Figure:
    """The curve with its standard error; what is missing of the current is told as the motor's torque."""
    unknown = found.unknown
    if unknown is None:
        return theme.missing("Remaining residual", "nothing that a variable explains", dark=dark)
    axis, shown = of_variable(unknown.variable, found.actuator.axes), _residual(found)
    axis, shown = axis.scaled(unknown.centres), shown.scaled(unknown.curve)
    title = f"{shown.title} against {axis.title[0].lower()}{axis.title[1:]}"
    chart = theme.new(title, axis.label, shown.label, dark=dark)
    known = np.isfinite(unknown.curve) & np.isfinite(unknown.error)
    chart.add_trace(
        go.Scatter(
            x=axis.factor * unknown.centres[known],
            y=shown.factor * unknown.curve[known],
            error_y={"array": shown.factor * np.abs(unknown.error[known]), "thickness": 1.2, "width": 3},
            mode="lines+markers",
            name="mean ± standard error",
            line={"color": theme.RESIDUAL, "width": 2},
            marker={"size": 6},
            hovertemplate="%{x:.4g}: %{y:.4g}",
        )
    )
    chart.update_xaxes(zeroline=True)
    chart.update_yaxes(zeroline=True)
    if axis.unit == "°":
        chart.update_xaxes(range=[0, 360], tick0=0, dtick=60)
    chart.update_layout(showlegend=True)
    return chart


def _residual(found: Discovery) -> Quantity:
    assert found.unknown is not None
    modulator = found.unknown.modulator
    told = of_residual(found.unknown.signal, found.actuator.axes, found.actuator.motor.torque_constant_Nm_A)
    if modulator == "current":  # a share of the current or torque, which has no unit of its own
        return Quantity(f"{told.title} / current", f"{told.unit}/A", told.factor)
    return Quantity(f"{told.title}, with the motion", told.unit, told.factor) if modulator == "sign_speed" else told


# --- an effect's signature beside what is left ------------------------------------------------------------------------
# An effect's signature beside what is left: what it would change, and what the model lacks, over one variable.

Array = NDArray[np.float64]

SIGNATURE, RESIDUAL = theme.MODEL, theme.RESIDUAL
_VARIABLES = ("motor_angle", "motor_speed", "user_position", "current", "load", "acceleration")
_TURN = 2.0 * np.pi
_MOST_IN_A_TURN = 8.0  # periods that are told from one another where a turn is drawn whole
_SHOWN = 400  # blocks over time
_CLEAR = 0.25  # of the signature's square that a variable must tell, else it is drawn over time


def signature(look: Look, one: Candidate, *, dark: bool = False) -> go.Figure:
    """Means over the variable that the effect follows; where the two lines lie together, this is what is missing."""
    title = f"{effect_title(one.name)} and the residual"
    signal = look.primary
    change = look.change(one, signal)
    if change is None or not np.any(change):
        return theme.missing(title, "these recordings do not show it", dark=dark)
    residuals = look.residuals
    variable = variable_of(residuals, change, _span(one))
    if variable == "time":
        return _over_time(look, one, title, signal, change, dark)
    x = _values(residuals, variable, one)
    edges = _edges(variable, x, one)
    left, own = (binned(x, values, residuals.sigma[signal], edges) for values in (residuals.values[signal], change))
    axis, shown = _axis(look, variable, one), _shown(look, signal, left, own)
    axis = axis.scaled(x[np.isfinite(x)])
    chart = theme.new(title, axis.label, shown.label, dark=dark)
    _add_left(chart, left, axis, shown)
    chart.add_trace(
        go.Scatter(
            x=axis.factor * own.centre,
            y=shown.factor * own.mean,
            mode="lines",
            name=_legend(one),
            line={"color": SIGNATURE, "width": 2.5},
            hovertemplate="%{y:.3g}",
        )
    )
    chart.update_yaxes(zeroline=True)
    if variable == "motor_angle":
        chart.update_xaxes(range=[0.0, axis.factor * edges[-1]])
    return chart


def _legend(one: Candidate) -> str:
    return theme.plain(f"what {in_sentence(effect_title(one.name))} would change")


def _over_time(look: Look, one: Candidate, title: str, signal: str, change: Array, dark: bool) -> go.Figure:
    """Where it would change most, block by block."""
    residuals = look.residuals
    middle = int(np.argmax(np.convolve(change**2, np.ones(_SHOWN // 2), mode="same")))
    part = np.flatnonzero(residuals.run == residuals.run[middle])
    part = part[np.abs(part - middle) <= _SHOWN // 2]
    values = residuals.values[signal][part]
    shown = of_residual(signal, look.found.actuator.axes).scaled(values)
    chart = theme.new(title, "Time [s], where it would show most", shown.label, dark=dark)
    for name, drawn, style in (
        ("measured − model", values, {"color": theme.RESIDUAL, "width": 1}),
        (_legend(one), change[part], {"color": SIGNATURE, "width": 2.5}),
    ):
        chart.add_trace(
            go.Scatter(x=residuals.time_s[part], y=shown.factor * drawn, mode="lines", name=name, line=style)
        )
    return chart


def variable_of(residuals: Residuals, change: Array, span: float = _TURN) -> str:
    """The variable that an effect's change follows best, the motor's angle over a span; time where it follows none."""
    best, told = "time", _CLEAR
    power = float(np.sum(change**2))
    for variable in _VARIABLES:
        x = residuals.variables.get(variable)
        if x is None or np.isfinite(x).sum() < 100 or np.ptp(x[np.isfinite(x)]) == 0.0:
            continue
        x = np.mod(x, span) * (_TURN / span) if variable == "motor_angle" else x
        known = np.isfinite(x)
        edges = edges_for(variable, x)
        place = np.clip(np.searchsorted(edges, x[known], side="right") - 1, 0, len(edges) - 2)
        count = np.maximum(np.bincount(place, minlength=len(edges) - 1), 1)
        mean = np.bincount(place, change[known], len(edges) - 1) / count
        share = 1.0 - float(np.sum((change[known] - mean[place]) ** 2)) / power
        # The bins of a turn are many more than those of the others, and tell a little of anything.
        if share - 0.1 * (variable == "motor_angle") > told:
            best, told = variable, share
    return best


def _values(residuals: Residuals, variable: str, one: Candidate) -> Array:
    if variable == "time":
        return residuals.variables.get("time", residuals.time_s)
    x = residuals.variables[variable]
    return np.mod(x, _span(one)) if variable == "motor_angle" else x


def _span(one: Candidate) -> float:
    """Of the motor's angle: a whole turn of few periods, else a few periods."""
    order = one.settings.get("order", 1.0)
    whole = "period_rad" not in one.settings and 2.0 <= order <= _MOST_IN_A_TURN
    return _TURN if whole else few_periods(one.settings)[0]


def _edges(variable: str, x: Array, one: Candidate) -> Array:
    if variable == "motor_angle":
        span, count = few_periods(one.settings)
        periods = count * _span(one) / span
        return np.linspace(0.0, _span(one), int(np.clip(14 * periods, 36, 240)) + 1)
    return edges_for(variable, x)


def _axis(look: Look, variable: str, one: Candidate) -> Quantity:
    axis = of_variable(variable, look.found.actuator.axes)
    if variable != "motor_angle" or _span(one) == _TURN:
        return axis
    return replace(axis, title=f"{axis.title}, folded to {few_periods(one.settings)[1]} periods")


def _shown(look: Look, signal: str, *lines: Binned) -> Quantity:
    values = np.concatenate([line.mean for line in lines])
    return of_residual(signal, look.found.actuator.axes, look.residuals.torque_constant).scaled(values)


def _add_left(chart: go.Figure, left: Binned, axis: Quantity, shown: Quantity) -> None:
    chart.add_trace(
        go.Scatter(
            x=axis.factor * left.centre,
            y=shown.factor * left.mean,
            error_y={"array": shown.factor * left.error, "thickness": 1, "width": 0, "color": theme.FLOOR},
            mode="markers",
            name="measured − model, ± its standard error",
            marker={"size": 5, "color": theme.RESIDUAL},
            hovertemplate="%{y:.3g}",
        )
    )


# --- what an effect does to a run: live charts with and without it, and a small picture for a card --------------------

_SMALL_POINTS = 160
_TAG = re.compile(r"<[^>]+>")  # of Plotly's, in a title
_WIDTH, _HEIGHT = 120, 44  # of a small picture, pixels


class EffectCharts(LiveLines):
    """A chart for each signal, and one of what changes in it; unseen until there is a run."""

    def __init__(self, gui: viser.GuiApi, axes: Axes, height: int = 92) -> None:
        super().__init__()
        empty = np.array([0.0, 1.0])
        lines = legend((REFERENCE, "without"), (MONITOR, "with the effect"), (DIFFERENCE, "difference, below"))
        self._legend = add_html(gui, lines, visible=False)
        self._charts: list[tuple[Any, Any, Any]] = []
        for shown in (one for one in charts(axes) if one.signal in SHOWN):
            last = shown.signal == SHOWN[-1]
            both = gui.add_uplot(
                data=(empty, empty, empty),
                series=({"label": "t [s]"}, PLANT_LINE, _effect_signature_line("with", MONITOR, 1.5)),
                title=shown.title,
                axes=(time_axis(False), value_axis(shown.unit)),
                **_layout(height),
            )
            change = gui.add_uplot(
                data=(empty, empty),
                series=({"label": "t [s]"}, _effect_signature_line("difference", DIFFERENCE, 1.5)),
                title="",
                axes=(time_axis(last), value_axis(shown.difference_unit)),
                # its topmost number has no title above it
                **_layout(height - 10 + (LAST_MORE_PX if last else 0), above=8),
            )
            self._charts.append((shown, both, change))
            self.handles += [both, change]

    def show(self, felt: WithEffect) -> None:
        """Draws a run."""
        time = felt.with_it.time_s
        self._legend.visible = True
        every = []
        for of, both, change in self._charts:
            with_it, without = felt.with_it[of.signal], felt.without[of.signal]
            two = ("without", REFERENCE, of.scale * without), ("with the effect", MONITOR, of.scale * with_it)
            apart = "difference", DIFFERENCE, of.difference_scale * (with_it - without)
            every.append(Lines.of(of.title, of.unit, time, *two, difference=(1, 0)))
            every.append(Lines.of(f"{of.title}, difference", of.difference_unit, time, apart))
            both.visible = change.visible = True
        self.draw(every)


def _effect_signature_line(label: str, colour: str, width: float) -> Any:
    return {"label": label, "stroke": colour, "width": width}


def _layout(height: int, above: int = 0) -> dict[str, Any]:
    return {
        "scales": {"x": {"time": False}, "y": {"auto": True}},
        "cursor": {"sync": {"key": "library"}},
        "legend": {"show": False},
        "padding": (above, 8, 0, 0),
        "height": height,
        "visible": False,
    }


def small_picture(felt: WithEffect) -> str:
    """An SVG as a data address: what changes in the signal that shows the effect most."""
    change = felt.change(felt.shows)[1]
    most = float(np.max(np.abs(change)))
    if most == 0.0 or not np.isfinite(most):
        return ""
    x, y = envelope(felt.with_it.time_s, [change], _SMALL_POINTS)
    across = _WIDTH * (x - x[0]) / (x[-1] - x[0])
    down = 0.5 * _HEIGHT * (1.0 - 0.92 * y / most)
    points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(across, down))
    svg = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {_HEIGHT}" preserveAspectRatio="none">'
        f'<line x1="0" x2="{_WIDTH}" y1="{_HEIGHT / 2}" y2="{_HEIGHT / 2}" stroke="#868e96" stroke-width=".5"/>'
        f'<polyline points="{points}" fill="none" stroke="{DIFFERENCE}" stroke-width="1"/></svg>'
    )
    return f"data:image/svg+xml,{quote(svg)}"


_SKETCH = 240, 84  # pixels
_LEAST_SPAN = 1e-30


def sketch(figure: go.Figure) -> Html:
    """A figure's lines and points as a small SVG with the range of its axes beside them; nothing where it has none."""
    lines: tuple[Any, ...] = tuple(figure.data)
    traces = [
        (trace, np.asarray(trace.x, dtype=float), np.asarray(trace.y, dtype=float))
        for trace in lines
        if trace.x is not None and len(trace.x)
    ]
    points = [(x[good], y[good]) for _, x, y in traces if (good := np.isfinite(x) & np.isfinite(y)).any()]
    if not points:
        return Html()
    every_x, every_y = (np.concatenate(parts) for parts in zip(*points))
    left, right = float(every_x.min()), float(every_x.max())
    low, high = min(float(every_y.min()), 0.0), max(float(every_y.max()), 0.0)
    wide, tall = _SKETCH

    def across(x: Array) -> Array:
        return wide * (x - left) / max(right - left, _LEAST_SPAN)

    def down(y: Array) -> Array:
        return 3.0 + (tall - 6.0) * (1.0 - (y - low) / max(high - low, _LEAST_SPAN))

    zero = float(down(np.array([0.0]))[0])
    drawn = [f'<line x1="0" x2="{wide}" y1="{zero:.1f}" y2="{zero:.1f}" stroke="#868e96" stroke-width=".6"/>']
    for trace, x, y in traces:
        good = np.isfinite(x) & np.isfinite(y)
        at = list(zip(across(x[good]), down(y[good])))
        if trace.mode == "markers":
            drawn += [f'<circle cx="{a:.1f}" cy="{b:.1f}" r="2" fill="{trace.marker.color}"/>' for a, b in at]
        else:
            line = " ".join(f"{a:.1f},{b:.1f}" for a, b in at)
            width = trace.line.width or 1.5
            drawn.append(f'<polyline points="{line}" fill="none" stroke="{trace.line.color}" stroke-width="{width}"/>')
    x_title, y_title = (_TAG.sub("", axis.title.text or "") for axis in (figure.layout.xaxis, figure.layout.yaxis))
    svg = unescaped(f'<svg viewBox="0 0 {wide} {tall}" aria-hidden="true">{"".join(drawn)}</svg>')
    ends = [number(one, 2) for one in (low, high, left, right)]
    axis = "<small>{}: <span>{} … {}</span></small>"
    return html(
        f'<figure class="emaviz-sketch">{axis}{{}}{axis}</figure>',
        unescaped(y_title),
        *ends[:2],
        svg,
        unescaped(x_title),
        *ends[2:],
    )


# --- how an effect looks in the current's residual, against a variable and over time, as SVG --------------------------

SEVERITIES = (("low", "#ff9a9a"), ("medium", DIFFERENCE), ("high", "#991b1b"))  # shades of the residual's colour
_SIGNAL = "current_A"
_DOTS, _PERIODIC_DOTS, _EFFECT_RESIDUAL_POINTS = 400, 900, 600  # of a severity
_START = 0.1  # of a run, in which a loop that finds its way hides what is periodic
_SHARE, _FEWEST = 0.005, 200  # of a change's power that may lie before or behind what is shown; samples
# of a window: below the text and the sliders of most effects it is seen whole
_FITS = "width:100%;max-height:clamp(180px,calc(100vh - 665px),330px)"
_FLAT = 1e-3  # of the current's range: a change below is drawn as none


def pictures(effect: Effect, felt: Sequence[WithEffect], axes: Axes = ROTARY) -> Html:
    """The charts of an effect in one run, at each of its severities; against time there is but one."""
    shown = [(name, colour, one) for (name, colour), one in zip(SEVERITIES, felt)]
    drawn = [_series(shown, axes, "time")]
    if effect.against != "time":
        drawn.insert(0, _series(shown, axes, effect.against))
    return html('<div class="pictures">{}</div>', joined(drawn))


def picture(effect: Effect, felt: WithEffect, axes: Axes) -> Html:
    """One run against the variable that the effect follows; over time where it follows none."""
    drawn = _series([("", DIFFERENCE, felt)], axes, effect.against, _FITS)
    return html('<div class="emaviz-picture" style="padding:4px 6px">{}</div>', drawn)


def effect_residual_legend(effect: Effect) -> Html:
    """Which colour is which size of the effect's first parameter."""
    first = effect.parameters[0]
    shown = Quantity("", first.unit).scaled(effect.severities)
    lines = (
        html(
            '<span><b style="color:{}">━</b> {}: {} {}</span>',
            colour,
            name,
            svg_number(shown.factor * value),
            shown.unit,
        )
        for (name, colour), value in zip(SEVERITIES, effect.severities)
    )
    return html('<p class="legend">{} {}</p>', first.title, joined(lines, " "))


def _series(felt: Sequence[tuple[str, str, WithEffect]], axes: Axes, variable: str, style: str = "") -> Html:
    """felt: with its name and its colour each, the slightest first; style: the picture's, in CSS."""
    residual, axis = of_residual(_SIGNAL, axes), of_variable(variable, axes)
    title = f"{residual.title} {'over' if variable == 'time' else 'against'} {in_sentence(axis.title)}"
    strongest = felt[-1][2]
    change = strongest.change(_SIGNAL)[1]
    span, dots, begin = 0.0, _DOTS, 0
    if variable == "motor_angle":  # what follows it is periodic
        span, periods = few_periods(strongest.settings)
        dots = _PERIODIC_DOTS
        begin = int(_START * len(change))
        if float(np.ptp(strongest.against(variable)[begin:])) > span:
            title += f", folded to {periods} periods"
        else:
            span = 0.0
    part = _where(change, begin)
    lines = []
    for name, colour, one in reversed(felt):  # so that a strong one hides no slight one
        x, y = one.against(variable)[part], one.change(_SIGNAL)[1][part]
        if variable == "time":
            x, y = envelope(x, [y], _EFFECT_RESIDUAL_POINTS)
            lines.append(Series(name, colour, x, y))
        else:
            x = np.mod(x, span) if span else x
            places = scattered(x, y, dots)
            lines.append(Series(name, colour, x[places], y[places], joined=False))
    least = _FLAT * float(np.ptp(strongest.without[_SIGNAL]))
    return chart(title, axis, residual, lines, least, style)


def _where(change: Array, begin: int) -> slice:
    """The samples from `begin` on about where nearly all of a change lies; all of these where there is none."""
    power = np.cumsum(np.where(np.arange(len(change)) < begin, 0.0, change) ** 2)
    if power[-1] == 0.0:
        return slice(begin, None)
    first, last = np.searchsorted(power, [_SHARE * power[-1], (1.0 - _SHARE) * power[-1]])
    around = max(last - first, _FEWEST) // 4
    return slice(max(first - around, begin), last + around)


# --- the model's equations as HTML, the terms of added effects set off from the base model's --------------------------

# Where an effect acts, the equation of the base model that it stands in, in the order of the page.
_LINES = {
    "motion": "J dω/dt = k_t i − T_f(ω) − τ T_load",
    "current": "L di/dt = v − R i − k_e ω",
    "friction": "T_f = T_s at rest, T_d sgn ω in motion",
    "output": "θ_user = τ θ, with play",
    "sensors": "read: θ_user, θ, ω, i",
    "drive": "I_ref = sat(K_P (ω_ref − ω) + K_I ∫(ω_ref − ω) dt), ω_ref = sat(G (θ_cmd − θ_user))",
}
_OF_PLACE = {
    "moving_friction": "friction",
    "friction": "friction",
    "electric_torque": "motion",
    "shaft_torque": "motion",
    "inverse_inertia": "motion",
    "back_emf": "current",
    "winding_resistance": "current",
    "bus_voltage": "current",
    "user_position": "output",
    "position_reading": "sensors",
    "current_reading": "sensors",
    "motor_angle_reading": "sensors",
    "motor_speed_reading": "sensors",
    **dict.fromkeys(STAGES, "drive"),
}


def equation(found: Discovery, added: Sequence[Added]) -> Html:
    """The lines that added effects and faults change, each with its terms and fitted values; "" without any."""
    by_line: dict[str, list[Html]] = {}
    for one in added:
        effect = find(one.key)
        values = joined(
            (html("{} = {}", _symbol(effect, name), text) for name, text in settings(found, one).items()), ", "
        )
        if len(effect.parameters) > 6:
            values = html("{} knots, fitted", len(effect.parameters))
        by_line.setdefault(_model_equation_line(effect), []).append(
            _term(effect_title(one.name), effect.equation, values)
        )
    told = faults(found)
    for fault in causes(found.faults):
        page = page_of(fault)
        term = _term(effect_title(fault), page.equation, html("{}", ", ".join(told[name] for name in cause_of(fault))))
        by_line.setdefault(page.line, []).append(term)
    rows = []
    for part, base in _LINES.items():
        if part in by_line or part == "motion":
            extra = joined(by_line.get(part, []))
            more = html(' <span style="opacity:.65">and</span>') if extra else ""
            shown = mathml(base, "inline")
            rows.append(html('<div style="font-size:15px">{}{}</div>{}', shown, more, extra))
    return joined(rows if by_line else [])


def _term(title: str, equation: str, values: Html) -> Html:
    return html(
        '<div style="margin:2px 0 4px 6px;padding-left:8px;border-left:3px solid rgba(134,142,150,.55)">'
        "<b>{}:</b> "
        '<span style="font-size:15px">{}</span>'
        '<div style="font-size:12px;opacity:.85">{}</div></div>',
        title,
        mathml(equation, "inline"),
        values,
    )


def _model_equation_line(effect: Effect) -> str:
    return next((_OF_PLACE[place.__name__] for place in effect.places if place.__name__ in _OF_PLACE), "motion")


def _symbol(effect: Effect, name: str) -> str | Html:
    """'A', typeset, where the parameter's meaning names a symbol of the equation; else its own name."""
    meaning = next((p.meaning for p in effect.parameters if p.name == name), "")
    symbols = set(re.split(r"[^\w]+", effect.equation))
    symbol = next((word for word in re.split(r"[^\w]+", meaning)[1:] if word and word in symbols), "")
    return mathml(symbol, "inline") if symbol else name.rpartition("_")[0].replace("_", " ") or name
