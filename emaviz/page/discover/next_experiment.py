"""Suggested next test: the command and load that tell rivals apart; into Explore, or as CSV for a rig."""

from __future__ import annotations

import io
from collections.abc import Callable
from typing import Any

import numpy as np
import viser

from ema_model.commands import command
from ema_model.discovery.result import Experiment
from ema_model.discovery.steps.snapshot import Look
from ema_model.discovery.words import next_experiment
from emaviz.page.page import Page
from emaviz.session.discover.discovering import Discovering
from emaviz.text.html import add_html, html, joined
from emaviz.text.notes import BOX, note

_RATE_HZ = 10_000.0
_ASK = "Of all tests that the actuator can follow, the one that would tell the two best candidates apart."


class NextTest:
    """A folder of the panel on the right.  load(experiment, client) takes a test, and the window, to Explore."""

    def __init__(
        self, page: Page, discovering: Discovering, load: Callable[[Experiment, viser.ClientHandle | None], None]
    ) -> None:
        self._page, self._discovering = page, discovering
        gui = page.server.gui
        self._folder = gui.add_folder("Suggested next test", visible=False)
        with self._folder:
            self._text = add_html(gui, note(_ASK))
            self._find = gui.add_button("Find the best test", icon=viser.Icon.FLASK)
            self._load = gui.add_button("Load it into Explore", icon=viser.Icon.ADJUSTMENTS, visible=False)
            self._csv = gui.add_button(
                "Command as CSV", icon=viser.Icon.FILE_SPREADSHEET, color="gray", visible=False, hint="For a test rig"
            )
        self._load.on_click(
            lambda event: page.screen.post(
                "load test", lambda: self._with(lambda one: load(one, event.client), self._load)
            )
        )
        self._csv.on_click(self._send)
        discovering.events.unsuggested.connect(lambda: page.screen.post("unsuggested", self._nothing))

    def connect(self, ask: Callable[[Callable[[], bool], Any], None]) -> None:
        """ask(begin, button) starts a step."""
        self._find.on_click(lambda _: ask(self._discovering.suggest, self._find))

    def busy(self, busy: bool) -> None:
        """Whether a step runs."""
        self._find.disabled = busy

    def show(self, look: Look | None) -> None:
        """A story as it stands."""
        self._folder.visible = look is not None and look.assessment is not None
        told = next_experiment(look.found) if look is not None else []
        self._load.visible = self._csv.visible = bool(told)
        self._find.color = "gray" if told else None
        if told:
            more = joined(html("<div>{}</div>", text) for text in told[1:])
            self._text.content = html("<div {}><b>{}</b>{}</div>", BOX, told[0], more)
        else:
            self._text.content = note(_ASK)

    def _nothing(self) -> None:
        self._text.content = note("No test that the actuator can follow would tell the two apart.")

    def _with(self, act: Callable[[Experiment], Any], button: Any) -> None:
        one = self._discovering.experiment
        if one is not None:
            self._page.checked(lambda: act(one), button)

    def _send(self, event: viser.GuiEvent[viser.GuiButtonHandle]) -> None:
        client = event.client
        if client is not None:
            self._with(
                lambda one: client.send_file_download("next-test.csv", as_csv(one), save_immediately=True), self._csv
            )


def as_csv(one: Experiment) -> bytes:
    """time_s, command_rad and load_torque_Nm, as a measurement has them."""
    time_s = np.arange(round(one.duration_s * _RATE_HZ)) / _RATE_HZ
    demand = command(one.command, one.settings).at(time_s)
    table = np.column_stack([time_s, demand, np.full_like(time_s, one.load_torque_Nm)])
    text = io.StringIO()
    np.savetxt(text, table, delimiter=",", header="time_s,command_rad,load_torque_Nm", comments="", fmt="%.9g")
    return text.getvalue().encode()
