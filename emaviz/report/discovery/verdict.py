"""The verdict in plain words, first of all."""

from __future__ import annotations

from ema_model.discovery.words import headline, sentences, verdict_name
from emaviz.report.discovery.subject import Told
from emaviz.report.markup import bullets, escape, paragraph
from emaviz.report.section import Figures, Section
from emaviz.text.verdict import of_discovery


class Verdict(Section[Told]):
    """The headline, what follows from it, and what to be warned of."""

    title = "The verdict"
    anchor = "verdict"
    place = 10

    def body(self, subject: Told, figures: Figures) -> str:
        """Always there."""
        found = subject.found
        return (
            f'<p><span class="verdict {of_discovery(found)}">{escape(verdict_name(found))}</span></p>'
            + paragraph(headline(found), "answer")
            + "".join(paragraph(sentence) for sentence in sentences(found))
            + bullets(found.warnings, "warning")
        )
