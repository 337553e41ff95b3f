"""From a flight to its comparison: the same recording, alone, on Compare."""

from __future__ import annotations

from collections.abc import Callable

import viser

from ema_model.errors import InputError
from ema_model.tracking.flight import Flight
from emaviz.page.compare import WORKSPACE as COMPARE
from emaviz.page.leads import Lead, Leads
from emaviz.page.page import Page
from emaviz.session.compare.comparing import Comparing
from emaviz.session.track.following import Following

_TO = COMPARE.name


class FlightLead:
    """A button for the flight that is chosen, and the way for one that is clicked."""

    def __init__(
        self, page: Page, comparing: Comparing, following: Following, chosen: Callable[[], Flight | None]
    ) -> None:
        self._page, self._comparing, self._following, self._chosen = page, comparing, following, chosen
        hint = "Opens its recording on Compare; so does a click on a point above"
        Leads(page, [Lead("Compare this flight", viser.Icon.ARROWS_DIFF, hint, _TO, self._take)])

    def follow(self, client: viser.ClientHandle | None) -> None:
        """As the button does, with the window that asked; on the screen's thread."""
        if self._page.checked(self._take):
            self._page.workspaces.go(_TO, client)

    def _take(self) -> None:
        flight, comparing = self._chosen(), self._comparing
        if flight is None:
            raise InputError("no flight is chosen")
        if self._following.job.running:
            raise InputError("flights are being identified; stop that first")
        name, actuator = self._following.file_of(flight), comparing.session.actuator.name
        if comparing.actuator_name != actuator:
            comparing.choose_actuator(actuator)
        for other in [other for other in comparing.opened if other != name]:
            comparing.remove(other)
        comparing.add(name)
