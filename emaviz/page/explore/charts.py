"""Explore's tabs on the right: the signals, the phases, the run in numbers, and what can be taken away."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import viser

from emaviz.colours import GHOST, MONITOR, REFERENCE
from emaviz.figures.run_metrics import differences, metrics, table
from emaviz.figures.signals import PHASE_SIGNALS, LivePhases, LiveSignals
from emaviz.page.explore import METRICS, PHASES
from emaviz.page.explore.fan import FanView
from emaviz.page.page import Page
from emaviz.page.playback import PlaybackStrip
from emaviz.page.style import TIME_CHARTS, play_head
from emaviz.scene.playback import FIRST
from emaviz.session.session import Simulation
from emaviz.session.worker import Worker
from emaviz.text.html import add_html


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
        self._window = (0.0, 1.0)  # shares of the run
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
            page.workspaces.heights.add(self.signals.handles, spare_px=-48)
            self._range = gui.add_multi_slider(
                "Shown [%]", 0, 100, 1, (0, 100), min_range=1, hint="Of the run; zooms all charts, in full resolution"
            )
        with panel.add_tab(PHASES, viser.Icon.WAVE_SINE):
            add_html(gui, TIME_CHARTS)
            self._phases = LivePhases(gui)
            page.workspaces.heights.add(self._phases.handles)
        self.fan = FanView(page, panel)
        with panel.add_tab(METRICS, viser.Icon.TABLE):
            self._table: Any = add_html(gui)
        with panel.add_tab("Export", viser.Icon.DOWNLOAD):
            export(self)
        strip.moves.connect(self._moved)
        page.workspaces.in_front.came.connect(lambda _: slow.post("phases", self._draw_rest))
        self._range.on_update(lambda _: page.screen.post("window", self._zoom))
        self._freeze.on_click(lambda _: page.screen.post("freeze", lambda: self._set_ghost(self._simulation)))
        self._melt.on_click(lambda _: page.screen.post("freeze", lambda: self._set_ghost(None)))

    def show(self, simulation: Simulation) -> None:
        """Draws a run; on the screen's thread."""
        self._simulation = simulation
        self._shown += 1
        self._draw_signals(simulation)
        self._slow.post("phases", self._draw_rest)

    @property
    def window_s(self) -> tuple[float, float]:
        """From and to when the charts show the run."""
        if self._simulation is None:
            return 0.0, 1.0
        reference = self._simulation.reference
        low, high = self._window
        return low * reference.duration_s, high * reference.duration_s

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
            self._phases.show(simulation.reference, simulation.monitor, frozen, self.window_s)

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
        self._table.content = table(runs, errors, [REFERENCE, MONITOR, GHOST], axes)

    def _zoom(self) -> None:
        low, high = (min(max(float(value), 0.0), 100.0) / 100.0 for value in self._range.value)
        self._window = (low, high) if high > low else (0.0, 1.0)
        self._redraw()

    def _set_ghost(self, simulation: Simulation | None) -> None:
        self.ghost = simulation
        self._melt.visible = simulation is not None
        self._redraw()

    def _redraw(self) -> None:
        if self._simulation is not None:
            self.show(self._simulation)
