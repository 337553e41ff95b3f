"""The report of what several units lack: its sections in reading order, and the page."""

from __future__ import annotations

from pathlib import Path

from ema_model.fleet.discovery import UnitsDiscovered, headline
from emaviz.report.fleet import TransferMatrix, UnitParameters
from emaviz.report.html_document import Figures, Section, WordsSection, page, write


class Answer(WordsSection[UnitsDiscovered]):
    """Of the physics that units lack."""


# --- what differs between the units beside the physics that they lack -------------------------------------------------


class Parameters(Section[UnitsDiscovered]):
    """As a comparison of the units shows them, with what all units lack in the model."""

    title, anchor = UnitParameters.title, UnitParameters.anchor

    def body(self, subject: UnitsDiscovered, figures: Figures) -> str:
        """Left out where nothing is told."""
        return UnitParameters().body(subject.compared, figures)


class Transfer(Section[UnitsDiscovered]):
    """The error of each model on each unit."""

    title, anchor = TransferMatrix.title, TransferMatrix.anchor

    def body(self, subject: UnitsDiscovered, figures: Figures) -> str:
        """Always there."""
        return TransferMatrix().body(subject.compared, figures)


# --- the report of the physics that units of one type lack ------------------------------------------------------------

SECTIONS: tuple[Section[UnitsDiscovered], ...] = (Answer(), Parameters(), Transfer())


def write_units_discovery_report(result: UnitsDiscovered, path: str | Path) -> None:
    """Writes one HTML file that opens offline, whole or not at all; InputError where it cannot be written."""
    lead = f"{result.actuator.name}, {len(result.units)} units"
    write(path, page(headline(result), lead, SECTIONS, result))
