"""Parameters that are further from the actuator's file than its tolerance allows: not missing physics."""

from __future__ import annotations

from ema_model.estimation.words import calibration_table
from emaviz.report.discovery.subject import Told
from emaviz.report.markup import paragraph, with_remarks
from emaviz.report.section import Figures, Section

_NOTE = (
    "Nothing new has to act for these: a value of the actuator's file is wrong, or the part is another than the file "
    "says. Check the part, or the file."
)


class OutsideTolerance(Section[Told]):
    """Left out where all are inside."""

    title = "Parameters outside their tolerance"
    anchor = "outside"
    place = 50

    def body(self, subject: Told, figures: Figures) -> str:
        """A table of them."""
        found = subject.found
        if not found.parameters_outside_tolerance:
            return ""
        told = calibration_table(found.calibration, found.actuator.axes, found.parameters_outside_tolerance)
        return (with_remarks(told) if told is not None else "") + paragraph(_NOTE, "small")
