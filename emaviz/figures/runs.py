"""Figures of runs: lines over time, metrics, two recordings beside each other, many over each other."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import plotly.graph_objects as go
import viser
from numpy.typing import NDArray
from plotly.subplots import make_subplots

from ema_model.comparison.result import Compared, Comparison
from ema_model.faults import FAULTS
from ema_model.identification.run import algorithm_title
from ema_model.quantities import MOTOR, ROTARY, USER, Axes, Side, of_signal
from ema_model.recordings import SIGNALS, Measurement
from ema_model.recordings.signals import event
from ema_model.text import COLOURS
from emaviz.colours import CASES, COMMAND, DIFFERENCE, GHOST, MONITOR, PHASES, REFERENCE, RUNS
from emaviz.figures import theme
from emaviz.figures.comparison import of_residual, quantity_of_signal
from emaviz.figures.lines import POINTS, Line, Lines, LiveLines, Window, of_window, within
from emaviz.figures.theme import DARK, LIGHT, envelope, line, plain
from emaviz.recording.entry import Entry, error_key, setting
from emaviz.recording.read import Recording
from emaviz.text.html import Html, add_html, html, joined

# --- lines over time of compared recordings and of recorded runs: one beside its model, or many over each other -------

Array = NDArray[np.float64]

# --- a comparison's recordings ----------------------------------------------------------------------------------------

_POSITIONS = ("user_position_rad", "motor_position_rad")


def models(comparison: Comparison, one: Compared) -> dict[str, dict[str, Array]]:
    """What is drawn beside the measured signals, by its name: the model, and where it was calibrated, before that."""
    if comparison.calibration is None:
        return {"model": one.model}
    return {"calibrated": one.model, "uncalibrated": one.initial}


def compared(comparison: Comparison, signal: str, recording: int) -> list[Lines]:
    """A signal as measured and modelled, and what the model leaves of it; none where it was not recorded."""
    one = comparison.recordings[recording]
    if signal not in one.measured:
        return []
    shown = quantity_of_signal(comparison, signal).scaled(one.measured[signal])
    left = one.measured[signal] - one.model[signal]
    rest = of_residual(comparison, signal).scaled(left)
    looks = (theme.MODEL, "solid"), (theme.INITIAL, "dot")
    beside = [
        Line(name, colour, one.time_s, shown.factor * values[signal], dash)
        for (name, values), (colour, dash) in zip(models(comparison, one).items(), looks)
    ]
    measured = Line("measured", theme.MEASURED, one.time_s, shown.factor * one.measured[signal])
    residual = Line("residual", theme.RESIDUAL, one.time_s, rest.factor * left)
    return [Lines(shown.title, shown.unit, [measured, *beside], (0, 1)), Lines(rest.title, rest.unit, [residual])]


def event_of_recording(one: Compared) -> Window | None:
    """When something happens in a recording: in its positions, where they were recorded."""
    names = [name for name in _POSITIONS if name in one.measured] or list(one.measured)
    return event(one.time_s, *(one.measured[name] for name in names))


def together(comparison: Comparison, signal: str) -> list[Lines]:
    """As `compared`, of all recordings that have it, held-out ones too; each from its event on, where all have one."""
    every = [one for one in (*comparison.recordings, *comparison.holdout) if signal in one.measured]
    if not every:
        return []
    events = [window[0] for one in every if (window := event_of_recording(one)) is not None]
    aligned = len(events) == len(every)
    starts = events if aligned else [float(one.time_s[0]) for one in every]
    time = f"Time, each from its {'event' if aligned else 'start'} on [s]"
    shown = quantity_of_signal(comparison, signal).scaled(np.concatenate([one.measured[signal] for one in every]))
    lefts = [one.measured[signal] - one.model[signal] for one in every]
    rest = of_residual(comparison, signal).scaled(np.concatenate(lefts))
    over: list[Line] = []
    apart: list[Line] = []
    for i, (one, start, left) in enumerate(zip(every, starts, lefts)):
        colour, time_s = CASES[i % len(CASES)], one.time_s - start
        over.append(Line(f"{one.name}, measured", colour, time_s, shown.factor * one.measured[signal]))
        for (name, values), dash in zip(models(comparison, one).items(), ("dash", "dot")):
            over.append(Line(f"{one.name}, {name}", colour, time_s, shown.factor * values[signal], dash))
        apart.append(Line(one.name, colour, time_s, rest.factor * left))
    second = 1 + len(models(comparison, every[0]))
    pair = (second, 0) if len(every) > 1 else (0, 1)
    return [
        Lines(shown.title, shown.unit, over, pair, time),
        Lines(f"{rest.title} (measured − model)", rest.unit, apart, (1, 0) if len(every) > 1 else None, time),
    ]


# --- recorded runs ----------------------------------------------------------------------------------------------------

_RECORDED = ("reference", "dot"), ("measurement", "dot"), ("monitor", "solid")


def recorded(named: Sequence[tuple[str, str, Recording]], signal: str) -> list[Lines]:
    """A signal of recorded runs, and what is left of it; named: what each is called, and its colour, "" for usual ones.

    The second is without lines where no run has a residual.
    """
    over: list[Line] = []
    apart: list[Line] = []
    begins: list[int] = []  # of each run among the lines
    title, unit = SIGNALS[signal].title, SIGNALS[signal].unit or "-"
    for name, colour, one in named:
        begins.append(len(over))
        for group, dash in _RECORDED:
            series = one.signals.get(group, {}).get(signal)
            if series is not None:
                said, usual = ("fitted", MONITOR) if group == "monitor" else ("recorded", REFERENCE)
                over.append(Line(f"{name} {said}".strip(), colour or usual, series.time_s, series.values, dash))
        left = one.signals.get("residual", {}).get(signal)
        if left is not None:
            apart.append(Line(f"{name} residual".strip(), colour or DIFFERENCE, left.time_s, left.values))
    second = begins[-1] if len(named) > 1 else len(over) - 1  # of one run, its model
    second = second if 0 < second < len(over) else None
    return [
        Lines(title, unit, over, (second, 0) if second is not None else None),
        Lines("Residual", unit, apart, (1, 0) if len(apart) > 1 else None),
    ]


# --- the live charts of one run: reference, monitor, a frozen run, and the difference on an axis of its own -----------

PADDING = (10, 4, 0, 0)  # top, right, bottom, left, px: the uppermost tick needs half a line
_GREY = "#868e96"
_VALUES_PX, _LABEL_PX = 22, 16  # of a time axis
LEAST_SPACE_PX = 12  # between two values of an axis, which a low chart needs; the page gives high ones more
_FRAME = 3.0  # of the difference's axis over its largest value
LAST_MORE_PX = _VALUES_PX + _LABEL_PX  # by which the last chart of a column is taller than those above it


_SHOWN = ((REFERENCE, "plant"), (MONITOR, "monitor"), (DIFFERENCE, "monitor − plant, right axis"), (COMMAND, "command"))
PHASE_SIGNALS = ("phase_a_current_A", "phase_b_current_A", "phase_c_current_A")


def legend(*names: tuple[str, str]) -> Html:
    """Colours and names, in a line."""
    lines = (
        html('<span style="white-space:nowrap"><span style="color:{}">━</span> {}</span>', colour, name)
        for colour, name in names
    )
    return html('<div style="font-size:12px;padding:0 10px;line-height:1.5">{}</div>', joined(lines, " &nbsp; "))


class LiveSignals:
    """The charts in a panel of the page."""

    def __init__(
        self,
        gui: viser.GuiApi,
        axes: Axes,
        set_axes: Callable[[Any, Sequence[Any]], None],
        height: int = 127,
    ) -> None:
        """set_axes(chart, axes): gives a chart other axes, when another unit fits its range."""
        self._set_axes = set_axes
        empty = np.array([0.0, 1.0])
        self._legend: Any = add_html(gui, legend(*_SHOWN))
        self._frozen = False
        self._runs: tuple[Measurement, Measurement, Measurement | None] | None = None
        self._charts: list[tuple[SignalChart, Any]] = []
        every = charts(axes)
        for chart in every:
            count = 6 + chart.with_command
            last = chart is every[-1]
            handle = gui.add_uplot(
                data=tuple(empty for _ in range(count)),
                series=_series(chart),
                title=chart.title,
                scales={"x": {"time": False}, "y": {"auto": True}, "difference": {"auto": True}},
                axes=_axes(chart, last),
                cursor=CURSOR,
                legend={"show": False},
                padding=PADDING,
                height=height + (LAST_MORE_PX if last else 0),
            )
            self._charts.append((chart, handle))

    @property
    def handles(self) -> list[Any]:
        """The charts, from above."""
        return [handle for _, handle in self._charts]

    def lines(self, place: int) -> Lines | None:
        """What a chart draws, whole; None before there is a run."""
        if self._runs is None:
            return None
        chart, (reference, monitor, ghost) = self._charts[place][0], self._runs
        time_s = reference.time_s
        named = [
            ("plant", REFERENCE, chart.scale * reference[chart.signal]),
            ("monitor", MONITOR, chart.scale * monitor[chart.signal]),
        ]
        if chart.with_command:
            named.append(("command", COMMAND, chart.scale * reference["command_rad"]))
        if ghost is not None:
            named.append(("frozen", GHOST, chart.scale * at(ghost, chart.signal, time_s)))
        return Lines.of(chart.title, chart.unit, time_s, *named, difference=(1, 0))

    def show(
        self, reference: Measurement, monitor: Measurement, ghost: Measurement | None, window_s: Window | None
    ) -> None:
        """Draws a run of both models on one time base, and the frozen one, from and to these times; None: all."""
        self._runs = reference, monitor, ghost
        if self._frozen != (ghost is not None):
            self._frozen = ghost is not None
            self._legend.content = legend(*_SHOWN, *([(GHOST, "frozen")] if self._frozen else []))
        shown = within(reference.time_s, window_s)
        time = reference.time_s[shown]
        for i, (chart, handle) in enumerate(self._charts):
            rm, mm = reference[chart.signal][shown], monitor[chart.signal][shown]
            fitting = fitted(chart, np.concatenate([rm, mm]), _FRAME * (mm - rm))
            if fitting != chart:
                chart = fitting
                self._charts[i] = chart, handle
                self._set_axes(handle, _axes(chart, i == len(self._charts) - 1))
            difference = chart.difference_scale * (mm - rm)
            frozen = beneath(at(ghost, chart.signal, time), rm)
            every = [difference, chart.scale * frozen, chart.scale * rm, chart.scale * mm]
            if chart.with_command:
                every.append(chart.scale * reference["command_rad"][shown])
            # in the middle third of the chart, so that it does not cover the signals
            drawn = envelope(time, every, POINTS)
            most = _FRAME * max(float(np.max(np.abs(difference))), 1e-6)
            frame = np.full(len(drawn[0]), most)
            frame[0] = -most
            handle.data = (*drawn, frame)


_EQUIVALENT = ((REFERENCE, "equivalent current of the phases, plant"), (MONITOR, "monitor"))


class LivePhases(LiveLines):
    """Phase currents, and the equivalent current that they make."""

    def __init__(self, gui: viser.GuiApi, height: int = 279) -> None:
        super().__init__()
        empty = np.array([0.0, 1.0])
        add_html(gui, legend(*((colour, f"phase {name}, plant") for colour, name in zip(PHASES, "ABC"))))
        common = {
            "scales": {"x": {"time": False}, "y": {"auto": True}},
            "legend": {"show": False},
            "cursor": CURSOR,
            "padding": PADDING,
        }
        self._phases: Any = gui.add_uplot(
            data=(empty,) * 4,
            series=({"label": "t [s]"}, *(_line(f"phase {name}", colour) for name, colour in zip("ABC", PHASES))),
            title="Phase currents",
            axes=(time_axis(False), value_axis("A")),
            height=height,
            **common,  # type: ignore[arg-type]
        )
        self._legend: Any = add_html(gui, legend(*_EQUIVALENT))
        self._frozen = False
        self._equivalent: Any = gui.add_uplot(
            data=(empty,) * 4,
            series=(
                {"label": "t [s]"},
                _GHOST_LINE,
                PLANT_LINE,
                _line("monitor", MONITOR),
            ),
            title="Equivalent single-phase current",
            axes=(time_axis(True), value_axis("A")),
            height=height + LAST_MORE_PX,
            **common,  # type: ignore[arg-type]
        )
        self.handles = [self._phases, self._equivalent]

    def lines(self, place: int) -> Lines | None:
        """Without a frozen run, its line lies unseen beneath the plant's."""
        found = super().lines(place)
        if found is None or self._frozen or place == 0:
            return found
        return replace(found, lines=found.lines[1:], difference=(1, 0))

    def show(self, reference: Measurement, monitor: Measurement, ghost: Measurement | None) -> None:
        """Both models on one time base, and the frozen run."""
        if self._frozen != (ghost is not None):
            self._frozen = ghost is not None
            self._legend.content = legend(*_EQUIVALENT, *([(GHOST, "frozen")] if self._frozen else []))
        time_s, current = reference.time_s, reference["current_A"]
        frozen = beneath(at(ghost, "current_A", time_s), current)
        phases = ((f"phase {name}", colour, reference[of]) for name, colour, of in zip("ABC", PHASES, PHASE_SIGNALS))
        equivalent = (
            ("frozen", GHOST, frozen),
            ("plant", REFERENCE, current),
            ("monitor", MONITOR, monitor["current_A"]),
        )
        self.draw(
            [
                Lines.of("Phase currents", "A", time_s, *phases),
                Lines.of("Equivalent single-phase current", "A", time_s, *equivalent, difference=(2, 1)),
            ]
        )


