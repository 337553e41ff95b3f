"""The report of the thesis's evaluation, a file for each section."""

from __future__ import annotations

from pathlib import Path

from ema_model.campaign.thesis import Evaluation
from ema_model.campaign.thesis.responses import Drawn
from emaviz.report.page import page, write
from emaviz.report.reproduce.answer import Answer
from emaviz.report.reproduce.coefficients import Coefficients
from emaviz.report.reproduce.convergence import Convergence
from emaviz.report.reproduce.deviations import Deviations
from emaviz.report.reproduce.how_made import HowMade
from emaviz.report.reproduce.model_bias import ModelBias
from emaviz.report.reproduce.models import Models
from emaviz.report.reproduce.row_by_row import RowByRow
from emaviz.report.reproduce.severities import Severities
from emaviz.report.reproduce.subject import Reproduced
from emaviz.report.reproduce.trade_off import TradeOff
from emaviz.report.section import Section

SECTIONS: tuple[Section[Reproduced], ...] = (
    Answer(),
    RowByRow(),
    Coefficients(),
    ModelBias(),
    Deviations(),
    Convergence(),
    TradeOff(),
    Models(),
    Severities(),
    HowMade(),
)


def write_reproduction_report(evaluation: Evaluation, drawn: Drawn, path: str | Path) -> None:
    """Writes one HTML file that opens offline, whole or not at all; InputError where it cannot be written."""
    header = evaluation.store.header
    write(path, page(header.title, header.about, SECTIONS, Reproduced(evaluation, drawn)))
