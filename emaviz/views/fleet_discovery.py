"""The physics that units lack, and beside it what they differ in, as a comparison of the units shows it."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from ema_model.fleet.discovery import UnitsDiscovered, headline
from emaviz.text.results import Meaning
from emaviz.views import ANSWER, Piece, Section, View
from emaviz.views.fleet import SECTIONS


def _of_compared(one: Section[Any]) -> Section[UnitsDiscovered]:
    """A comparison's section, of the comparison that is in a discovery."""

    def pieces(result: UnitsDiscovered) -> Iterable[Piece]:
        return one.pieces(result.compared)

    return Section(one.title, one.anchor, of=pieces)


def _lead(result: UnitsDiscovered) -> str:
    return f"{result.actuator.name}, {len(result.units)} units"


def _meaning(result: UnitsDiscovered) -> Meaning:
    return "found" if result.lacks else "good"


VIEW = View(
    of=UnitsDiscovered,
    name="units_discovery",
    title=headline,
    lead=_lead,
    sections=(ANSWER, *(_of_compared(one) for one in SECTIONS if one != ANSWER)),
    meaning=_meaning,
)