def at(run: Measurement | None, signal: str, time_s: Array) -> Array:
    """A run's signal at other times; NaN where it has none, or there is no run."""
    if run is None:
        return np.full(len(time_s), np.nan)
    return np.interp(time_s, run.time_s, run[signal], left=np.nan, right=np.nan)


def beneath(frozen: Array, shown: Array) -> Array:
    """The frozen line, hidden under the one that is shown where it has no values: uPlot has no gaps in numbers."""
    return np.where(np.isfinite(frozen), frozen, shown)


# A drag of uPlot's own would zoom what is drawn; `emaviz.page.charts` zooms all charts, in full resolution.
CURSOR: Any = {"sync": {"key": "time"}, "drag": {"x": False, "y": False}}


def time_axis(last: bool) -> Any:
    """The axis below a chart: the last of a column has the values and the label, those above it the lines alone."""
    if last:
        return {**AXIS, "label": "Time [s]", "size": 30}
    return {**AXIS, "label": "", "stroke": "#00000000", "size": 30 - _VALUES_PX, "labelSize": 0}


def value_axis(unit: str) -> Any:
    """The axis at the left of a chart."""
    return {**AXIS, "scale": "y", "label": f"[{unit}]", "size": 48, "space": LEAST_SPACE_PX}


def _axes(chart: SignalChart, last: bool) -> Any:
    return time_axis(last), value_axis(chart.unit), _difference_axis(chart.difference_unit)


