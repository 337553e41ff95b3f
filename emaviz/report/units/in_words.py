"""All that the terminal says, first of all."""

from __future__ import annotations

from ema_model.units.result import UnitsCompared
from emaviz.report.words_section import WordsSection


class Answer(WordsSection[UnitsCompared]):
    """Of several units."""
