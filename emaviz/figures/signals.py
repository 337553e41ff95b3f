"""The live charts of one run: reference, monitor, a frozen run, and the difference on an axis of its own."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

from ema_model.quantities.axes import Axes
from ema_model.recordings import Measurement
from emaviz.colours import COMMAND, DIFFERENCE, GHOST, MONITOR, PHASES, REFERENCE
from emaviz.figures.decimate import envelope
from emaviz.figures.signal_charts import SignalChart, charts, fitted
from emaviz.text.html import Html, add_html, html, joined

Array = NDArray[np.float64]
POINTS = 800  # of a line, at most
PADDING = (10, 4, 0, 0)  # top, right, bottom, left, px: the uppermost tick needs half a line
_GREY = "#868e96"
_VALUES_PX, _LABEL_PX = 22, 16  # of a time axis
LEAST_SPACE_PX = 12  # between two values of an axis, which a low chart needs; `chart_heights.py` gives high ones more
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

    def show(
        self, reference: Measurement, monitor: Measurement, ghost: Measurement | None, window_s: tuple[float, float]
    ) -> None:
        """Draws a run of both models on one time base, and the frozen one, from and to these times."""
        if self._frozen != (ghost is not None):
            self._frozen = ghost is not None
            self._legend.content = legend(*_SHOWN, *([(GHOST, "frozen")] if self._frozen else []))
        shown = _within(reference.time_s, window_s)
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
            lines = [difference, chart.scale * frozen, chart.scale * rm, chart.scale * mm]
            if chart.with_command:
                lines.append(chart.scale * reference["command_rad"][shown])
            # in the middle third of the chart, so that it does not cover the signals
            drawn = envelope(time, lines, POINTS)
            most = _FRAME * max(float(np.max(np.abs(difference))), 1e-6)
            frame = np.full(len(drawn[0]), most)
            frame[0] = -most
            handle.data = (*drawn, frame)


_EQUIVALENT = ((REFERENCE, "equivalent current of the phases, plant"), (MONITOR, "monitor"))


class LivePhases:
    """Phase currents, and the equivalent current that they make."""

    def __init__(self, gui: viser.GuiApi, height: int = 279) -> None:
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

    def show(
        self, reference: Measurement, monitor: Measurement, ghost: Measurement | None, window_s: tuple[float, float]
    ) -> None:
        """As `LiveSignals.show`."""
        if self._frozen != (ghost is not None):
            self._frozen = ghost is not None
            self._legend.content = legend(*_EQUIVALENT, *([(GHOST, "frozen")] if self._frozen else []))
        shown = _within(reference.time_s, window_s)
        time = reference.time_s[shown]
        self._phases.data = envelope(time, [reference[name][shown] for name in PHASE_SIGNALS], POINTS)
        current = reference["current_A"][shown]
        lines = [beneath(at(ghost, "current_A", time), current), current, monitor["current_A"][shown]]
        self._equivalent.data = envelope(time, lines, POINTS)


def at(run: Measurement | None, signal: str, time_s: Array) -> Array:
    """A run's signal at other times; NaN where it has none, or there is no run."""
    if run is None:
        return np.full(len(time_s), np.nan)
    return np.interp(time_s, run.time_s, run[signal], left=np.nan, right=np.nan)


def beneath(frozen: Array, shown: Array) -> Array:
    """The frozen line, hidden under the one that is shown where it has no values: uPlot has no gaps in numbers."""
    return np.where(np.isfinite(frozen), frozen, shown)


# A drag would zoom one chart alone; the window of time above the charts zooms all of them, in full resolution.
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


def _within(time_s: Array, window_s: tuple[float, float]) -> slice:
    """The samples of a window; two at least."""
    first = int(np.searchsorted(time_s, window_s[0] - 1e-9))
    last = int(np.searchsorted(time_s, window_s[1] + 1e-9, side="right"))
    first = min(first, len(time_s) - 2)
    return slice(first, max(last, first + 2))
