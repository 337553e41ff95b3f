"""What a comparison has found: its sentences, charts, and the moment that is looked at."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import plotly.graph_objects as go
import viser

from ema_model.actuator import Actuator
from ema_model.comparison.regions import Region, worst_moment
from ema_model.comparison.result import FLOOR_NOTE, Compared, Comparison, details, errors, errors_by_recording, of_floor
from ema_model.errors import InputError
from ema_model.estimation.calibrate import calibration_table, together
from ema_model.estimation.noise import BAND_SIGMAS
from ema_model.faults import HEALTHY
from ema_model.quantities import VARIABLES
from ema_model.recordings import Measurement
from emaviz.figures import campaign, lines, runs
from emaviz.figures import comparison as comparison_figures
from emaviz.figures.lines import Lines, Window, clipped
from emaviz.figures.theme import why_missing
from emaviz.page.charts import hint, marked
from emaviz.page.compare_columns import MappingStep
from emaviz.page.panel import Cleared, Example
from emaviz.page.playback import PlaybackStrip
from emaviz.page.style import IN_PAIRS
from emaviz.page.window_layout import ALL_COLUMNS, NEXT_COLUMN, PLOTS_EARLY, ROOM
from emaviz.page.workspaces import Page, Workspace
from emaviz.scene.playback import Motion, motion
from emaviz.server.viser_private import selector_of
from emaviz.session.files import Opened
from emaviz.text.html import Html, add_html, begin, explained, html, joined, note, unescaped
from emaviz.text.verdicts import folded, large, of_comparison, shown, warned

WORKSPACE = Workspace("compare", "Compare", viser.Icon.ARROWS_DIFF, 3)


# --- a compared recording on the 3D actuator: as measured, the screw glowing where the model fails --------------------

_FULL = 4.0  # times its floor, at which a residual glows fully; it begins where the charts' band ends


def motion_of(comparison: Comparison, compared: Compared, actuator: Actuator) -> Motion | None:
    """What was measured of it, and of the model what was not; None without a motor position, as of a static map."""
    signals = {**compared.model, **compared.measured}
    motor = signals.get("motor_position_rad")
    if motor is None or comparison.residuals.is_map or len(compared.time_s) < 2:
        return None
    still = np.zeros_like(motor)
    time_s = compared.time_s
    run = Measurement(
        {
            "time_s": time_s,
            "current_A": signals.get("current_A", still),
            "motor_position_rad": motor,
            "motor_speed_rad_s": np.gradient(motor, time_s),
            "user_position_rad": signals.get("user_position_rad", actuator.transmission.gear_ratio * motor),
        },
        compared.name,
    )
    shown = motion(run, HEALTHY, actuator)
    name = comparison.primary
    if name not in compared.measured or not comparison.worst_regions:
        return shown  # nothing stands out, and of noise nothing glows
    error = np.abs(compared.measured[name] - compared.model[name]) / compared.sigma[name]
    glow = np.clip((error - BAND_SIGMAS) / (_FULL - BAND_SIGMAS), 0.0, 1.0)
    says = f"Screw red where the model fails (from {BAND_SIGMAS:g} × floor, full from {_FULL:g} ×)."
    return replace(shown, heat=glow, says=says)


# --- the plots of a comparison, in tabs; a chosen region and moment are marked in every one of them -------------------

_PLOTS_CONFIG = {"displayModeBar": False}
_FIRST = next(iter(VARIABLES))
_EMPTY = "–"


@dataclass(frozen=True, eq=False)
class View:
    """What the plots show."""

    comparison: Comparison
    recording: int = 0
    region: Region | None = None
    moment_s: float | None = None
    together: bool = False  # all recordings over each other, over time


@dataclass
class _Plot:
    """A place of a figure on the page, and of the line that says why there is none; aspect is height over width."""

    draw: Callable[[View], go.Figure]
    aspect: float
    handle: Any
    why: Any


class ComparePlots:
    """Tabs over time, against a variable, over the motor's turn, what explains it, and the calibration.

    Everything is drawn on the screen's thread.
    """

    def __init__(self, page: Page) -> None:
        self._page = page
        self._view: View | None = None
        self._window: Window | None = None  # of time, that is shown; None: all
        gui = page.server.gui
        self._signal = gui.add_dropdown("Signal", [_EMPTY])
        self._titles: dict[str, str] = {}
        self._variables: dict[str, str] = {}
        tabs = gui.add_tab_group()
        with tabs.add_tab("Time", viser.Icon.CHART_LINE):
            add_html(gui, hint())
            self._time = [
                self._add(lambda v: self._draw_time(v, comparison_figures.overlay, 0), 0.42),
                self._add(lambda v: self._draw_time(v, comparison_figures.residual_time, 1), 0.42),
            ]
            page.measuring.add([plot.handle for plot in self._time], self._lines, self._zoom)
        with tabs.add_tab("Against", viser.Icon.CHART_DOTS):
            self._variable = gui.add_dropdown("Variable", [_EMPTY])
            self._against = [self._add(self._draw_against, 0.66)]
        with tabs.add_tab("Orders", viser.Icon.ROTATE_CLOCKWISE):
            self._turn = [
                self._add(lambda v: comparison_figures.order_spectrum(v.comparison, highlight=v.region), 0.42),
                self._add(
                    lambda v: comparison_figures.residual_polar(v.comparison, self._chosen(), highlight=v.region), 0.8
                ),
            ]
        with tabs.add_tab("Explained by", viser.Icon.QUESTION_MARK):
            self._why = [self._add(lambda v: comparison_figures.explained(v.comparison, highlight=v.region), 0.7)]
        with tabs.add_tab("Calibration", viser.Icon.TARGET):
            self._fit = [self._add(lambda v: campaign.calibration_scores(v.comparison), 0.8)]
            self._numbers = add_html(gui)
        page.changed(self._signal, lambda: self._draw([*self._time, *self._against, *self._turn]))
        page.changed(self._variable, lambda: self._draw(self._against))

    def add_against(self) -> None:
        """The figure of `Against` a second time, at this place of the page."""
        self._against.append(self._add(self._draw_against, 0.36))

    def begin(self, view: View) -> None:
        """A new comparison: its signals and variables to choose from, the telling ones first."""
        self._view, self._window = view, telling_window(view)
        comparison = view.comparison
        self._titles = {
            comparison_figures.quantity_of_signal(comparison, name).title: name
            for name in comparison.recordings[0].measured
        }
        self._signal.options = tuple(self._titles)
        known = [name for name in VARIABLES if name in comparison.residuals.variables]
        self._variables = {comparison_figures.of_variable(comparison, name).title: name for name in known}
        self._variable.options = tuple(self._variables) or (_EMPTY,)
        first = comparison.explained_by[0].variable if comparison.explained_by else ""
        self._choose(comparison.primary, first)
        fit = comparison.calibration
        table = shown(calibration_table(fit, comparison.actuator.axes) if fit is not None else None)
        said = " ".join(together(fit, comparison.actuator.axes)) if fit is not None else ""
        self._numbers.content = html(
            '<div style="overflow-x:auto;font-size:11px;padding:0 2px">{}<p>{}</p></div>', table, said
        )
        self._draw(list(self._all()))

    def show(self, view: View) -> None:
        """Another region, moment or recording of the same comparison."""
        before, self._view = self._view, view
        if before is None or (view.recording, view.together) != (before.recording, before.together):
            self._window = telling_window(view)
        if view.moment_s is not None and self._window and not self._window[0] <= view.moment_s <= self._window[1]:
            self._window = None
        if view.region is not None:
            self._choose(view.region.signal, view.region.variable)
        self._draw(list(self._all()))

    def move(self, view: View) -> None:
        """Only the play-head has moved."""
        self._view = view
        self._draw(self._time)

    def _choose(self, signal: str, variable: str) -> None:
        for dropdown, names, wanted in (
            (self._signal, self._titles, signal),
            (self._variable, self._variables, variable),
        ):
            title = next((title for title, name in names.items() if name == wanted), None)
            if title is not None and dropdown.value != title:
                dropdown.value = title

    def _chosen(self) -> str | None:
        return self._titles.get(str(self._signal.value))

    def _signal_shown(self, view: View) -> str:
        return self._chosen() or view.comparison.primary

    def _every(self, view: View) -> list[Lines]:
        """What the plots over time draw, from above."""
        signal = self._signal_shown(view)
        if view.together:
            return runs.together(view.comparison, signal)
        return runs.compared(view.comparison, signal, view.recording)

    def _lines(self, place: int) -> Lines | None:
        found = self._every(self._view) if self._view is not None else []
        return found[place] if place < len(found) else None

    def _zoom(self, window_s: Window | None) -> None:
        one = self._lines(0)
        if one is not None:
            self._window = clipped(window_s, one.every_time_s)
            self._draw(self._time)

    def _draw_time(self, view: View, draw: Callable[..., go.Figure], place: int) -> go.Figure:
        if view.together:
            figure = lines.drawn(self._every(view)[place], self._window)
        else:
            figure = draw(
                view.comparison,
                self._chosen(),
                view.recording,
                highlight=view.region,
                moment_s=view.moment_s,
                window_s=self._window,
            )
        if why_missing(figure):
            return figure
        times = self._every(view)[place].every_time_s[[0, -1]]
        figure.update_xaxes(range=list(self._window or times))  # Plotly forgets nothing but what it is told anew
        return marked(figure, self._time[place].handle)

    def _draw_against(self, view: View) -> go.Figure:
        variable = self._variables.get(str(self._variable.value), _FIRST)
        return comparison_figures.residual_against(view.comparison, variable, self._chosen(), highlight=view.region)

    def _add(self, draw: Callable[[View], go.Figure], aspect: float) -> _Plot:
        """A plot at this place of the page; it is drawn when there is something to draw."""
        gui = self._page.server.gui
        handle = gui.add_plotly(go.Figure(), config=_PLOTS_CONFIG, aspect=aspect, visible=False)
        return _Plot(draw, aspect, handle, add_html(gui, visible=False))

    def _all(self) -> Iterator[_Plot]:
        for group in (self._time, self._against, self._turn, self._why, self._fit):
            yield from group

    def _draw(self, plots: list[_Plot]) -> None:
        if self._view is None:
            return
        for plot in plots:
            figure = plot.draw(self._view)
            why = why_missing(figure)
            if why:
                plot.why.content = note(why)
            else:
                plot.handle.figure = figure
            for one, seen in ((plot.handle, not why), (plot.why, bool(why))):
                if one.visible != seen:
                    one.visible = seen


_TELLING = 0.25  # of a recording: an event shorter than that fills the plots by itself


def telling_window(view: View) -> Window | None:
    """What the plots over time show at first: a step's few per cent in which something happens; None: all."""
    one = view.comparison.recordings[view.recording]
    if view.together or view.comparison.residuals.is_map:
        return None
    window = runs.event_of_recording(one)
    if window is None or window[1] - window[0] > _TELLING * float(one.time_s[-1] - one.time_s[0]):
        return None
    return window


