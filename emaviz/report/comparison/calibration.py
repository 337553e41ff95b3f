"""What calibration moved, how surely, and what it warns of."""

from __future__ import annotations

from ema_model.comparison.result import Comparison
from ema_model.quantities.numbers import number
from ema_model.quantities.titles import in_sentence
from emaviz.figures import calibration_scores
from emaviz.report.markup import bullets, paragraph, table
from emaviz.report.section import Figures, Section

_MARK = "\x1e"  # before a parameter at its bound


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
        found = calibration_scores.scores(subject)
        how = "It has converged" if fit.converged else "It has not converged: its values are not to be trusted"
        parts = [
            paragraph(
                f"{how}; χ² per value {number(fit.chi2_per_value)} (1 is the floor), {fit.evaluations} evaluations.",
                "" if fit.converged else "bad",
            )
        ]
        if found:
            parts.append(figures.place(calibration_scores.figure(subject), 110 + 30 * len(found), "scores"))
            parts.append(_table(found))
        parts.append(bullets(self._warnings(subject, found), "warning"))
        return "".join(parts)

    def _warnings(self, comparison: Comparison, found: list[calibration_scores.Score]) -> list[str]:
        warnings = [
            f"{score.title} stands at the bound of its tolerance: the model wants more than the file allows."
            for score in found
            if score.at_bound
        ]
        assert comparison.calibration is not None
        titles = {score.path: score.title for score in found}
        return warnings + [
            f"{titles.get(a, a)} and {in_sentence(titles.get(b, b))} trade against each other here: "
            "only both together are known."
            for a, b in comparison.calibration.confounded
        ]


def _table(found: list[calibration_scores.Score]) -> str:
    rows = [
        [
            score.title,
            score.unit,
            number(score.nominal, 4),
            number(score.value, 4),
            f"{number(score.low, 4)} … {number(score.high, 4)}",
            f"{_MARK if score.at_bound else ''}{score.z:+.2f}".replace("-", "−"),
        ]
        for score in found
    ]
    heads = ["Parameter", "unit", "file", "calibrated", "90 % interval", "z [σ]"]
    return table(heads, rows, text_columns=2, marked=_MARK)
