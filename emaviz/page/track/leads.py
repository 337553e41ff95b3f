"""From a flight to its comparison: the same recording, alone, on Compare."""

from __future__ import annotations

from collections.abc import Callable

import viser

from ema_model.errors import InputError
from ema_model.tracking.flight import Flight
from emaviz.page.leads import Lead, Leads
from emaviz.page.page import Page
from emaviz.session.compare.comparing import Comparing
from emaviz.session.track.following import Following


class FlightLead:
    """A button; chosen(): the flight that it takes there."""

    def __init__(
        self, page: Page, comparing: Comparing, following: Following, chosen: Callable[[], Flight | None]
    ) -> None:
        def take() -> None:
            flight = chosen()
            if flight is None:
                raise InputError("no flight is chosen")
            if following.job.running:
                raise InputError("flights are being identified; stop that first")
            name, actuator = following.file_of(flight), comparing.session.actuator.name
            if comparing.actuator_name != actuator:
                comparing.choose_actuator(actuator)
            for other in [other for other in comparing.opened if other != name]:
                comparing.remove(other)
            comparing.add(name)

        self._leads = Leads(
            page,
            [Lead("Compare this flight", viser.Icon.ARROWS_DIFF, "Opens its recording on Compare", "compare", take)],
        )