# --- the comparison on the right: the answer in words, where the model fails, and the plots ---------------------------

_BOX = Html('style="padding:2px 12px 6px;font-size:13px;line-height:1.45"')
_CARD = "height:auto!important;min-height:2em;padding:4px 8px;font-weight:400;font-size:13px;"
_RESTING = (
    "background:rgba(134,142,150,.13)!important;color:inherit!important;border-left:3px solid rgba(134,142,150,.5);"
)
_CHOSEN = "background:rgba(224,49,49,.14)!important;color:inherit!important;border-left:3px solid #e03131;"
_CONFIG = {"displayModeBar": False, "responsive": False}
_TOGETHER = "all, over each other"
_PLAYING_REDRAW_S, _LEAST_MOVE_S = 1.0, 1e-4

_STEPS = (
    "Upload a measurement of a test bench, or drop a file anywhere on the page: CSV, Parquet, MATLAB, HDF5, TDMS, MDF, "
    "ULog, MCAP and more. Columns and units are recognised; you can correct them.",
    "The actuator's parameters are calibrated within their tolerances, and the model is run with the same command.",
    "You see where the model fails and what its residual depends on, beside the noise floor.",
)


_EXAMPLE = "Run an example", "Four recordings of a rig after its overhaul, one of them held out; some seconds."


