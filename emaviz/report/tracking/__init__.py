"""The report of a unit's flights."""

from __future__ import annotations

from pathlib import Path

from ema_model.tracking.result import Tracked
from ema_model.tracking.words import headline
from emaviz.report.page import page, write
from emaviz.report.section import Section, sections

SECTIONS: tuple[Section[Tracked], ...] = sections(__name__)


def write_tracking_report(result: Tracked, actuator: str, path: str | Path) -> None:
    """Writes one HTML file that opens offline, whole or not at all; InputError where it cannot be written."""
    lead = f"{actuator}, {len(result.flights)} flights"
    write(path, page(headline(result), lead, SECTIONS, result))
