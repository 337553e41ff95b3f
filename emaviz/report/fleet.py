"""The report of several units that are compared: its sections in reading order, and the page."""

from __future__ import annotations

from pathlib import Path

from ema_model.fleet.result import UnitsCompared, headline
from emaviz.figures import fleet
from emaviz.report.html_document import Figures, Section, WordsSection, page, write


class Answer(WordsSection[UnitsCompared]):
    """Of several units."""


# --- each unit's parameters beside the type's -------------------------------------------------------------------------


class UnitParameters(Section[UnitsCompared]):
    """As each unit's own recordings tell them."""

    title = "Parameters of each unit"
    anchor = "parameters"

    def body(self, subject: UnitsCompared, figures: Figures) -> str:
        """Left out where nothing is told."""
        if not fleet.shown(subject):
            return ""
        return figures.place(fleet.unit_parameters(subject), fleet.height_px(subject))


# --- which unit's model suits which unit ------------------------------------------------------------------------------


class TransferMatrix(Section[UnitsCompared]):
    """The error of each model on each unit, in floors."""

    title = "The model of one unit on another"
    anchor = "transfer"

    def body(self, subject: UnitsCompared, figures: Figures) -> str:
        """Always there."""
        return figures.place(fleet.transfer_matrix(subject), 160 + 28 * len(subject.units))


# --- the report of several units of one type --------------------------------------------------------------------------

SECTIONS: tuple[Section[UnitsCompared], ...] = (Answer(), UnitParameters(), TransferMatrix())


def write_units_report(result: UnitsCompared, path: str | Path) -> None:
    """Writes one HTML file that opens offline, whole or not at all; InputError where it cannot be written."""
    lead = f"{result.actuator.name}, {len(result.units)} units"
    write(path, page(headline(result), lead, SECTIONS, result))