class ResultPanel:
    """Everything here is built and changed on the screen's thread.

    strip: its clock, for Compare's recording on the 3D actuator; step(preview): adds what a file's columns are, above
    the preview; leads(): adds what may follow, below the answer; keep(): adds what saves a comparison, below the plots.
    """

    def __init__(
        self,
        page: Page,
        strip: PlaybackStrip,
        step: Callable[[Callable[[Opened, str], None]], MappingStep],
        leads: Callable[[], object],
        keep: Callable[[], Cleared],
        example: Callable[[], object],
    ) -> None:
        """example(): opens what is shipped to try it on."""
        self._page, self._strip = page, strip
        self._drawn_at = 0.0
        self._comparison: Comparison | None = None
        self._time_s = 0.0  # where the clock stood when the plots were drawn last
        self._region: Region | None = None
        self.wanted: int | None = None  # the place of the region that is chosen once there is a comparison
        self._mapped: list[Lines] = []  # what the preview draws
        self._buttons: list[Any] = []
        gui = page.server.gui
        self._empty = begin("Nothing is compared yet", _STEPS, Example(page, *_EXAMPLE, example).html)
        self._headline = add_html(gui, self._empty)
        add_html(gui, PLOTS_EARLY)
        self._next = gui.add_folder("Next", visible=False)
        with self._next:
            add_html(gui, IN_PAIRS)
            leads()
        self._place = gui.add_folder("The file's columns", visible=False)
        with self._place:
            add_html(gui, ALL_COLUMNS)
            self.step = step(self.preview)
            self._preview: Any = gui.add_plotly(go.Figure(), config=_CONFIG, visible=False)
            self.step.add_lines()
        self._answer = gui.add_folder("Where the model fails", visible=False)
        with self._answer:
            self._hint = add_html(gui)
            self._style = add_html(gui)
        self._numbers = add_html(gui, visible=False)  # after the sentences
        self._evidence = gui.add_folder("What the residual depends on", visible=False)
        self._plots_folder = gui.add_folder("Plots", visible=False)
        with self._plots_folder:
            add_html(gui, NEXT_COLUMN)
            self._recording = gui.add_dropdown("Measurement", ["–"], visible=False)
            self._plots = ComparePlots(page)
        with self._evidence:  # below the sentences that it shows, where that would stay empty
            add_html(gui, ROOM)
            self._plots.add_against()
        self._save = gui.add_folder("Keep it", visible=False)
        with self._save:
            self._kept = keep()
        strip.moves.connect(self._moved)
        page.changed(self._recording, self._show_recording)

    # --- before a comparison ----------------------------------------------------------------------------------------

    def preview(self, opened: Opened, plotted: str = "") -> None:
        """The signals of a file as they are mapped now, below one of its columns, if any, as it stands there."""
        said, self._mapped = "as its columns are read", []
        if plotted in opened.columns:
            self._mapped.append(comparison_figures.raw_column(opened.columns, opened.mapping, plotted))
        try:
            self._mapped += comparison_figures.mapped_lines(opened.columns, opened.mapping)
        except InputError as error:
            said = "no table is found in it" if opened.problem else str(error)
        if self._mapped:
            self._draw_preview(None)
        else:
            self._preview.visible = False
        self._headline.content = html("<div {}><b>{}</b>, {}</div>", _BOX, opened.path.name, said)
        self._place.visible = True
        self._show_answer(False)

    def _draw_preview(self, window_s: Window | None) -> None:
        times = self._mapped[0].lines[0].time_s
        over_time = self._mapped[0].time == "Time [s]" and bool(np.all(np.diff(times) > 0.0))  # which NaN is not
        window_s = clipped(window_s, times) if over_time else None
        figure, aspect = comparison_figures.mapped_columns(self._mapped, window_s)
        if over_time:
            rows = len(self._mapped)
            self._page.measuring.add_rows(self._preview, rows, self._mapped_at, self._draw_preview)
            marked(figure, self._preview, rows)
        self._preview.figure, self._preview.aspect, self._preview.visible = figure, aspect, True

    def _mapped_at(self, place: int) -> Lines | None:
        return self._mapped[place] if place < len(self._mapped) else None

    def end_preview(self) -> None:
        """Back to the comparison, if there is one."""
        if self._comparison is not None:
            self._place.visible = False
            self._headline.content = headline(self._comparison)
            self._numbers.content = numbers(self._comparison)
            self._show_answer(True)

    def forget_preview(self) -> None:
        """The file that was shown is gone: back to the comparison, or to what the empty screen says."""
        if self._comparison is None:
            self.clear()
        else:
            self.end_preview()

    def clear(self) -> None:
        """Nothing is compared any more."""
        self._comparison = self._region = None
        self._place.visible = False
        self._headline.content = self._empty
        self._show_answer(False)
        self._strip.put(None, WORKSPACE.name)

    def _show_answer(self, visible: bool) -> None:
        for folder in (
            self._numbers,
            self._answer,
            self._evidence,
            self._next,
            self._plots_folder,
            self._save,
        ):
            folder.visible = visible

    # --- the comparison ---------------------------------------------------------------------------------------------

    def show(self, comparison: Comparison) -> None:
        """A new comparison takes the place of the old one."""
        self._comparison, self._region = comparison, None
        with self._page.server.atomic():
            self._list_regions(comparison)
            self.end_preview()
            names = [f"{i + 1}. {one.name}" for i, one in enumerate(comparison.recordings)]
            several = len(names) + len(comparison.holdout) > 1 and not comparison.residuals.is_map
            self._recording.options = [*names, *([_TOGETHER] if several else [])]
            self._recording.value, self._recording.visible = names[0], several or len(names) > 1
            self._kept.clear()
        self._put(0)
        self._plots.begin(View(comparison))
        if self.wanted is not None:
            self.select(self.wanted)
            self.wanted = None

    @property
    def selected(self) -> int | None:
        """The place of the chosen region in the list; None for none."""
        regions = self._comparison.worst_regions if self._comparison is not None else []
        return next((i for i, one in enumerate(regions) if one is self._region), None)

    def select(self, index: int) -> None:
        """Highlights a region in every plot, and moves the play-head and the actuator to its worst moment."""
        comparison = self._comparison
        if comparison is None or not 0 <= index < len(comparison.worst_regions):
            return
        region = comparison.worst_regions[index]
        self._region = region
        recording, block = worst_moment(comparison.residuals, region)
        time_s = float(comparison.residuals.time_s[block])
        self._style_regions(index)
        self._recording.value = self._recording.options[recording]
        self._put(recording, time_s)
        self._plots.show(View(comparison, recording, region, time_s))

    def _list_regions(self, comparison: Comparison) -> None:
        for button in self._buttons:
            button.remove()
        self._buttons = []
        found = len(comparison.worst_regions)
        text = "Click one: the plots and the actuator go there." if found else "No region stands out of the floor."
        self._hint.content = html('<div {}><span style="opacity:.65">{}</span></div>', _BOX, text)
        with self._answer:
            for i, region in enumerate(comparison.worst_regions):
                button = self._page.server.gui.add_button(
                    region.sentence, icon=viser.Icon.FOCUS_2, hint=details(comparison, region)
                )
                self._page.pressed(button, partial(self.select, i))
                self._buttons.append(button)
        self._style_regions(None)

    def _style_regions(self, chosen: int | None) -> None:
        """viser's buttons have one line; a region's sentence is longer, so they become a list of cards."""
        rules = []
        for i, button in enumerate(self._buttons):
            one = selector_of(button)
            colours = _CHOSEN if i == chosen else _RESTING
            rules.append(f"{one}{{{_CARD}{colours}}}{one} .mantine-Button-inner{{justify-content:flex-start}}")
            rules.append(f"{one} .mantine-Button-label{{white-space:normal;text-align:left;line-height:1.3}}")
        self._style.content = unescaped(f"<style>{''.join(rules)}</style>")

    def _put(self, recording: int, time_s: float | None = None) -> None:
        """Another recording on the actuator, at a moment or at its start."""
        comparison = self._comparison
        assert comparison is not None
        one = comparison.recordings[recording]
        self._time_s = float(one.time_s[0]) if time_s is None else time_s
        self._strip.put(motion_of(comparison, one, comparison.actuator), WORKSPACE.name, self._time_s)

    def _at(self) -> int:
        options = list(self._recording.options)
        return (
            options.index(self._recording.value) if self._recording.value in options and not self._all_together() else 0
        )

    def _all_together(self) -> bool:
        return self._recording.value == _TOGETHER

    def _show_recording(self) -> None:
        if self._comparison is not None:
            self._put(self._at())
            self._plots.show(View(self._comparison, self._at(), self._region, together=self._all_together()))

    def _moved(self, on: str, time_s: float, _: tuple[float, float]) -> None:
        """The clock has moved: the charts' line follows, while it plays once a second, as drawing them takes long."""
        comparison = self._comparison
        if (
            on != WORKSPACE.name
            or comparison is None
            or self._all_together()
            or abs(time_s - self._time_s) < _LEAST_MOVE_S
        ):
            return
        if self._strip.playback.playing and time.monotonic() - self._drawn_at < _PLAYING_REDRAW_S:
            return
        self._time_s = time_s
        self._plots.move(View(comparison, self._at(), self._region, time_s))
        self._drawn_at = time.monotonic()


def headline(comparison: Comparison) -> Html:
    """The sentences."""
    first, *others = comparison.sentences or ("",)
    regions = {region.sentence for region in comparison.worst_regions}  # which stand in their own list
    told = [html("<div>{}</div>", text) for text in [*others, of_floor(comparison)] if text not in regions]
    return html(
        "<div {}>{}{}</div>",
        _BOX,
        large(first, of_comparison(comparison)),
        explained(joined([*told, warned(comparison.warnings)])),
    )


def numbers(comparison: Comparison) -> Html:
    """For each signal, error against floor."""
    return explained(
        html(
            "<div {}>{}{}{}</div>",
            _BOX,
            shown(errors(comparison)),
            html('<div style="opacity:.8;font-size:12.5px">{}</div>', FLOOR_NOTE),
            folded("Each measurement", errors_by_recording(comparison, comparison.primary)),
        )
    )
