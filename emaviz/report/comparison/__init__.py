"""The report of a comparison."""

from __future__ import annotations

from pathlib import Path

from ema_model.comparison.result import Comparison
from emaviz.report.page import page, write
from emaviz.report.section import Section, sections

SECTIONS: tuple[Section[Comparison], ...] = sections(__name__)


def write_report(comparison: Comparison, path: str | Path) -> None:
    """Writes one HTML file that opens offline, whole or not at all; InputError where it cannot be written."""
    names = ", ".join(one.name or "recording" for one in comparison.recordings)
    title = "Where the model fails" if not comparison.adequate else "The model is adequate"
    write(path, page(title, f"{comparison.actuator.name} against {names}", SECTIONS, comparison))
