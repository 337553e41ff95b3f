"""Which unit's model suits which unit."""

from __future__ import annotations

from ema_model.units.result import UnitsCompared
from emaviz.figures import transfer_matrix
from emaviz.report.section import Figures, Section


class TransferMatrix(Section[UnitsCompared]):
    """The error of each model on each unit, in floors."""

    title = "The model of one unit on another"
    anchor = "transfer"
    place = 20

    def body(self, subject: UnitsCompared, figures: Figures) -> str:
        """Always there."""
        return figures.place(transfer_matrix.figure(subject), 160 + 28 * len(subject.units))
