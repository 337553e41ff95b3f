"""Parameters that are further from the actuator's file than its tolerance allows: not missing physics."""

from __future__ import annotations

from ema_model.actuator.naming import on_axes
from ema_model.quantities.numbers import number
from emaviz.report.discovery.subject import Told
from emaviz.report.markup import paragraph, table
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
        rows = []
        for path in found.parameters_outside_tolerance:
            one = found.calibration.parameters.get(path)
            if one is None:
                rows.append([on_axes(path, found.actuator.axes).title, "", "", "", ""])
                continue
            moved = f"{one.z:+.2f}".replace("-", "−")
            rows.append(
                [on_axes(path, found.actuator.axes).title, one.unit, number(one.initial), number(one.value), moved]
            )
        heads = ["Parameter", "unit", "file", "calibrated", "distance [σ]"]
        return table(heads, rows, text_columns=2) + paragraph(_NOTE, "small")
