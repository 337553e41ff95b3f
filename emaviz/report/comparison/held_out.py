"""How far the calibrated model is from recordings that were not fitted."""

from __future__ import annotations

from ema_model.comparison.result import Comparison
from ema_model.comparison.words import held_out
from emaviz.report.markup import bullets
from emaviz.report.section import Figures, Section


class HeldOut(Section[Comparison]):
    """Left out where all were fitted."""

    title = "Not fitted"
    anchor = "held-out"
    place = 30

    def body(self, subject: Comparison, figures: Figures) -> str:
        """A line for each."""
        return bullets(held_out(one) for one in subject.holdout)
