"""Where this is not the thesis's own evaluation."""

from __future__ import annotations

from ema_model.campaign.thesis.deviations import DEVIATIONS
from emaviz.report.markup import table
from emaviz.report.reproduce.subject import Reproduced
from emaviz.report.section import Figures, Section


class Deviations(Section[Reproduced]):
    """A line each."""

    title = "Where this deviates from the thesis, and why"
    anchor = "deviations"
    place = 50

    def body(self, subject: Reproduced, figures: Figures) -> str:
        """Always there."""
        lines = [[one.what, one.thesis, one.here, one.why] for one in DEVIATIONS]
        return table(["What", "Thesis", "Here", "Why"], lines, text_columns=4)
