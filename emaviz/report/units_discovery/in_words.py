"""All that the terminal says, first of all."""

from __future__ import annotations

from ema_model.units.discovery.result import UnitsDiscovered
from emaviz.report.words_section import WordsSection


class Answer(WordsSection[UnitsDiscovered]):
    """Of the physics that units lack."""
