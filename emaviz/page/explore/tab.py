"""The Explore tab: the plant's faults and command, and its run beside the model's."""

from __future__ import annotations

import viser

from ema_model.simulation import plant
from ema_model.text import COLOURS
from emaviz.page.explore import WORKSPACE
from emaviz.page.explore.charts import ChartsPanel
from emaviz.page.explore.controls import ExplorePanel
from emaviz.page.explore.export import ExportControls
from emaviz.page.explore.seal import SealControls
from emaviz.page.tab import Shared, Tab
from emaviz.session.archive import recovered
from emaviz.session.session import Simulation
from emaviz.text.html import add_html, html, said

_NOTE = f"padding:6px 12px;font-size:13px;line-height:1.45;border-left:3px solid {COLOURS['warning']}"


class ExploreTab(Tab):
    """Runs are drawn as they come."""

    workspace = WORKSPACE

    def __init__(self, shared: Shared, right: viser.PanelHandle) -> None:
        super().__init__(shared, right)
        self.charts = ChartsPanel(
            self.page,
            shared.slow_screen,
            right,
            shared.strip,
            lambda charts: ExportControls(self.page, shared.strip, charts, shared.comparing.folder),
        )

    def build(self) -> None:
        """A note where the actuator needs one, the controls, and sealing."""
        if text := plant.note(self.page.session.actuator):
            add_html(self.page.server.gui, html('<div style="{}">{}</div>', _NOTE, text))
        self.panel = ExplorePanel(self.page, self.charts.fan.ask_for)
        SealControls(self.page, self.shared.discovering.sealing)
        self.panel.note("\n".join(recovered(self.shared.comparing.folder.recordings)))
        events, post = self.page.session.events, self.page.screen.post
        events.simulated.connect(lambda simulation: post("signals", lambda: self._draw(simulation)))
        events.status.connect(lambda text: post("status", lambda: self._status(text)))

    def show_settings(self) -> None:
        """On the sliders and the command."""
        self.panel.show_settings()

    def _draw(self, simulation: Simulation) -> None:
        self.charts.show(simulation)
        self.shared.strip.playback.show(simulation)
        self.shared.strip.say()
        self.panel.show_preset()
        self.panel.show_model(simulation)

    def _status(self, text: str) -> None:
        self.panel.status.content = said(text)
