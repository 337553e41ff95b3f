"""When the thresholds are crossed."""

from __future__ import annotations

from ema_model.tracking.result import Tracked
from emaviz.figures import k_over_flights, remaining_life
from emaviz.report.section import Figures, Section, pair


class RemainingLife(Section[Tracked]):
    """Of each k with a remaining life: the way to the threshold, and the distribution."""

    title = "Remaining life"
    anchor = "remaining"
    place = 20

    def body(self, subject: Tracked, figures: Figures) -> str:
        """Left out where nothing ends."""
        return "".join(
            pair(
                figures.place(k_over_flights.figure(subject, name)),
                figures.place(remaining_life.figure(one.remaining)),
            )
            for name, one in subject.faults.items()
            if one.remaining is not None
        )
