"""The blueprint of a recording: how it opens, its dashboard, and curves that follow the iteration."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
import rerun_bindings
from numpy.typing import ArrayLike, NDArray

from ema_model.identification.run import algorithm_title
from ema_model.quantities import round_numbers
from emaviz import colours
from emaviz.recording.entry import (
    ANSWER,
    APPLICATION,
    COMPARISON,
    DASHBOARD_TITLES,
    GROUPS,
    ITERATION,
    K_NAMES,
    K_TITLES,
    SIM_TIME,
    Colour,
    algorithm_path,
    series_title,
    signal_title,
)

# --- curves over seconds that follow the timeline `iteration` ---------------------------------------------------------
# Curves over seconds that follow the timeline `iteration`: measured and model, drawn as line strips in 2D views.
#
# One timeline serves all views of a recording, so that curves over time beside what happens over iterations cannot be
# plots over time. A 2D view keeps x and y alike and its y points down: what is drawn is scaled by hand.

Array = NDArray[np.float64]

AXES = "/identification_axes"
CURVES = "/curves"  # of the answer, for the tab of signals
POINTS = 600  # of a curve, about
_WIDTH, _HEIGHT = 2.3, 1.0  # as wide as a dashboard's views
_TICKS = 5.0  # of an axis, about
_AIR = 0.08  # of the range, above and below
_GRID, _INK = [134, 142, 150, 90], [134, 142, 150]  # legible on the viewer's own background, light or dark
_MEASURED, _MODEL_WIDTH = (2.6, 1.3), 1.3  # ui points: light and broad beneath, as in the app


@dataclass(frozen=True)
class Chart:
    """Axes: across from first to last, and up from low to high, each in its unit."""

    unit: str
    first: float
    last: float
    low: float
    high: float
    across: str = "s"
    is_log: bool = False  # across: what is given, first and last too, are decimal logarithms

    @staticmethod
    def of(signal: str, time_s: ArrayLike, values: ArrayLike) -> Chart:
        """Axes that hold a measured curve (n,), with air for a model that is off."""
        time, y = np.asarray(time_s, dtype=float), np.asarray(values, dtype=float)
        low, high = float(np.min(y)), float(np.max(y))
        air = _AIR * ((high - low) or abs(high) or 1.0)
        unit = signal_title(signal).rpartition("[")[2].rstrip("]")
        return Chart(unit, float(time[0]), float(time[-1]), low - air, high + air)

    def strip(self, across: ArrayLike, values: ArrayLike) -> Array:
        """A curve's points in the view, (m, 2); what lies beyond the axes is drawn at their edge."""
        x, y = (np.asarray(one, dtype=float) for one in (across, values))
        kept = _peaks(y)
        return self._line(x[kept], np.clip(y[kept], self.low, self.high))

    def log_axes(self, stream: rr.RecordingStream, root: str) -> None:
        """The grid and its numbers, static."""
        at = _round_logarithms(self.first, self.last) if self.is_log else round_numbers(self.first, self.last, _TICKS)
        up = round_numbers(self.low, self.high, _TICKS)
        lines = [self._line([x, x], [self.low, self.high]) for x in at]
        lines += [self._line([self.first, self.last], [y, y]) for y in up]
        grid = rr.LineStrips2D(lines, colors=[_GRID], radii=rr.Radius.ui_points(0.5), draw_order=-1.0)
        stream.log(f"{root}/grid", grid, static=True)
        spots = [(float(line[0][0]), 0.5 * _HEIGHT + 0.08) for line in lines[: len(at)]]
        spots += [(-0.15, float(line[0][1])) for line in lines[len(at) :]]
        told = [10.0**x if self.is_log else x for x in at]
        names = [f"{x:.3g} {self.across}".rstrip() for x in told] + [f"{y:.3g} {self.unit}".rstrip() for y in up]
        ticks = rr.Points2D(spots, labels=names, show_labels=True, colors=[_INK], radii=rr.Radius.ui_points(0.0))
        stream.log(f"{root}/ticks", ticks, static=True)

    def _line(self, x: ArrayLike, y: ArrayLike) -> Array:
        across = (np.asarray(x) - self.first) / ((self.last - self.first) or 1.0) * _WIDTH
        up = (np.asarray(y) - self.low) / (self.high - self.low)
        return np.stack([across, (0.5 - up) * _HEIGHT], axis=1)


def _round_logarithms(first: float, last: float) -> list[float]:
    """Those of 1, 2 and 5 times the powers of ten between two decimal logarithms; of many powers these alone."""
    steps = (1.0, 2.0, 5.0) if last - first < 2.0 else (1.0,)
    every = [n + math.log10(step) for n in range(math.floor(first), math.ceil(last) + 1) for step in steps]
    return [one for one in every if first - 1e-9 <= one <= last + 1e-9]


