"""What was computed, with which version, in how much time, and what failed."""

from __future__ import annotations

from emaviz.report.campaign.effort import Effort
from emaviz.report.campaign.errors import Errors
from emaviz.report.campaign.progress import Progress
from emaviz.report.reproduce.subject import Reproduced
from emaviz.report.section import Figures, Section


class HowMade(Section[Reproduced]):
    """As a campaign's own report has it."""

    title = "How it was made"
    anchor = "made"
    place = 100

    def body(self, subject: Reproduced, figures: Figures) -> str:
        """Always there."""
        return "".join(part.body(subject.rows, figures) for part in (Progress(), Errors(), Effort()))