def _difference_axis(unit: str) -> Any:
    return {
        **value_axis(unit),
        "scale": "difference",
        "side": 1,
        "label": f"Δ [{unit}]",
        "stroke": DIFFERENCE,
        "grid": {"show": False},
    }


AXIS: dict[str, Any] = {
    "stroke": _GREY, "labelSize": _LABEL_PX, "labelGap": 0, "font": "11px system-ui", "labelFont": "12px system-ui",
    "grid": {"stroke": "#86868625", "width": 1}, "ticks": {"stroke": "#86868640", "width": 1, "size": 5},
}  # fmt: skip


def _line(label: str, colour: str) -> Any:
    return {"label": label, "stroke": colour, "width": 1.5, "points": {"show": False}}


# Broad and pale, so that the monitor's line upon it does not hide it.
PLANT_LINE: Any = {**_line("plant", REFERENCE + "a0"), "width": 3.5}
_GHOST_LINE: Any = {**_line("frozen", GHOST), "dash": [5, 3]}


def _series(chart: SignalChart) -> Any:
    series: list[dict[str, Any]] = [
        {"label": "t [s]"},
        {**_line("difference", DIFFERENCE + "b0"), "width": 1, "scale": "difference"},
        _GHOST_LINE,
        PLANT_LINE,
        _line("monitor", MONITOR),
    ]
    if chart.with_command:
        series.append({**_line("command", COMMAND), "width": 1, "dash": [4, 4]})
    # unseen; it sets the range of the difference's axis, which viser cannot change without a new chart
    series.append({**_line("range", "#00000000"), "width": 0, "scale": "difference"})
    return tuple(series)


