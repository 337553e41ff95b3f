"""What stays of compared units: the report, and the type as an actuator's file."""

from __future__ import annotations

from typing import Any

import viser

from emaviz.page.kept import REPORT, KeepButtons, Keeps
from emaviz.page.page import Page
from emaviz.session.units.comparing_units import TYPE, ComparingUnits

_TYPE = Keeps(
    "Save the type as an actuator",
    TYPE,
    viser.Icon.DEVICE_FLOPPY,
    "Means as values, and how far a further unit may be from them as tolerances",
)


class UnitsKeep(KeepButtons):
    """Two buttons, and what they have written."""

    def __init__(self, page: Page, comparing: ComparingUnits) -> None:
        def save(suffix: str, button: Any) -> None:
            page.ask(f"units {suffix}", lambda: comparing.save(suffix), button)

        super().__init__(
            page, "units", comparing.folder, None, comparing.events.kept, save, comparing.provenance, REPORT, _TYPE
        )
