"""The report of several units of one type."""

from __future__ import annotations

from pathlib import Path

from ema_model.units.result import UnitsCompared
from ema_model.units.words import headline
from emaviz.report.page import page, write
from emaviz.report.section import Section, sections

SECTIONS: tuple[Section[UnitsCompared], ...] = sections(__name__)


def write_units_report(result: UnitsCompared, path: str | Path) -> None:
    """Writes one HTML file that opens offline, whole or not at all; InputError where it cannot be written."""
    lead = f"{result.actuator.name}, {len(result.units)} units"
    write(path, page(headline(result), lead, SECTIONS, result))
