"""The report of a campaign, a file for each section."""

from __future__ import annotations

from pathlib import Path

from ema_model.campaign.store import Store
from emaviz.report.campaign.subject import Rows
from emaviz.report.page import page, write
from emaviz.report.section import Section, sections

SECTIONS: tuple[Section[Rows], ...] = sections(__name__)


def write_campaign_report(store: Store, path: str | Path) -> None:
    """Writes one HTML file that opens offline, whole or not at all; InputError where it cannot be written."""
    write(path, page(store.header.title, store.header.about, SECTIONS, Rows(store)))
