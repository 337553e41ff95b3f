"""Explore's fan: five severities of one fault beside each other, at one click."""

from __future__ import annotations

from typing import Any

import viser

from ema_model.faults import FAULTS, HEALTHY
from emaviz.figures.fan import LiveFan
from emaviz.page.explore import WORKSPACE
from emaviz.page.page import Page
from emaviz.session.fan import Fan
from emaviz.text.html import add_html, said

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
        show.on_click(lambda _: self._ask())
        self._fault.on_update(lambda event: event.client and self._ask())
        page.session.events.fanned.connect(lambda fan: page.screen.post("fan", lambda: self._draw(fan)))

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
