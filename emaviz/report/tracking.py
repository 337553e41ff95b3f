"""The report of a life: its sections in reading order, and the page."""

from __future__ import annotations

from pathlib import Path

from ema_model.tracking.result import Tracked
from ema_model.tracking.words import headline
from emaviz.figures import tracking
from emaviz.report.html_document import Figures, Section, WordsSection, page, pair, write


class Answer(WordsSection[Tracked]):
    """Of a unit's flights."""


# --- when the thresholds are crossed ----------------------------------------------------------------------------------


class RemainingLife(Section[Tracked]):
    """Of each k with a remaining life: the way to the threshold, and the distribution."""

    title = "Remaining life"
    anchor = "remaining"

    def body(self, subject: Tracked, figures: Figures) -> str:
        """Left out where nothing ends."""
        return "".join(
            pair(
                figures.place(tracking.k_over_flights(subject, name)),
                figures.place(tracking.remaining_life(one.remaining)),
            )
            for name, one in subject.faults.items()
            if one.remaining is not None
        )


# --- all k over the flights so far: their evidence, and where each jumped, from where on it is judged anew ------------


class Flights(Section[Tracked]):
    """Those without a remaining life, which stands above with its k."""

    title = "k over the flights"
    anchor = "flights"

    def body(self, subject: Tracked, figures: Figures) -> str:
        """A figure each."""
        return "".join(
            figures.place(tracking.k_over_flights(subject, name), 220)
            for name, one in subject.faults.items()
            if one.remaining is None
        )


# --- the report of a unit's flights -----------------------------------------------------------------------------------

SECTIONS: tuple[Section[Tracked], ...] = (Answer(), RemainingLife(), Flights())


def write_tracking_report(result: Tracked, actuator: str, path: str | Path) -> None:
    """Writes one HTML file that opens offline, whole or not at all; InputError where it cannot be written."""
    lead = f"{actuator}, {len(result.flights)} flights"
    write(path, page(headline(result), lead, SECTIONS, result))
