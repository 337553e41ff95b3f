"""How far the model is from each signal, against the floor, before and after calibration."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ema_model.comparison.result import Comparison, SignalError
from ema_model.quantities.numbers import number
from emaviz.figures import quantity
from emaviz.report.markup import escape, folded, paragraph, table
from emaviz.report.section import Figures, Section

_MARK = "\x1e"  # before a ratio that stands out
_STANDS_OUT = 1.2


class ErrorsPerSignal(Section[Comparison]):
    """A table over all recordings, and one for each signal by recording where there are several."""

    title = "Errors"
    anchor = "errors"
    place = 20

    def body(self, subject: Comparison, figures: Figures) -> str:
        """Always there."""
        note = (
            "The floor is what a perfect model would leave: the sensors' noise, and what the model leaves out on "
            "purpose (the inverter's switching). An error over floor near 1 cannot be made smaller."
        )
        parts = [_table(subject, subject.signals, "Signal"), paragraph(note, "small")]
        if len(subject.recordings) + len(subject.holdout) > 1:
            for name in subject.signals:
                errors = {f"{i + 1}. {one.name}": one.errors[name] for i, one in _with(subject, name)}
                unseen = (one for one in subject.holdout if name in one.errors)
                errors |= {f"not fitted: {one.name}": one.errors[name] for one in unseen}
                title = quantity.of_signal(subject, name).title
                rows = _table(subject, errors, "Recording", name)
                title = f"{title}, by recording"
                parts.append(f"<h3>{escape(title)}</h3>{rows}" if name == subject.primary else folded(title, rows))
        return "".join(parts)


def _with(comparison: Comparison, name: str):
    return ((i, one) for i, one in enumerate(comparison.recordings) if name in one.errors)


def _table(comparison: Comparison, errors: Mapping[str, SignalError], what: str, signal: str | None = None) -> str:
    calibrated = comparison.calibration is not None
    heads = [what, "rmse" if not calibrated else "rmse, file's model", *(["calibrated"] if calibrated else [])]
    heads += ["floor", "error / floor", "mean |error|", "rmse / range"]
    rows = []
    for name, error in errors.items():
        shown = quantity.of_signal(comparison, signal or name)
        label = name if signal else shown.title
        shown = error.quantity(shown)
        ratio = error.rmse / error.noise_floor if error.noise_floor > 0.0 else float("nan")
        values = [error.rmse_initial, *([error.rmse] if calibrated else []), error.noise_floor]
        rows.append(
            [
                label,
                *(shown.text(value) for value in values),
                f"{_MARK if np.isfinite(ratio) and ratio > _STANDS_OUT else ''}{number(ratio)}",
                shown.text(error.mean_absolute),
                f"{number(100.0 * error.nrmse)} %",
            ]
        )
    return table(heads, rows, marked=_MARK)
