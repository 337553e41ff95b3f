"""Each unit's parameters beside the type's."""

from __future__ import annotations

from ema_model.units.result import UnitsCompared
from emaviz.figures import unit_parameters
from emaviz.report.section import Figures, Section


class UnitParameters(Section[UnitsCompared]):
    """As each unit's own recordings tell them."""

    title = "Parameters of each unit"
    anchor = "parameters"
    place = 15

    def body(self, subject: UnitsCompared, figures: Figures) -> str:
        """Left out where nothing is told."""
        if not unit_parameters.shown(subject):
            return ""
        return figures.place(unit_parameters.figure(subject), unit_parameters.height_px(subject))
