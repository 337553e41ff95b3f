"""The physics that units lack, and beside it what they differ in, as a comparison of the units shows it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from ema_model.fleet.discovery import UnitsDiscovered, headline
from emaviz.text.results import Meaning
from emaviz.views import Figures, Section, View
from emaviz.views.fleet import SECTIONS


def _of_compared(part: Any) -> Any:
    """A comparison's figures, of the comparison that is in a discovery."""
    if not isinstance(part, Figures):
        return part

    def drawn(result: Any) -> Any:
        return part.of(result.compared)

    def height_px(result: Any) -> int:
        return part.height(result.compared)

    return Figures(drawn, height_px)


def _lead(result: UnitsDiscovered) -> str:
    return f"{result.actuator.name}, {len(result.units)} units"


def _meaning(result: UnitsDiscovered) -> Meaning:
    return "found" if result.lacks else "good"


_SECTIONS: tuple[Section[Any], ...] = tuple(replace(one, parts=tuple(map(_of_compared, one.parts))) for one in SECTIONS)

VIEW = View(
    of=UnitsDiscovered, name="units_discovery", title=headline, lead=_lead, sections=_SECTIONS, meaning=_meaning
)
