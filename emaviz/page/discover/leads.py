"""Where one goes from a discovery: with the improved model to Explore."""

from __future__ import annotations

import viser

from ema_model.errors import InputError
from emaviz.page.leads import Lead, Leads
from emaviz.page.page import Page
from emaviz.session.discover.discovering import Discovering


def leads(page: Page, discovering: Discovering) -> Leads:
    """A button, beside those that save it."""

    def to_explore() -> None:
        look, entry = discovering.look, discovering.entries.current
        if look is None or entry is None:
            raise InputError("nothing is discovered yet; press Start first")
        page.session.take_plant(f"improved model of discovery {entry.number}, {entry.at:%H:%M}", look.found.actuator)

    return Leads(
        page,
        [
            Lead(
                "Use in Explore",
                viser.Icon.ADJUSTMENTS,
                "Explore's plant takes this improved model; the monitor there stays the file's",
                "explore",
                to_explore,
            )
        ],
    )
