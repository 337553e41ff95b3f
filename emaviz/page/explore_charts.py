"""Explore's charts, the fan of severities, and what can be taken away."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import viser

from ema_model.errors import InputError
from ema_model.faults import FAULTS, HEALTHY
from ema_model.recordings import write_measurement
from emaviz.colours import GHOST, MONITOR, REFERENCE
from emaviz.figures import runs
from emaviz.figures.identification import LiveFan
from emaviz.figures.lines import Window, clipped
from emaviz.figures.runs import PHASE_SIGNALS, LivePhases, LiveSignals, differences, metrics, run_metrics_table
from emaviz.page.charts import hint
from emaviz.page.playback import PlaybackStrip
from emaviz.page.style import TIME_CHARTS, WIDE_MODAL, play_head
from emaviz.page.workspaces import Page, Workspace
from emaviz.scene.playback import FIRST
from emaviz.server.safe_server import SCENES
from emaviz.session.data_folder import DataFolder
from emaviz.session.explore import Fan, Simulation
from emaviz.session.jobs import Worker
from emaviz.text.html import add_html, html, said

PHASES, METRICS = "Phases", "Metrics"
WORKSPACE = Workspace(
    "explore", "Explore", viser.Icon.ADJUSTMENTS, 1, share=0.4, inset=False, waiting=(PHASES, METRICS)
)


# --- explore's tabs on the right: the signals, the phases, the run in numbers, and what can be taken away -------------


class ChartsPanel:
    """Draws runs: the signals at once, phases and metrics a little later and where a window has them in front."""

    def __init__(
        self,
        page: Page,
        slow: Worker,
        panel: viser.PanelHandle,
        strip: PlaybackStrip,
        export: Callable[[ChartsPanel], object],
    ) -> None:
        """export(charts): builds what is offered of them."""
        self._page, self._slow = page, slow
        self._simulation: Simulation | None = None
        self.ghost: Simulation | None = None
        self._window: Window | None = None  # that is shown, s; None: the whole run
        self._shown = 0  # how often a run or a part of it was to be shown
        self._drawn: dict[str, int] = {}  # which of them each of the other tabs holds
        gui = page.server.gui
        with panel.add_tab("Signals", viser.Icon.CHART_LINE):
            add_html(gui, TIME_CHARTS)
            self._head = add_html(gui)
            # Above the charts, which fill the panel.
            self._freeze = gui.add_button(
                "Freeze this run", icon=viser.Icon.SNOWFLAKE, color="gray", hint="Keeps it as a dashed line"
            )
            self._melt = gui.add_button("Remove the frozen run", icon=viser.Icon.X, color="gray", visible=False)
            self.signals = LiveSignals(gui, page.session.actuator.axes, page.workspaces.heights.set_axes)
            add_html(gui, hint())
            page.workspaces.heights.add(self.signals.handles, spare_px=-48)
        with panel.add_tab(PHASES, viser.Icon.WAVE_SINE):
            add_html(gui, TIME_CHARTS)
            self._phases = LivePhases(gui)
            page.workspaces.heights.add(self._phases.handles)
        page.measuring.add(self.signals.handles, self.signals.lines, self._zoom)
        page.measuring.add(self._phases.handles, self._phases.lines, self._zoom)
        self.fan = FanView(page, panel)
        with panel.add_tab(METRICS, viser.Icon.TABLE):
            self._table: Any = add_html(gui)
        with panel.add_tab("Export", viser.Icon.DOWNLOAD):
            export(self)
        strip.moves.connect(self._moved)
        slow.hear_any([page.workspaces.in_front.came], self._draw_rest)
        page.pressed(self._freeze, lambda: self._set_ghost(self._simulation))
        page.pressed(self._melt, lambda: self._set_ghost(None))

    def show(self, simulation: Simulation) -> None:
        """Draws a run; on the screen's thread."""
        before, self._simulation = self._simulation, simulation
        if before is not None and before.reference.duration_s != simulation.reference.duration_s:
            self._set_window(None)
        self._shown += 1
        self._draw_signals(simulation)
        self._slow.post("phases", self._draw_rest)

    @property
    def window_s(self) -> tuple[float, float]:
        """From and to when the charts show the run."""
        if self._simulation is None:
            return 0.0, 1.0
        return self._window or (0.0, self._simulation.reference.duration_s)

    def _moved(self, on: str, time_s: float, _: tuple[float, float]) -> None:
        if on == FIRST:
            low, high = self.window_s
            self._head.content = play_head((time_s - low) / (high - low) if high > low else None)

    def _draw_signals(self, simulation: Simulation) -> None:
        ghost = self.ghost.reference if self.ghost is not None else None
        with self._page.server.atomic():
            self.signals.show(simulation.reference, simulation.monitor, ghost, self.window_s)

    def _draw_rest(self) -> None:
        """What is in front somewhere and not of what is shown."""
        for tab, draw in ((PHASES, self._draw_phases), (METRICS, self._draw_metrics)):
            shown, simulation = self._shown, self._simulation  # in this order: what came between is drawn again
            if simulation is None or self._drawn.get(tab) == shown or not self._page.workspaces.in_front.anywhere(tab):
                continue
            self._drawn[tab] = shown
            with self._page.server.atomic():
                draw(simulation, self.ghost)

    def _draw_phases(self, simulation: Simulation, ghost: Simulation | None) -> None:
        frozen = ghost.reference if ghost is not None else None
        if all(name in simulation.reference for name in PHASE_SIGNALS):
            self._phases.show(simulation.reference, simulation.monitor, frozen)

    def _draw_metrics(self, simulation: Simulation, ghost: Simulation | None) -> None:
        axes = self._page.session.actuator.axes
        runs = {
            "plant": metrics(simulation.reference, simulation.command),
            "monitor": metrics(simulation.monitor, simulation.command),
        }
        errors = {"monitor − plant": differences(simulation.reference, simulation.monitor, axes)}
        if ghost is not None:
            runs["frozen plant"] = metrics(ghost.reference, ghost.command)
            errors["frozen run's"] = differences(ghost.reference, ghost.monitor, axes)
        self._table.content = run_metrics_table(runs, errors, [REFERENCE, MONITOR, GHOST], axes)

    def _zoom(self, window_s: Window | None) -> None:
        if self._simulation is not None:
            self._set_window(clipped(window_s, self._simulation.reference.time_s))
            self._redraw()

    def _set_window(self, window_s: Window | None) -> None:
        self._window = window_s
        self._phases.zoom(window_s)

    def _set_ghost(self, simulation: Simulation | None) -> None:
        self.ghost = simulation
        self._melt.visible = simulation is not None
        self._redraw()

    def _redraw(self) -> None:
        if self._simulation is not None:
            self.show(self._simulation)