# --- which signals of a run have a chart, and in which units ----------------------------------------------------------
# Which signals of a run have a chart, and in which units: with the prefix that reads well in the range drawn.


@dataclass(frozen=True)
class SignalChart:
    """What one chart shows, and in which units, which only `fitted` changes: the axis stands still while one drags."""

    signal: str
    title: str
    unit: str
    scale: float
    difference_unit: str
    difference_scale: float
    with_command: bool


_SCALES = {"": 1.0, "m": 1e3, "µ": 1e6}
_MOST, _LEAST = 1000.0, 0.5  # of what is drawn, beyond which another prefix reads better; apart, so that none flickers
_PREFIXES = {  # of the signal, and of a difference in it
    "current_A": ("", ""),
    "user_position_rad": ("m", "µ"),
    "motor_position_rad": ("", "m"),
    "motor_speed_rad_s": ("", ""),
}


def charts(axes: Axes = ROTARY) -> tuple[SignalChart, ...]:
    """A chart for each signal of a run, in the units of these axes."""
    return tuple(
        SignalChart(
            name,
            (signal := of_signal(name, axes)).title,
            f"{prefix}{signal.unit}",
            _SCALES[prefix],
            f"{finer}{signal.unit}",
            _SCALES[finer],
            with_command=name == "user_position_rad",
        )
        for name, (prefix, finer) in _PREFIXES.items()
    )