def measured(points: Array) -> rr.LineStrips2D:
    """The measured curve, broad and pale beneath the model's."""
    colour = [*colours.rgb(colours.REFERENCE), 150]
    return rr.LineStrips2D([points], colors=[colour], radii=rr.Radius.ui_points(_MEASURED[0]), draw_order=0.0)


def model(points: Array, colour: Colour, width: float = _MODEL_WIDTH) -> rr.LineStrips2D:
    """A model's curve; width in ui points."""
    return rr.LineStrips2D([points], colors=[colour], radii=rr.Radius.ui_points(width), draw_order=1.0)


def name_at(point: Array, name: str, colour: Colour) -> rr.Points2D:
    """The name of a curve, beside one of its points (2,)."""
    return rr.Points2D([point], labels=[name], show_labels=True, colors=[colour], radii=rr.Radius.ui_points(2.0))


def model_columns(points: Array, colour: Colour) -> Any:
    """The same for `send_columns`, in one row; a negative radius is in ui points."""
    return rr.LineStrips2D.columns(strips=[points], colors=[colour], radii=[-_MODEL_WIDTH], draw_order=[1.0])


def fit_path(algorithm: str, signal: str, which: str) -> str:
    """'/identification/hba/fit/current_A/model'."""
    return f"{algorithm_path(algorithm)}/fit/{signal}/{which}"


def axes_path(signal: str) -> str:
    """Where a signal's grid is."""
    return f"{AXES}/{signal}"


def view(title: str, paths: Sequence[str]) -> rrb.Spatial2DView:
    """Entities of one signal in one picture."""
    bounds = rrb.VisualBounds2D(x_range=(-0.3, _WIDTH + 0.08), y_range=(-0.58, 0.7))
    return rrb.Spatial2DView(origin="/", contents=list(paths), name=title, visual_bounds=bounds)


