"""The parameters of the last model, its effects' included."""

from __future__ import annotations

from ema_model.estimation.words import calibration_table, convergence, warnings
from emaviz.report.discovery.subject import Told
from emaviz.report.markup import bullets, paragraph, with_remarks
from emaviz.report.section import Figures, Section


class Calibrated(Section[Told]):
    """Convergence, table, and which parameters trade against each other."""

    title = "Calibration of the last model"
    anchor = "calibration"
    place = 90

    def body(self, subject: Told, figures: Figures) -> str:
        """Always there."""
        fit, axes = subject.found.calibration, subject.found.actuator.axes
        told = calibration_table(fit, axes)
        return (
            paragraph(convergence(fit), "" if fit.converged else "bad")
            + (with_remarks(told) if told is not None else "")
            + bullets(warnings(fit, axes), "small")
        )