def fitted(chart: SignalChart, values: Array, difference: Array) -> SignalChart:
    """The chart in units whose numbers read well, of values and of a difference in SI units."""
    plain = chart.unit.removeprefix(_prefix(chart.scale))
    scale, finer = _scale(values, chart.scale), _scale(difference, chart.difference_scale)
    return replace(
        chart,
        unit=_prefix(scale) + plain,
        scale=scale,
        difference_unit=_prefix(finer) + plain,
        difference_scale=finer,
    )


def _scale(values: Array, now: float) -> float:
    """The present one as long as its numbers are neither too large nor too small."""
    most = float(np.max(np.abs(values), initial=0.0))
    if not 0.0 < most < np.inf or _LEAST <= now * most < _MOST:
        return now
    return next((scale for scale in _SCALES.values() if scale * most >= 1.0), max(_SCALES.values()))


def _prefix(scale: float) -> str:
    return next(prefix for prefix, factor in _SCALES.items() if factor == scale)


# --- a run as one figure for documents: four signals of both models, below one another --------------------------------

_RUN_SIGNALS_POINTS = 2500


def run_signals(
    reference: Measurement,
    monitor: Measurement,
    ghost: Measurement | None = None,
    window_s: tuple[float, float] | None = None,
    *,
    axes: Axes = ROTARY,
    dark: bool = False,
) -> go.Figure:
    """Reference, monitor and a frozen run over time, from and to the window's times."""
    every = charts(axes)
    drawn = make_subplots(rows=len(every), cols=1, shared_xaxes=True, vertical_spacing=0.045)
    theme = DARK if dark else LIGHT
    time = reference.time_s
    for row, chart in enumerate(every, 1):
        lines = [
            ("reference model (the plant)", REFERENCE, "solid", reference[chart.signal]),
            ("monitor model", MONITOR, "solid", monitor[chart.signal]),
        ]
        if chart.with_command:
            lines.append(("command", COMMAND, "dot", reference["command_rad"]))
        if ghost is not None:
            lines.append(("frozen run", GHOST, "dash", at(ghost, chart.signal, time)))
        for name, colour, dash, values in lines:
            x, y = line(time, chart.scale * values, _RUN_SIGNALS_POINTS)
            first = row == (2 if name == "command" else 1)
            drawn.add_trace(
                go.Scatter(x=x, y=y, name=name, mode="lines", line={"color": colour, "width": 1.5, "dash": dash},
                           legendgroup=name, showlegend=first),
                row=row, col=1,
            )  # fmt: skip
        drawn.update_yaxes(title_text=f"{chart.title}<br>[{chart.unit}]", row=row, col=1)
    drawn.update_xaxes(title_text="Time [s]", row=len(every), col=1)
    if window_s is not None:
        drawn.update_xaxes(range=list(window_s))
    drawn.update_layout(
        template=theme.template(),
        paper_bgcolor=theme.paper,
        plot_bgcolor=theme.paper,
        margin={"l": 60, "r": 16, "t": 34, "b": 44},
        legend={"orientation": "h", "x": 0.0, "y": 1.02, "yanchor": "bottom"},
    )
    return drawn


