"""The report of a comparison."""

from __future__ import annotations

from pathlib import Path

from ema_model.comparison.result import Comparison
from emaviz.report.comparison.answer import Answer
from emaviz.report.comparison.calibration import CalibrationTable
from emaviz.report.comparison.data_health import DataHealth
from emaviz.report.comparison.errors_per_signal import ErrorsPerSignal
from emaviz.report.comparison.explanation import WhatExplains
from emaviz.report.comparison.held_out import HeldOut
from emaviz.report.comparison.recordings import Recordings
from emaviz.report.comparison.worst_regions import WorstRegions
from emaviz.report.page import page, write
from emaviz.report.section import Section

SECTIONS: tuple[Section[Comparison], ...] = (
    Answer(),
    ErrorsPerSignal(),
    HeldOut(),
    WorstRegions(),
    WhatExplains(),
    Recordings(),
    CalibrationTable(),
    DataHealth(),
)


def write_report(comparison: Comparison, path: str | Path) -> None:
    """Writes one HTML file that opens offline, whole or not at all; InputError where it cannot be written."""
    names = ", ".join(one.name or "recording" for one in comparison.recordings)
    title = "Where the model fails" if not comparison.adequate else "The model is adequate"
    write(path, page(title, f"{comparison.actuator.name} against {names}", SECTIONS, comparison))
