"""What differs between the units beside the physics that they lack."""

from __future__ import annotations

from ema_model.units.discovery.result import UnitsDiscovered
from emaviz.report.section import Figures, Section
from emaviz.report.units.parameters import UnitParameters
from emaviz.report.units.transfer import TransferMatrix


class Parameters(Section[UnitsDiscovered]):
    """As a comparison of the units shows them, with what all units lack in the model."""

    title, anchor, place = UnitParameters.title, UnitParameters.anchor, UnitParameters.place

    def body(self, subject: UnitsDiscovered, figures: Figures) -> str:
        """Left out where nothing is told."""
        return UnitParameters().body(subject.compared, figures)


class Transfer(Section[UnitsDiscovered]):
    """The error of each model on each unit."""

    title, anchor, place = TransferMatrix.title, TransferMatrix.anchor, TransferMatrix.place

    def body(self, subject: UnitsDiscovered, figures: Figures) -> str:
        """Always there."""
        return TransferMatrix().body(subject.compared, figures)