# --- explore's fan: five severities of one fault beside each other, at one click --------------------------------------

TITLE = "Fan"
_LABELS = tuple(fault.label for fault in FAULTS)
_ABOUT = (
    "The monitor model's response to the command under five severities of one fault, the other sliders as they stand."
)


class FanView:
    """In a tab on the right; follows the fault that was moved last until one is chosen there."""

    def __init__(self, page: Page, panel: viser.PanelHandle) -> None:
        self._page = page
        gui = page.server.gui
        with panel.add_tab(TITLE, viser.Icon.CHART_AREA_LINE):
            self._fault: Any = gui.add_dropdown("Fault", _LABELS)
            show = gui.add_button("Show five severities", icon=viser.Icon.CHART_AREA_LINE)
            self._note = add_html(gui, said(_ABOUT))
            self._charts = LiveFan(gui, page.session.actuator.axes)
            page.workspaces.heights.add(self._charts.handles, spare_px=-36)
            page.measuring.add(self._charts.handles, self._charts.lines, self._charts.zoom)
        page.pressed(show, self._ask)
        page.changed(self._fault, self._ask)
        page.screen.hear(page.session.events.fanned, self._draw)

    def ask_for(self, fault: int) -> None:
        """Simulates and draws the fan of one fault, and brings it to the front of windows at Explore."""
        self._fault.value = _LABELS[fault]
        self._ask()
        self._page.workspaces.bring_forward(WORKSPACE.name, "", TITLE)

    def _ask(self) -> None:
        if self._fault.value in _LABELS:
            self._page.session.show_fan(_LABELS.index(self._fault.value))

    def _draw(self, fan: Fan) -> None:
        healthy = FAULTS[fan.fault].name, HEALTHY[fan.fault]
        with self._page.server.atomic():
            self._note.content = said(f"Monitor model; {healthy[0]} is healthy at {healthy[1]:g}. {fan.note}".strip())
            self._charts.show(fan.labels, fan.runs)


