"""What to record next, where effects are left that these recordings cannot tell apart."""

from __future__ import annotations

from ema_model.discovery.words import next_experiment
from emaviz.report.discovery.subject import Told
from emaviz.report.markup import paragraph
from emaviz.report.section import Figures, Section


class NextExperiment(Section[Told]):
    """Left out where nothing is left to tell apart."""

    title = "Next experiment"
    anchor = "next"
    place = 70

    def body(self, subject: Told, figures: Figures) -> str:
        """The command and what it would settle."""
        return "".join(paragraph(sentence) for sentence in next_experiment(subject.found))