def _peaks(values: Array) -> NDArray[np.intp]:
    """About POINTS places that keep a curve's peaks: of each stretch its least and its largest, in their order."""
    if len(values) <= POINTS:
        return np.arange(len(values))
    edges = np.linspace(0, len(values), POINTS // 2 + 1).astype(int)
    kept = {0, len(values) - 1}
    for first, last in pairwise(edges):
        part = values[first:last]
        kept |= {first + int(np.argmin(part)), first + int(np.argmax(part))}
    return np.array(sorted(kept), dtype=np.intp)


# --- the layout stored in a recording, so that it opens arranged: only views of what the file holds -------------------

# What the Signals tab shows, above the rest; a view each, with every group that has the signal.
_MAIN = ("current_A", "user_position_rad", "motor_position_rad", "motor_speed_rad_s")
_BESIDE = ("residual", "floor_high", "floor_low")  # in plots of their own, not in the signal's
_PHASES = ("phase_a_current_A", "phase_b_current_A", "phase_c_current_A")
_TOP, _BOTTOM = rrb.Corner2D.RightTop, rrb.Corner2D.RightBottom


@dataclass
class Algorithm:
    """What a recording holds of one identification."""

    iterations: bool = False
    monitor: bool = False
    result: bool = False


@dataclass
class Contents:
    """What a recording holds: signal names per group, identifications, configuration."""

    signals: dict[str, list[str]] = field(default_factory=dict)
    algorithms: dict[str, Algorithm] = field(default_factory=dict)
    config: bool = False
    charts: dict[str, Chart] = field(default_factory=dict)  # signals drawn beside the model of each iteration
    curves: dict[str, Chart] = field(default_factory=dict)  # signals drawn over time, for any timeline
    answer: bool = False
    truth: bool = False
    findings: list[str] = field(default_factory=list)  # of a comparison: names of documents below /comparison

    def groups_with(self, name: str) -> list[str]:
        """The groups that have this signal, the residual and its floor (plots of their own) apart."""
        return [group for group in GROUPS if group not in _BESIDE and name in self.signals.get(group, ())]

    def names(self) -> list[str]:
        """Every signal's name once, in the order in which they came."""
        return list(dict.fromkeys(name for names in self.signals.values() for name in names))


def build(contents: Contents) -> rrb.Blueprint:
    """The layout: tabs Signals, More signals, Identification, Configuration, as far as there is something in them.

    A comparison has Where it fails, Overlay and Residuals in the place of Signals.  An identification with curves of
    its iterations opens on a dashboard of them, all its algorithms in one.
    """
    if contents.charts:
        return _identification(contents)
    tabs: list[rrb.Container | rrb.View] = []
    if contents.findings:
        tabs += _comparison_tabs(contents)
    else:
        signals = _signals_tab(contents)
        if signals is not None:
            tabs.append(signals)
    more = _more_tab(contents)
    if more is not None:
        tabs.append(more)
    for name, algorithm in contents.algorithms.items():
        if algorithm.monitor:
            tabs.append(_fit_tab(name, contents))
        if algorithm.iterations or algorithm.result:
            tabs.append(_identification_tab(name, algorithm))
    if contents.config:
        tabs.append(rrb.TextDocumentView(origin="/config", name="Configuration"))
    return arranged(contents, tabs)


def _identification(contents: Contents) -> rrb.Blueprint:
    tabs: list[rrb.Container | rrb.View] = [_dashboard(contents)]
    if contents.curves:
        views = [
            view(f"{signal_title(name)}: measured, the answer's model", [f"{CURVES}/{name}/**"])
            for name in contents.curves
        ]
        tabs.append(rrb.Grid(*views, grid_columns=2, name="Signals"))
    results = [
        rrb.TextDocumentView(origin=f"{algorithm_path(name)}/result", name=algorithm_title(name))
        for name, one in contents.algorithms.items()
        if one.result
    ]
    if results:
        tabs.append(rrb.Horizontal(*results, name="Results"))
    if contents.config:
        tabs.append(rrb.TextDocumentView(origin="/config", name="Settings"))
    # On the timeline it opens with, plots over time are empty: only what has no static curves needs them.
    over_time = None if contents.curves else _signals_tab(contents)
    if over_time is not None:
        over_time.name = "Over time (below, choose the timeline: sim_time)"
        tabs.append(over_time)
    return arranged(contents, tabs, timeline=ITERATION)


def _dashboard(contents: Contents) -> rrb.Container:
    """Measured and model of the iteration that is chosen, the answer in words, convergence, all k in four columns."""
    names = list(contents.algorithms)
    fits = [
        view(
            f"{signal_title(signal)}: measured, best model",
            [
                f"{axes_path(signal)}/**",
                *(f"{algorithm_path(name)}/fit/{signal}/**" for name in names),
            ],
        )
        for signal in contents.charts
    ]
    kinds = ["best", "interval"]
    kinds += ["truth"] if contents.truth else []
    kinds += ["population"] if len(names) == 1 else []  # of several it would hide all else
    views = [
        plot(
            DASHBOARD_TITLES[k],
            [f"{algorithm_path(name)}/{kind}/{k}" for name in names for kind in kinds],
            legend=False,
            linked=False,
            range_=(-0.05, 1.05),
        )
        for k in K_NAMES
    ]
    right: list[rrb.Container | rrb.View] = [_convergence(names, legend=len(names) > 1, falls=True)]
    if contents.answer:
        right.insert(0, rrb.TextDocumentView(origin=ANSWER, name="The answer"))
    return rrb.Vertical(
        rrb.Horizontal(
            rrb.Vertical(*fits), rrb.Vertical(*right, row_shares=[3.0, 2.0][-len(right) :]), column_shares=[5, 4]
        ),
        rrb.Grid(*views, grid_columns=4),
        row_shares=[2.0, 1.0],
        name="Identification",
    )


def arranged(
    contents: Contents,
    tabs: Sequence[rrb.Container | rrb.View],
    active: int = 0,
    timeline: str | None = None,
) -> rrb.Blueprint:
    """A layout of these tabs, its panels folded away; timeline: that it opens on, at its end."""
    return rrb.Blueprint(
        rrb.Tabs(*tabs, active_tab=active if tabs else None),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(
            state="collapsed",
            timeline=timeline or (SIM_TIME if contents.signals else ITERATION),
            # A sequence timeline would start to play on its own; one that follows stands at its end.
            play_state="Following" if timeline else "Paused",
        ),
        auto_views=False,
        auto_layout=False,
    )


def send(stream: rr.RecordingStream, layout: rrb.Blueprint) -> None:
    """Stores the layout in a recording.

    As `stream.send_blueprint`, but that leaves two threads behind for each layout: the stream that it makes for it is
    never disconnected.
    """
    made = rr.RecordingStream._from_native(
        rerun_bindings.new_blueprint(
            application_id=APPLICATION, make_default=False, make_thread_default=False, default_enabled=True
        )
    )
    made.set_time("blueprint", sequence=0)
    layout._log_to_stream(made)
    memory = made.memory_recording()
    rerun_bindings.send_blueprint(memory.storage, True, True, recording=stream.to_native())
    made.disconnect()


def _signals_tab(contents: Contents) -> rrb.Container | None:
    views = [signal_view(contents, name) for name in _MAIN if contents.groups_with(name)]
    residual = contents.signals.get("residual", [])
    if "current_A" in residual:
        views.append(_residual_view(contents, "current_A"))
    if not views:
        return None
    top, rest = views[0], views[1:]
    rows = [rrb.Horizontal(*rest[i : i + 2]) for i in range(0, len(rest), 2)]
    return rrb.Vertical(top, *rows, row_shares=[1.4] + [1.0] * len(rows), name="Signals")


def _comparison_tabs(contents: Contents) -> list[rrb.Container | rrb.View]:
    compared = _compared(contents)
    text = [rrb.TextDocumentView(origin=f"{COMPARISON}/{name}", name=name.capitalize()) for name in contents.findings]
    first = [_residual_view(contents, name) for name in compared[:1]]
    tabs: list[rrb.Container | rrb.View] = [rrb.Horizontal(rrb.Vertical(*text), *first, name="Where it fails")]
    if compared:
        tabs.append(rrb.Vertical(*(signal_view(contents, name) for name in compared), name="Overlay"))
        tabs.append(rrb.Vertical(*(_residual_view(contents, name) for name in compared), name="Residuals"))
    return tabs


def _compared(contents: Contents) -> list[str]:
    """The signals that have a residual, in their order: the one that is explained comes first."""
    return contents.signals.get("residual", [])


def _more_tab(contents: Contents) -> rrb.Container | None:
    views = []
    phases = [f"/{g}/{name}" for name in _PHASES for g in contents.groups_with(name)]
    if phases:
        views.append(plot("Phase currents [A]", phases))
    shown = _compared(contents) if contents.findings else list(_MAIN)
    others = [name for name in contents.names() if name not in [*shown, *_PHASES] and contents.groups_with(name)]
    views += [signal_view(contents, name) for name in others]
    if not contents.findings:
        views += [
            _residual_view(contents, name) for name in contents.signals.get("residual", []) if name != "current_A"
        ]
    return rrb.Grid(*views, name="More signals") if views else None


def _fit_tab(name: str, contents: Contents) -> rrb.View:
    targets = [f"/{group}/current_A" for group in contents.groups_with("current_A") if group != "monitor"]
    return plot(f"Fit {name}: MM current through the iterations [A]", [*targets, f"{algorithm_path(name)}/monitor/**"])


def _identification_tab(name: str, algorithm: Algorithm) -> rrb.Container:
    root = algorithm_path(name)
    left: list[rrb.Container | rrb.View] = []
    right: list[rrb.Container | rrb.View] = []
    if algorithm.iterations:
        left.append(_convergence([name]))
        right.append(rrb.Grid(*(_k_view(root, k) for k in K_NAMES), grid_columns=2))
    if algorithm.result:
        left.append(rrb.TextDocumentView(origin=f"{root}/result", name="Result"))
    # Every plot follows the one timeline chosen below, and a file has no means to change it with the tab.
    title = f"Identification {name} (below, choose the timeline: iteration)"
    shares = [2, 3] if right else None
    return rrb.Horizontal(rrb.Vertical(*left), *right, column_shares=shares, name=title)


def _convergence(names: Iterable[str], *, legend: bool = False, falls: bool = False) -> rrb.TimeSeriesView:
    """The best error of each iteration; the corrected one takes the other's place once it is there."""
    kinds = ("log10_rmse", "log10_corrected_error")
    paths = [f"{algorithm_path(name)}/{kind}" for name in names for kind in kinds]
    title = "Convergence: log10 of error [A]"
    return plot(title, paths, legend=legend, linked=False, falls=falls)


def _k_view(root: str, k: str) -> rrb.TimeSeriesView:
    contents = [f"{root}/population/{k}", f"{root}/truth/{k}", f"{root}/best/{k}"]
    return plot(K_TITLES[k], contents, legend=False, linked=False, range_=(-0.05, 1.05))


def signal_view(contents: Contents, name: str) -> rrb.TimeSeriesView:
    """A signal of every group that has it, in one plot."""
    paths = [f"/{group}/{name}" for group in contents.groups_with(name)]
    return plot(signal_title(name), paths, falls=not name.endswith("position_rad"))


def _residual_view(contents: Contents, name: str) -> rrb.TimeSeriesView:
    paths = [f"/{group}/{name}" for group in _BESIDE if name in contents.signals.get(group, ())]
    return plot(series_title("residual", name), paths)


def plot(
    title: str,
    paths: list[str],
    *,
    legend: bool = True,
    linked: bool = True,
    range_: tuple[float, float] | None = None,
    falls: bool = False,
) -> rrb.TimeSeriesView:
    """Entities over time in one plot; linked: with the same part of time as all others that are.

    falls: as an error, a speed or a current does in the end, which leaves room for the legend above; a position below.
    """
    return rrb.TimeSeriesView(
        origin="/",
        contents=paths,
        name=title,
        axis_x=rrb.TimeAxis(link="LinkToGlobal" if linked else "Independent"),
        axis_y=None if range_ is None else rrb.ScalarAxis(range=range_),
        plot_legend=rrb.PlotLegend(corner=_TOP if falls else _BOTTOM, visible=legend),
    )
