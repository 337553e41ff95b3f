"""The report of the thesis's evaluation, a file for each section."""

from __future__ import annotations

from pathlib import Path

from ema_model.campaign.thesis import Evaluation
from ema_model.campaign.thesis.responses import Drawn
from emaviz.report.page import page, write
from emaviz.report.reproduce.subject import Reproduced
from emaviz.report.section import Section, sections

SECTIONS: tuple[Section[Reproduced], ...] = sections(__name__)


def write_reproduction_report(evaluation: Evaluation, drawn: Drawn, path: str | Path) -> None:
    """Writes one HTML file that opens offline, whole or not at all; InputError where it cannot be written."""
    header = evaluation.store.header
    write(path, page(header.title, header.about, SECTIONS, Reproduced(evaluation, drawn)))
