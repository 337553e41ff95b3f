"""What is missing and no effect of the library explains, as a curve."""

from __future__ import annotations

from emaviz.figures import missing_curve
from emaviz.report.discovery.subject import Told
from emaviz.report.markup import paragraph
from emaviz.report.section import Figures, Section

_NOTE = (
    "Measured − model: where the curve is positive, more is needed than the model says. Found on a part of the data, "
    "it told the rest ahead. It says what is missing, not why: add it to the model as a torque of your own, or look "
    "for a cause with this shape."
)


class Missing(Section[Told]):
    """Left out where nothing significant is left."""

    title = "What is missing and has no name"
    anchor = "missing"
    place = 40

    def body(self, subject: Told, figures: Figures) -> str:
        """The sentence and the curve."""
        unknown = subject.found.unknown
        if unknown is None:
            return ""
        figure = figures.place(missing_curve.figure(subject.found), 340, "missing-curve")
        return paragraph(unknown.sentence) + figure + paragraph(_NOTE, "small")
