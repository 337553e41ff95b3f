"""The error after each step, fitted and held out, and by signal."""

from __future__ import annotations

from ema_model.discovery.shown.tables import ladder, ladder_by_signal, per_recording
from ema_model.discovery.words import FLOOR_NOTE
from emaviz.figures import error_ladder
from emaviz.report.discovery.subject import Told
from emaviz.report.markup import document_table, paragraph, with_remarks
from emaviz.report.section import Figures, Section


class Ladder(Section[Told]):
    """Figure and table."""

    title = "The ladder"
    anchor = "ladder"
    place = 20

    def body(self, subject: Told, figures: Figures) -> str:
        """Always there."""
        found = subject.found
        return (
            figures.place(error_ladder.figure(found), 360, "error-ladder")
            + with_remarks(ladder(found))
            + paragraph(FLOOR_NOTE, "small")
            + document_table(ladder_by_signal(found), "Each signal")
            + document_table(per_recording(found), "Each recording")
        )
