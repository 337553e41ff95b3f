"""The answer in plain words, first of all."""

from __future__ import annotations

from ema_model.comparison.result import Comparison
from ema_model.comparison.words import of_floor, verdict
from emaviz.report.markup import bullets, escape, paragraph
from emaviz.report.section import Figures, Section
from emaviz.text.verdict import of_comparison


class Answer(Section[Comparison]):
    """The sentences, whether the model is adequate, and what to be warned of."""

    title = "The answer"
    anchor = "answer"
    place = 10

    def body(self, subject: Comparison, figures: Figures) -> str:
        """Always there."""
        told = verdict(subject)
        first, *others = subject.sentences or (f"The model is {told}.",)
        return (
            f'<p><span class="verdict {of_comparison(subject)}">{escape(told)}</span></p>'
            + paragraph(first, "answer")
            + "".join(paragraph(sentence) for sentence in [*others, of_floor(subject)])
            + bullets(subject.warnings, "warning")
        )
