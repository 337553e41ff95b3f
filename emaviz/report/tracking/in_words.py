"""All that the terminal says, first of all."""

from __future__ import annotations

from ema_model.text import Lines, Note, Table
from ema_model.tracking.result import Tracked
from emaviz.report.markup import bullets, paragraph, with_remarks
from emaviz.report.section import Figures, Section


class Answer(Section[Tracked]):
    """The document of the result, block by block."""

    title = "The answer"
    anchor = "answer"
    place = 10

    def body(self, subject: Tracked, figures: Figures) -> str:
        """Always there."""
        written = []
        for block in subject.document.blocks:
            if isinstance(block, Lines):
                written += [paragraph(line) for line in block.lines]
            elif isinstance(block, Note):
                written.append(bullets([block.line], "warning"))
            elif isinstance(block, Table):
                written.append(with_remarks(block))
        return "".join(written)
