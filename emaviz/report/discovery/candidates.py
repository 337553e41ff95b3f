"""All candidates: what each alone would take away from the error, and what could not be seen at all."""

from __future__ import annotations

from ema_model.discovery.shown import tables
from emaviz.figures import candidates
from emaviz.report.discovery.subject import Told
from emaviz.report.markup import document_table, paragraph
from emaviz.report.section import Figures, Section

_NOTE = (
    "Effects of the library and faults of the actuator. Predicted: from what each would change, less what the "
    "calibrated parameters can do as well. The promising ones are fitted together with all parameters; that is the "
    "refitted fall. The ranking is of the first step."
)


class Candidates(Section[Told]):
    """Bars, and the numbers folded away."""

    title = "Candidates"
    anchor = "candidates"
    place = 60

    def body(self, subject: Told, figures: Figures) -> str:
        """Left out where none was scored."""
        found = subject.found
        if not found.candidates:
            return ""
        return (
            figures.place(candidates.figure(found), candidates.height(found), "candidate-bars")
            + paragraph(_NOTE, "small")
            + document_table(tables.candidates(found), "The ranking in numbers")
        )