# --- what can be taken away from Explore: the run's data, a picture of the plot, the moving scene ---------------------

_FRAMES, _FRAME_S = 120, 0.04  # of an exported scene
_NAME = "emaviz-run"


class ExportControls:
    """Buttons; what each makes is sent to the browser that has asked."""

    def __init__(self, page: Page, strip: PlaybackStrip, charts: ChartsPanel, folder: DataFolder) -> None:
        self._folder = folder
        self._page, self._playback, self._charts = page, strip.playback, charts
        gui = page.server.gui
        gui.add_markdown("The run as it stands, in the format that *Compare* reads.")
        self._whose = gui.add_dropdown("Signals of", ("plant", "monitor"), initial_value="plant")
        self._button("Data as CSV", viser.Icon.FILE_SPREADSHEET, lambda client: self._send_data(client, ".csv"))
        self._button("Data as Parquet", viser.Icon.TABLE, lambda client: self._send_data(client, ".parquet"))
        gui.add_markdown("Any chart saves itself: **PNG** at its corner. All four as one figure:")
        self._button("Plot (PNG)…", viser.Icon.PHOTO, self._show_plot)
        gui.add_markdown(
            "The actuator with its motion, in one **HTML** file that opens offline, and a link to it here."
        )
        self._scene = self._button("Scene as HTML", viser.Icon.CUBE, self._send_scene)
        self._link = add_html(gui)

    def _button(self, label: str, icon: viser.IconName, act: Callable[[viser.ClientHandle], None]) -> Any:
        button = self._page.server.gui.add_button(label, icon=icon, color="gray")

        def export(client: viser.ClientHandle | None) -> None:
            if self._page.session.simulation is None:
                raise InputError("Nothing has been simulated yet.")
            if client is not None:
                act(client)

        self._page.pressed_by(button, export)
        return button

    def _run(self) -> Simulation:
        simulation = self._page.session.simulation
        assert simulation is not None, "the buttons act once there is a run"
        return simulation

    def _send_data(self, client: viser.ClientHandle, suffix: str) -> None:
        whose = "monitor" if self._whose.value == "monitor" else "plant"
        run = self._run()
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"{_NAME}-{whose}{suffix}"
            write_measurement(run.monitor if whose == "monitor" else run.reference, path)
            client.send_file_download(path.name, path.read_bytes(), save_immediately=True)

    def _show_plot(self, client: viser.ClientHandle) -> None:
        run, ghost = self._run(), self._charts.ghost
        figure = runs.run_signals(
            run.reference,
            run.monitor,
            ghost.reference if ghost is not None else None,
            self._charts.window_s,
            axes=self._page.session.actuator.axes,
        )
        saved = {"format": "png", "filename": _NAME, "width": 1200, "height": 1000, "scale": 2}
        modal = client.gui.add_modal("Plot")
        with modal:
            add_html(client.gui, WIDE_MODAL)
            client.gui.add_plotly(
                figure,
                config={"displayModeBar": True, "displaylogo": False, "toImageButtonOptions": saved},
                aspect=0.75,
            )
            client.gui.add_button("Close", color="gray").on_click(lambda _: modal.close())

    def _send_scene(self, client: viser.ClientHandle) -> None:
        with self._playback.still() as motion:
            if motion is None:
                return
            serializer = self._page.server.get_scene_serializer()
            for time_s in np.linspace(0.0, motion.duration_s, _FRAMES, endpoint=False):
                motion.pose(self._playback.scene, float(time_s))
                serializer.insert_sleep(_FRAME_S)
            page = serializer.as_html().replace("<title>Viser</title>", "<title>Actuator – emaviz</title>", 1)
        client.send_file_download("emaviz-actuator.html", page.encode(), save_immediately=True)
        path = self._folder.fresh(self._folder.scenes, "actuator", ".html")
        try:
            path.write_bytes(page.encode())
        except OSError as error:
            text = f"No link to the scene: {path.name} cannot be written ({error.strerror})"
            self._page.say_beside(self._scene, text)
            return
        self._link.content = said(html('<a href="{}{}" target="_blank">Open {} ↗</a>', SCENES, path.name, path.name))
