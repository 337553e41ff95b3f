"""The parameters of the last model, its effects' included."""

from __future__ import annotations

from ema_model.actuator.naming import on_axes
from ema_model.faults import NAMES
from ema_model.quantities.numbers import number
from ema_model.quantities.titles import in_sentence
from emaviz.report.discovery.subject import Told
from emaviz.report.markup import bullets, paragraph, table
from emaviz.report.section import Figures, Section

_MARK = "\x1e"  # before a parameter at its bound


class Calibrated(Section[Told]):
    """Convergence, table, and which parameters trade against each other."""

    title = "Calibration of the last model"
    anchor = "calibration"
    place = 90

    def body(self, subject: Told, figures: Figures) -> str:
        """Always there."""
        fit, axes = subject.found.calibration, subject.found.actuator.axes

        def named(path: str) -> str:
            return path if path in NAMES else on_axes(path, axes).title

        how = "It has converged" if fit.converged else "It has not converged: its values are not to be trusted"
        told = f"{how}; χ² per value {number(fit.chi2_per_value)}, {fit.evaluations} evaluations."
        rows = [
            [
                named(path),
                one.unit or "–",
                number(one.initial, 4),
                number(one.value, 4),
                f"{number(one.interval90[0], 4)} … {number(one.interval90[1], 4)}",
                f"{_MARK if one.at_bound else ''}{one.z:+.2f}".replace("-", "−"),
            ]
            for path, one in fit.parameters.items()
        ]
        heads = ["Parameter", "unit", "started at", "calibrated", "90 % interval", "z [σ]"]
        pairs = [
            f"{named(a)} and {in_sentence(named(b))} trade against each other: only both together are known."
            for a, b in fit.confounded
        ]
        return (
            paragraph(told, "" if fit.converged else "bad")
            + table(heads, rows, text_columns=2, marked=_MARK)
            + bullets(pairs, "small")
        )