# --- a run in numbers: currents, following error, rise time, and how far the monitor is from the plant ----------------

_RISE = "rise time 10–90 %"


@dataclass(frozen=True)
class Metric:
    """A row of the table; `side`: whose axis it is of; `missing`: what is said where there is no number."""

    name: str
    unit: str
    side: Side | None = None
    prefix: str = ""
    missing: str = "diverged"


METRICS = (
    Metric("peak current", "A"),
    Metric("rms current", "A"),
    Metric("largest following error", "rad", USER, "m"),
    Metric("rms following error", "rad", USER, "m"),
    Metric(_RISE, "s", prefix="m", missing="not reached"),
    Metric("peak speed", "rad/s", MOTOR),
)


def metrics(run: Measurement, command: str) -> dict[str, float]:
    """The metrics of a run by name; only a step has a rise time, which is NaN where the user does not get that far."""
    current, user = run["current_A"], run["user_position_rad"]
    error = 1e3 * (run["command_rad"] - user)
    found = {
        "peak current": float(np.max(np.abs(current))),
        "rms current": _rms(current),
        "largest following error": float(np.max(np.abs(error))),
        "rms following error": _rms(error),
        "peak speed": float(np.max(np.abs(run["motor_speed_rad_s"]))),
    }
    return {**found, _RISE: 1e3 * rise_time_s(run)} if command == "step" else found


def rise_time_s(run: Measurement) -> float:
    """From 10 to 90 % of a step, s; NaN where the user does not get that far."""
    demand = run["command_rad"]
    low, high = float(run["user_position_rad"][0]), float(demand[-1])
    if high == low:
        return math.nan
    share = (run["user_position_rad"] - low) / (high - low)
    times = []
    for level in (0.1, 0.9):
        reached = np.flatnonzero(share >= level)
        if not len(reached):
            return math.nan
        i = max(int(reached[0]), 1)
        part = (level - share[i - 1]) / (share[i] - share[i - 1])
        times.append(run.time_s[i - 1] + part * (run.time_s[i] - run.time_s[i - 1]))
    return float(times[1] - times[0])


def differences(reference: Measurement, monitor: Measurement, axes: Axes = ROTARY) -> dict[str, tuple[float, str]]:
    """RMSE of monitor − reference for each chart: by its title, the number and its unit."""
    return {
        chart.title: (chart.difference_scale * _rms(monitor[chart.signal] - reference[chart.signal]),
                      chart.difference_unit)
        for chart in charts(axes)
    }  # fmt: skip


def run_metrics_table(
    runs: Mapping[str, Mapping[str, float]],
    errors: Mapping[str, Mapping[str, tuple[float, str]]],
    colours: list[str],
    axes: Axes = ROTARY,
) -> Html:
    """HTML: the metrics of each run, and below the differences of each pair of runs."""
    right = "text-align:right;font-weight:600"
    heads = joined(html('<th style="{};color:{}">{}</th>', right, colour, name) for name, colour in zip(runs, colours))
    rows = joined(
        html("<tr><td>{} [{}{}]</td>", metric.name, metric.prefix, axes.unit(metric.unit, metric.side))
        + joined(html('<td style="text-align:right">{}</td>', _shown(run, metric)) for run in runs.values())
        + html("</tr>")
        for metric in METRICS
        if any(metric.name in run for run in runs.values())
    )
    heads_below = joined(html('<th style="{}">{}</th>', right, name) for name in errors)
    first = next(iter(errors.values()))
    rows_below = joined(
        html("<tr><td>{} [{}]</td>", title, unit)
        + joined(
            html('<td style="text-align:right">{}</td>', _run_metrics_number(error[title][0], "diverged"))
            for error in errors.values()
        )
        + html("</tr>")
        for title, (_, unit) in first.items()
    )
    style = Html('style="width:100%;border-collapse:collapse;font-variant-numeric:tabular-nums;line-height:1.7"')
    return html(
        '<div style="padding:4px 12px;font-size:13px"><table {}><tr><th></th>{}</tr>{}</table>'
        '<div style="margin-top:14px;font-weight:600">RMSE over the whole run</div>'
        "<table {}><tr><th></th>{}</tr>{}</table></div>",
        style,
        heads,
        rows,
        style,
        heads_below,
        rows_below,
    )


