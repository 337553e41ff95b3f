"""The measured current beside the Monitor Model's at the answer, and what is left."""

from __future__ import annotations

from ema_model.identification.words import CORRECTED
from ema_model.quantities.numbers import amount
from emaviz.figures import identified_fit
from emaviz.report.identification.subject import Identified
from emaviz.report.markup import paragraph
from emaviz.report.section import Figures, Section


class Fit(Section[Identified]):
    """Two figures for each recording, and the errors."""

    title = "Fit"
    anchor = "fit"
    place = 20

    def body(self, subject: Identified, figures: Figures) -> str:
        """Always there."""
        held = subject.holdout_rmse
        answer = subject.answer
        beside = "" if held is None else f"; {amount(held, 'A')} on the recordings that were not fitted"
        parts = [
            paragraph(
                f"Corrected error {amount(answer.corrected_rmse, 'A')}; as it is drawn here, uncorrected, "
                f"{amount(answer.rmse, 'A')}{beside}. {CORRECTED}"
            )
        ]
        for chart in identified_fit.figures(subject.objective, subject.answer.k):
            parts.append(figures.place(chart, 320))
        return "".join(parts)
