"""The report of a campaign, a file for each section."""

from __future__ import annotations

from pathlib import Path

from ema_model.campaign.store import Store
from emaviz.report.campaign.answers import Answers
from emaviz.report.campaign.convergence import Convergence
from emaviz.report.campaign.distributions import Distributions
from emaviz.report.campaign.effort import Effort
from emaviz.report.campaign.errors import Errors
from emaviz.report.campaign.progress import Progress
from emaviz.report.campaign.subject import Rows
from emaviz.report.campaign.tables import Tables
from emaviz.report.page import page, write
from emaviz.report.section import Section

SECTIONS: tuple[Section[Rows], ...] = (
    Progress(),
    Tables(),
    Distributions(),
    Answers(),
    Convergence(),
    Errors(),
    Effort(),
)


def write_campaign_report(store: Store, path: str | Path) -> None:
    """Writes one HTML file that opens offline, whole or not at all; InputError where it cannot be written."""
    write(path, page(store.header.title, store.header.about, SECTIONS, Rows(store)))
