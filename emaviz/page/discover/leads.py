"""Where one goes from a discovery: with the improved model to Explore."""

from __future__ import annotations

from collections.abc import Callable

import viser

from ema_model.actuator import Actuator
from ema_model.errors import InputError
from emaviz.page.leads import Lead, Leads
from emaviz.page.page import Page
from emaviz.session.discover.discovering import Discovering


def leads(page: Page, discovering: Discovering, take_plant: Callable[[str, Actuator], None]) -> Leads:
    """A button, beside those that save it; take_plant(name, actuator): Explore takes it."""

    def to_explore() -> None:
        look, entry = discovering.look, discovering.entries.current
        if look is None or entry is None:
            raise InputError("nothing is discovered yet; press Start first")
        take_plant(f"improved model of discovery {entry.number}, {entry.at:%H:%M}", look.found.actuator)

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
