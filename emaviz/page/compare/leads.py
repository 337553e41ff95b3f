"""Where one goes from a comparison: to what is missing from the model, or to the faults in its recordings."""

from __future__ import annotations

import viser

from ema_model.errors import InputError
from emaviz.page.leads import Lead, Leads
from emaviz.page.page import Page
from emaviz.session.discover.discovering import Discovering


def leads(page: Page, discovering: Discovering) -> Leads:
    """Two buttons, below the answer."""
    comparing, session = discovering.comparing, page.session

    def to_identify() -> None:
        names = [name for name, one in comparing.opened.items() if one.measurement is not None]
        if not names:
            raise InputError("no measurement is open here any more; add one first")
        if comparing.actuator != session.actuator:
            raise InputError(
                f"Identify knows {session.actuator.name}, the actuator that the app was started with; start it with "
                f"--actuator to identify faults of {comparing.actuator.name}"
            )
        session.settings.set("source", names[0])

    return Leads(
        page,
        [
            Lead(
                "Find what is missing",
                viser.Icon.BULB,
                "Takes these measurements to Discover",
                "discover",
                lambda: discovering.choose(""),
            ),
            Lead(
                "Identify faults",
                viser.Icon.SEARCH,
                "Takes the first of these measurements to Identify",
                "identify",
                to_identify,
            ),
        ],
    )
