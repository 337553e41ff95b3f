"""What calibration moved, how surely, and what it warns of."""

from __future__ import annotations

from ema_model.comparison.result import Comparison
from ema_model.estimation.words import calibration_table, convergence, warnings
from emaviz.figures import calibration_scores
from emaviz.report.markup import bullets, paragraph, with_remarks
from emaviz.report.section import Figures, Section


class CalibrationTable(Section[Comparison]):
    """Left out where nothing was calibrated."""

    title = "Calibration"
    anchor = "calibration"
    place = 70

    def body(self, subject: Comparison, figures: Figures) -> str:
        """Convergence, figure, table, warnings."""
        fit = subject.calibration
        if fit is None:
            return ""
        parts = [paragraph(convergence(fit), "" if fit.converged else "bad")]
        if (told := calibration_table(fit, subject.actuator.axes)) is not None:
            parts.append(figures.place(calibration_scores.figure(subject), 110 + 30 * len(told.rows), "scores"))
            parts.append(with_remarks(told))
        return "".join([*parts, bullets(warnings(fit, subject.actuator.axes), "warning")])