def _rms(values: np.ndarray) -> float:
    largest = float(np.max(np.abs(values)))
    if not math.isfinite(largest) or largest == 0.0:
        return largest
    return largest * float(np.sqrt(np.mean(np.square(values / largest))))  # a diverged run's own squares overflow


def _shown(run: Mapping[str, float], metric: Metric) -> str:
    """A metric in a cell, or why there is no number; a run that lacks one stands beside a step that has it."""
    return _run_metrics_number(run[metric.name], metric.missing) if metric.name in run else "no step"


def _run_metrics_number(value: float, missing: str) -> str:
    return f"{value:.4g}" if math.isfinite(value) else missing


# --- two identifications on the same axes -----------------------------------------------------------------------------
# Two identifications on the same axes: a signal, what each model leaves of it, and how each search converged.

FIRST, SECOND = RUNS
_TWO_RECORDINGS_POINTS = 2000
_ECCENTRICITY, _PHASE = "k6", "k7"  # of which the second means something where the first is seen
_STEPS = [step * 10.0**decade for decade in range(-6, 4) for step in (1, 2, 5)]
_LOG = {"tickvals": _STEPS, "ticktext": [f"{value:g}" for value in _STEPS]}  # in full: Plotly's own have a digit each
_DASHES = ("solid", "dash", "dot", "dashdot")


def signals(*recordings: Recording) -> list[str]:
    """Signals that all of them have in some group, in the first one's order."""
    sets = [[name for group in one.signals.values() for name in group] for one in recordings]
    return [name for name in dict.fromkeys(sets[0]) if all(name in others for others in sets[1:]) and name in SIGNALS]


def two_recordings(
    first: Recording, second: Recording, signal: str, *, window_s: Window | None = None, dark: bool = False
) -> go.Figure:
    """Rows: the signal as recorded (thin) and fitted (bold), the residual, the best error of each iteration.

    window_s: the time that the upper two show, from–to; None: all.
    """
    drawn = make_subplots(rows=3, cols=1, vertical_spacing=0.1, row_heights=[0.4, 0.28, 0.32])
    theme = DARK if dark else LIGHT
    traces = [trace for one in (first, second) for trace in one.identification.values()]
    corrected = all(trace.corrected is not None for trace in traces)  # an older file has none
    over = recorded([("A", FIRST, first), ("B", SECOND, second)], signal)
    for row, one in enumerate(over, 1):
        for each in of_window(one, window_s).lines:
            width = 1.8 if row == 1 and each.dash == "solid" else 1.2
            _add(drawn, row, each.time_s, each.values, each.name, each.colour, each.dash, width, listed=row == 1)
    for recording, colour, name in ((first, FIRST, "A"), (second, SECOND, "B")):
        for place, (algorithm, trace) in enumerate(recording.identification.items()):
            said = plain(f"{name} {algorithm_title(algorithm)}")
            index, errors = trace.iteration, trace.rmse
            if corrected and trace.corrected is not None:
                index, errors = np.arange(len(trace.corrected)), trace.corrected
            _add_search(drawn, index, errors, said, colour, _DASHES[place % len(_DASHES)])
    title, unit = SIGNALS[signal].title, SIGNALS[signal].unit or "-"
    drawn.update_yaxes(title_text=f"{title}<br>[{unit}]", row=1, col=1)
    drawn.update_yaxes(title_text=f"Residual<br>[{unit}]", row=2, col=1)
    which = "Corrected" if corrected else "Uncorrected"
    drawn.update_yaxes(title_text=f"{which}<br>error [A]", type="log", row=3, col=1, **_LOG)
    drawn.update_xaxes(title_text="Time [s]", matches="x", row=2, col=1)
    times = [one.every_time_s[[0, -1]] for one in over if one.lines]
    if times:
        drawn.update_xaxes(range=list(window_s or times[0]), row=1, col=1)
    drawn.update_xaxes(title_text="Iteration", row=3, col=1)
    drawn.update_layout(
        template=theme.template(),
        margin={"l": 66, "r": 12, "t": 8, "b": 0},
        legend={"orientation": "h", "x": 0.02, "xref": "container", "y": 0.0, "yref": "container", "yanchor": "bottom"},
    )
    return drawn


