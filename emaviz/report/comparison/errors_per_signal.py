"""How far the model is from each signal, against the floor, before and after calibration."""

from __future__ import annotations

from ema_model.comparison.result import Comparison
from ema_model.comparison.words import errors, errors_by_recording
from emaviz.figures import quantity
from emaviz.report.markup import escape, folded, paragraph, with_remarks
from emaviz.report.section import Figures, Section

_NOTE = (
    "The floor is what a perfect model would leave: the sensors' noise, and what the model leaves out on "
    "purpose (the inverter's switching). An error over floor near 1 cannot be made smaller."
)


class ErrorsPerSignal(Section[Comparison]):
    """A table over all recordings, and one for each signal by recording where there are several."""

    title = "Errors"
    anchor = "errors"
    place = 20

    def body(self, subject: Comparison, figures: Figures) -> str:
        """Always there."""
        parts = [with_remarks(errors(subject)), paragraph(_NOTE, "small")]
        for name in subject.signals:
            if (told := errors_by_recording(subject, name)) is not None:
                title = f"{quantity.of_signal(subject, name).title}, by recording"
                rows = with_remarks(told)
                parts.append(f"<h3>{escape(title)}</h3>{rows}" if name == subject.primary else folded(title, rows))
        return "".join(parts)
