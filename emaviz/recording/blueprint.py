"""The layout stored in a recording, so that it opens arranged: only views of what the file holds."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import rerun as rr
import rerun.blueprint as rrb
import rerun_bindings

from ema_model.identification.run import algorithm_title
from emaviz.recording import dashboard
from emaviz.recording.dashboard import Chart
from emaviz.recording.style import (
    ANSWER,
    APPLICATION,
    COMPARISON,
    GROUPS,
    ITERATION,
    K_NAMES,
    K_TITLES,
    SIM_TIME,
    algorithm_path,
    series_title,
    signal_title,
)

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
            dashboard.view(f"{signal_title(name)}: measured, the answer's model", [f"{dashboard.CURVES}/{name}/**"])
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
    """Measured and model of the iteration that is chosen, convergence, all k, and the answer in words."""
    names = list(contents.algorithms)
    fits = [
        dashboard.view(
            f"{signal_title(signal)}: measured, and the best model of this iteration",
            [
                f"{dashboard.axes_path(signal)}/**",
                *(f"{algorithm_path(name)}/fit/{signal}/**" for name in names),
            ],
        )
        for signal in contents.charts
    ]
    convergence = _convergence(names, legend=len(names) > 1, falls=True)
    kinds = ["best", "interval"]
    kinds += ["truth"] if contents.truth else []
    kinds += ["population"] if len(names) == 1 else []  # of several it would hide all else
    views = [
        plot(
            K_TITLES[k],
            [f"{algorithm_path(name)}/{kind}/{k}" for name in names for kind in kinds],
            legend=False,
            linked=False,
            range_=(-0.05, 1.05),
        )
        for k in K_NAMES
    ]
    right: list[rrb.Container | rrb.View] = [rrb.Grid(*views, grid_columns=2)]
    if contents.answer:
        right.insert(0, rrb.TextDocumentView(origin=ANSWER, name="The answer"))
    return rrb.Horizontal(
        rrb.Vertical(*fits, convergence, row_shares=[3.0] * len(fits) + [2.0]),
        rrb.Vertical(*right, row_shares=[3.0, 5.0][-len(right) :]),
        column_shares=[5, 4],
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
    title = "Convergence: log10 of the error of the best [A], corrected once all have ended"
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