def two_recordings_table(first: Entry, second: Entry) -> Html:
    """HTML: where settings differ, the results, and each k of the best answers."""
    rows = [_row("", _named("A", FIRST), _named("B", SECOND))]
    names = [n for n in dict.fromkeys([*first.settings, *second.settings])]
    for name in names:
        told = [setting(name, one.settings.get(name, "–")) for one in (first, second)]
        if told[0] != told[1]:
            rows.append(_row(told[0][0], told[0][1], told[1][1]))
    if not any(first.settings.get(n) != second.settings.get(n) for n in names) and names:
        rows.append(_row("settings", "the same", "the same"))
    answers = (first.answer, second.answer)
    rows.append(_row("best algorithm", *(algorithm_title(one.best or "–") for one in (first, second))))
    error = error_key(*answers)
    for title, key, form in (
        ("Err [%]", "error_percent", ".2f"),
        (f"{'uncorrected' if error == 'rmse_A' else 'corrected'} error [A]", error, ".4f"),
        ("time [s]", "elapsed_s", ".2f"),
        ("simulations", "evaluations", "d"),
    ):
        rows.append(_row(title, *(_two_recordings_number(answer, key, form) for answer in answers)))
    for i, fault in enumerate(FAULTS):
        values = [answer["k"][i] if answer else None for answer in answers]
        cells = ["–" if value is None else f"{value:.3f}" for value in values]
        known = [value for value in values if value is not None]
        apart = len(known) == 2 and abs(known[0] - known[1]) > 0.02
        if fault.name == _PHASE:
            apart &= all(answer is not None and _ECCENTRICITY in answer["alarms"] for answer in answers)
        mark = html(' style="color:{};font-weight:600"', COLOURS["warning"]) if apart else ""
        rows.append(_row(fault.label, *(html("<span{}>{}</span>", mark, cell) for cell in cells)))
    return html(
        '<div style="padding:4px 10px;font-size:12.5px;font-variant-numeric:tabular-nums">'
        '<table style="width:100%;border-collapse:collapse">{}</table></div>',
        joined(rows),
    )


def _add(
    drawn: go.Figure, row: int, x, y, name: str, colour: str, dash: str, width: float, *, listed: bool = True
) -> None:
    x, y = line(x, y, _TWO_RECORDINGS_POINTS)
    style = {"color": colour, "width": width, "dash": dash}
    drawn.add_trace(
        go.Scatter(x=x, y=y, name=name, mode="lines", line=style, showlegend=listed),
        row=row,
        col=1,
    )


def _add_search(
    drawn: go.Figure, index: NDArray[np.int64], errors: NDArray[np.float64], name: str, colour: str, dash: str
) -> None:
    known: NDArray[np.bool_] = np.isfinite(errors) & (errors > 0.0)
    x = index[known].astype(float)
    drawn.add_trace(
        go.Scatter(x=x, y=errors[known], name=name, mode="lines", line={"color": colour, "dash": dash}),
        row=3,
        col=1,
    )


def _named(name: str, colour: str) -> Html:
    return html('<span style="color:{}">{}</span>', colour, name)


def _two_recordings_number(answer: dict | None, key: str, form: str) -> str:
    value = None if answer is None else answer.get(key)
    return "–" if value is None else f"{value:{form}}"


def _row(name: str, a: str, b: str) -> Html:
    cell = "td" if name else "th"
    right = Html('style="text-align:right;padding:1px 4px;overflow-wrap:anywhere"')
    return html("<tr><td>{}</td><{} {}>{}</{}><{} {}>{}</{}></tr>", name, cell, right, a, cell, cell, right, b, cell)
