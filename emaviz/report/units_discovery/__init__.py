"""The report of the physics that units of one type lack."""

from __future__ import annotations

from pathlib import Path

from ema_model.units.discovery.result import UnitsDiscovered
from ema_model.units.discovery.words import headline
from emaviz.report.page import page, write
from emaviz.report.section import Section, sections

SECTIONS: tuple[Section[UnitsDiscovered], ...] = sections(__name__)


def write_units_discovery_report(result: UnitsDiscovered, path: str | Path) -> None:
    """Writes one HTML file that opens offline, whole or not at all; InputError where it cannot be written."""
    lead = f"{result.actuator.name}, {len(result.units)} units"
    write(path, page(headline(result), lead, SECTIONS, result))
