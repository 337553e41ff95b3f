"""What the report is about."""

from __future__ import annotations

from dataclasses import dataclass, field

from ema_model.campaign.thesis import Evaluation
from ema_model.campaign.thesis.responses import Drawn
from emaviz.report.campaign.subject import Rows


@dataclass
class Reproduced:
    """The evaluation, and the responses that the thesis draws."""

    evaluation: Evaluation
    drawn: Drawn
    rows: Rows = field(init=False)

    def __post_init__(self) -> None:
        self.rows = Rows(self.evaluation.store)
