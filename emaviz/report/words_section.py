"""The section that says what the terminal says."""

from __future__ import annotations

from ema_model.text import InWords, Lines, Note, Table
from emaviz.report.markup import bullets, paragraph, with_remarks
from emaviz.report.section import Figures, Section, Subject


class WordsSection(Section[Subject]):
    """The document of a result, block by block; a report's own file gives it to it."""

    title = "The answer"
    anchor = "answer"
    place = 10

    def body(self, subject: Subject, figures: Figures) -> str:
        """Always there."""
        assert isinstance(subject, InWords)
        written = []
        for block in subject.document.blocks:
            if isinstance(block, Lines):
                written += [paragraph(block.title)] if block.title else []
                written += [paragraph(line) for line in block.lines]
            elif isinstance(block, Note):
                written.append(bullets([block.line], "warning"))
            elif isinstance(block, Table):
                written.append(with_remarks(block))
        return "".join(written)
