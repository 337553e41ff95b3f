"""All that the terminal says, first of all."""

from __future__ import annotations

from ema_model.tracking.result import Tracked
from emaviz.report.words_section import WordsSection


class Answer(WordsSection[Tracked]):
    """Of a unit's flights."""
