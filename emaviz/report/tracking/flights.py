"""All k over the flights."""

from __future__ import annotations

from ema_model.tracking.result import Tracked
from emaviz.figures import k_over_flights
from emaviz.report.section import Figures, Section


class Flights(Section[Tracked]):
    """Those without a remaining life, which stands above with its k."""

    title = "k over the flights"
    anchor = "flights"
    place = 30

    def body(self, subject: Tracked, figures: Figures) -> str:
        """A figure each."""
        return "".join(
            figures.place(k_over_flights.figure(subject, name), 220)
            for name, one in subject.faults.items()
            if one.remaining is None
        )
